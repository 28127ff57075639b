#include "core/io/hdf5_in.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>

#include "core/io/guard/header_check.hpp"
#include "stiction/error.hpp"

namespace stiction::io {
namespace {

/// Makes HDF5 return references to strings of variable length as they lie in the file, for TextHeap. A conversion to
/// opaque bytes that converts nothing does it.
class RawReferences {
 public:
  RawReferences() : text_(H5Tcopy(H5T_C_S1), H5Tclose), type_(H5Tcreate(H5T_OPAQUE, kTextReference), H5Tclose) {
    H5Tset_size(text_.get(), H5T_VARIABLE);
    H5Tset_tag(type_.get(), kName);
    H5Tregister(H5T_PERS_SOFT, kName, text_.get(), type_.get(), leave);
  }
  ~RawReferences() { H5Tunregister(H5T_PERS_SOFT, kName, text_.get(), type_.get(), leave); }
  RawReferences(const RawReferences&) = delete;
  RawReferences& operator=(const RawReferences&) = delete;
  [[nodiscard]] hid_t type() const { return type_.get(); }

 private:
  static constexpr const char* kName = "stiction text reference";
  static herr_t leave(hid_t, hid_t, H5T_cdata_t* path, std::size_t, std::size_t, std::size_t, void*, void*, hid_t) {
    path->need_bkg = H5T_BKG_NO;
    return 0;
  }
  Handle text_, type_;
};

std::string fixed_text(const char* text, std::size_t width) {
  return {text, std::find(text, text + width, '\0')};
}

}  // namespace

InputFile::InputFile(const std::filesystem::path& path) : name_(path.string()) {
  std::error_code trouble;
  const auto status = std::filesystem::status(path, trouble);
  if (status.type() == std::filesystem::file_type::not_found) throw Error(ErrorCode::io, name_ + ": no such file");
  if (status.type() != std::filesystem::file_type::regular) throw Error(ErrorCode::io, name_ + ": not a regular file");
  errno = 0;
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw Error(ErrorCode::io, name_ + ": cannot be read: " + std::strerror(errno));
  file_bytes_ = std::filesystem::file_size(path, trouble);
  if (trouble) throw Error(ErrorCode::io, name_ + ": cannot be read: " + trouble.message());
  stream.close();

  if (H5Fis_hdf5(name_.c_str()) <= 0) {
    refuse(file_bytes_ == 0 ? "the file is empty"
                            : "not an HDF5 file, so neither a contact batch nor FCLIB nor a solution");
  }
  bytes_ = RawBytes(path);
  check_superblock();
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
#if H5_VERSION_GE(1, 10, 7)
  H5Pset_file_locking(access.get(), false, true);  // read-only media cannot be locked
#endif
  file_ = Handle(H5Fopen(name_.c_str(), H5F_ACC_RDONLY, access.get()), H5Fclose);
  if (!file_.ok()) refuse("the HDF5 file is truncated or damaged" + hdf5_reason());
  read_geometry();
}

InputFile::InputFile(std::span<const std::byte> image, std::string name)
    : name_(std::move(name)), file_bytes_(image.size()), bytes_(image) {
  if (image.empty()) refuse("the file is empty");
  check_superblock();
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  constexpr std::size_t kGrowth = 1 << 16;
  H5Pset_fapl_core(access.get(), kGrowth, false);
  // HDF5 copies the image and never writes through the pointer, which merely lacks a const.
  H5Pset_file_image(access.get(), const_cast<std::byte*>(image.data()), image.size());
  file_ = Handle(H5Fopen(name_.c_str(), H5F_ACC_RDONLY, access.get()), H5Fclose);
  if (!file_.ok()) refuse("not an HDF5 file, or a truncated or damaged one" + hdf5_reason());
  read_geometry();
}

void InputFile::refuse(const std::string& sentence) const {
  throw Error(ErrorCode::bad_file, name_ + ": " + sentence);
}

void InputFile::refuse_dataset(const std::string& path, const std::string& what) const {
  refuse("dataset '" + path + "' " + what);
}

bool InputFile::has(const std::string& path) const {
  for (std::size_t end = path.find('/'); true; end = path.find('/', end + 1)) {
    const std::string part = path.substr(0, end);
    const htri_t exists = H5Lexists(file_.get(), part.c_str(), H5P_DEFAULT);
    if (exists < 0) refuse("'" + part + "' cannot be looked up" + hdf5_reason());
    if (exists == 0) return false;
    H5L_info_t link{};
    if (H5Lget_info(file_.get(), part.c_str(), &link, H5P_DEFAULT) < 0) {
      refuse("'" + part + "' cannot be looked up" + hdf5_reason());
    }
    if (link.type != H5L_TYPE_HARD) refuse("'" + part + "' is a soft or external link, only plain objects are read");
    if (end == std::string::npos) return true;
    check_header(part, "");
    const Handle object(H5Oopen(file_.get(), part.c_str(), H5P_DEFAULT), H5Oclose);
    if (!object.ok() || H5Iget_type(object.get()) != H5I_GROUP) refuse("'" + part + "' is not a group" + hdf5_reason());
  }
}

TextHeap InputFile::text_heap() const {
  return {bytes_, file_bytes_, base_};
}

void InputFile::check_superblock() const {
  const std::string defect = superblock_defect(bytes_, file_bytes_);
  if (!defect.empty()) refuse(defect);
}

void InputFile::read_geometry() {
  const Handle creation(H5Fget_create_plist(file_.get()), H5Pclose);
  hsize_t base = 0;
  if (!creation.ok() || H5Pget_userblock(creation.get(), &base) < 0) {
    refuse("the HDF5 file is truncated or damaged" + hdf5_reason());
  }
  base_ = base;
}

void InputFile::check_header(const std::string& path, const std::string& what) const {
  H5L_info_t link{};  // gives the header's place without HDF5 reading it
  if (H5Lget_info(file_.get(), path.c_str(), &link, H5P_DEFAULT) < 0) {
    refuse(what + "'" + path + "' cannot be looked up" + hdf5_reason());
  }
  const std::string defect = header_defect(bytes_, file_bytes_, base_, link.u.address);
  if (!defect.empty()) refuse(what + "'" + path + "' " + defect);
}

InputFile::Dataset InputFile::open(const std::string& path, Values values, std::optional<std::size_t> length) const {
  if (!has(path)) refuse_dataset(path, "is missing");
  check_header(path, "dataset ");
  Dataset dataset;
  dataset.id = Handle(H5Oopen(file_.get(), path.c_str(), H5P_DEFAULT), H5Oclose);
  if (!dataset.id.ok()) refuse_dataset(path, "cannot be opened" + hdf5_reason());
  if (H5Iget_type(dataset.id.get()) != H5I_DATASET) refuse_dataset(path, "is not a dataset");

  dataset.type = Handle(H5Dget_type(dataset.id.get()), H5Tclose);
  if (!dataset.type.ok()) refuse_dataset(path, "has an unreadable type" + hdf5_reason());
  if (const std::string defect = type_defect(dataset.type.get(), values); !defect.empty()) refuse_dataset(path, defect);

  const Handle space(H5Dget_space(dataset.id.get()), H5Sclose);
  const int rank = space.ok() ? H5Sget_simple_extent_ndims(space.get()) : -1;
  if (rank < 0) refuse_dataset(path, "has an unreadable shape" + hdf5_reason());
  if (rank != 1) refuse_dataset(path, "has " + std::to_string(rank) + " dimensions, expected 1");
  hsize_t extent = 0;
  H5Sget_simple_extent_dims(space.get(), &extent, nullptr);
  if (length && extent != *length) {
    refuse_dataset(path, "has " + std::to_string(extent) + " elements, expected " + std::to_string(*length));
  }
  dataset.count = static_cast<std::size_t>(extent);
  const Claim claim{dataset.id.get(), dataset.type.get(), dataset.count};
  if (const std::string defect = storage_defect(claim, file_bytes_); !defect.empty()) refuse_dataset(path, defect);
  return dataset;
}

void InputFile::read(const std::string& path, const Dataset& dataset, hid_t memory_type, void* out) const {
  if (dataset.count == 0) return;
  if (H5Dread(dataset.id.get(), memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, out) < 0) {
    refuse_dataset(path, "cannot be read" + hdf5_reason());
  }
}

std::vector<double> InputFile::reals(const std::string& path, std::optional<std::size_t> length) const {
  const Dataset dataset = open(path, Values::real, length);
  std::vector<double> values(dataset.count);
  read(path, dataset, H5T_NATIVE_DOUBLE, values.data());
  return values;
}

bool InputFile::is_single(const std::string& path) const {
  return H5Tget_size(open(path, Values::real, {}).type.get()) == sizeof(float);
}

bool InputFile::is_unsigned_64(const Dataset& dataset) const {
  return H5Tget_sign(dataset.type.get()) == H5T_SGN_NONE && H5Tget_size(dataset.type.get()) == sizeof(std::int64_t);
}

std::vector<std::int64_t> InputFile::wide_integers(const std::string& path, std::optional<std::size_t> length) const {
  const Dataset dataset = open(path, Values::integer, length);
  std::vector<std::int64_t> values(dataset.count);
  // HDF5 would clip numbers that do not fit; unsigned 64-bit numbers are read as such, and a set top bit refused.
  const bool huge = is_unsigned_64(dataset);
  read(path, dataset, huge ? H5T_NATIVE_UINT64 : H5T_NATIVE_INT64, values.data());
  if (huge) {
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (values[i] < 0) {
        refuse_dataset(path, "holds " + std::to_string(static_cast<std::uint64_t>(values[i])) + " at position " +
                                 std::to_string(i) + ", which does not fit 63 bits");
      }
    }
  }
  return values;
}

std::vector<std::uint64_t> InputFile::bits(const std::string& path, std::optional<std::size_t> length) const {
  const Dataset dataset = open(path, Values::integer, length);
  std::vector<std::uint64_t> values(dataset.count);
  if (is_unsigned_64(dataset)) {
    read(path, dataset, H5T_NATIVE_UINT64, values.data());
    return values;
  }
  // Read as signed: to unsigned, HDF5 would clip a negative number to 0.
  std::vector<std::int64_t> wide(dataset.count);
  read(path, dataset, H5T_NATIVE_INT64, wide.data());
  for (std::size_t i = 0; i < wide.size(); ++i) {
    if (wide[i] < 0) {
      refuse_dataset(path, "holds " + std::to_string(wide[i]) + " at position " + std::to_string(i) +
                               ", expected a number that is not negative");
    }
    values[i] = static_cast<std::uint64_t>(wide[i]);
  }
  return values;
}

std::int64_t InputFile::integer(const std::string& path) const {
  return wide_integers(path, 1).front();
}

std::vector<std::string> InputFile::strings(const std::string& path, std::optional<std::size_t> length) const {
  const Dataset dataset = open(path, Values::text, length);
  std::vector<std::string> values;
  values.reserve(dataset.count);
  const std::size_t width = H5Tget_size(dataset.type.get());
  if (H5Tis_variable_str(dataset.type.get()) > 0) {
    const RawReferences raw;
    TextHeap heap = text_heap();
    std::vector<char> references(dataset.count * kTextReference);
    read(path, dataset, raw.type(), references.data());
    for (std::size_t i = 0; i < dataset.count; ++i) {
      auto text =
          heap.text(std::span<const char, kTextReference>(references.data() + i * kTextReference, kTextReference));
      if (!text) refuse_dataset(path, "has a damaged string at position " + std::to_string(i));
      values.push_back(std::move(*text));
    }
  } else {
    std::vector<char> text(dataset.count * width);
    read(path, dataset, dataset.type.get(), text.data());
    for (std::size_t i = 0; i < dataset.count; ++i) values.push_back(fixed_text(text.data() + i * width, width));
  }
  return values;
}

std::optional<std::string> InputFile::text_attribute(const std::string& name) const {
  const htri_t exists = H5Aexists(file_.get(), name.c_str());
  if (exists < 0) refuse("attribute '" + name + "' cannot be looked up" + hdf5_reason());
  if (exists == 0) return std::nullopt;
  const Handle attribute(H5Aopen(file_.get(), name.c_str(), H5P_DEFAULT), H5Aclose);
  const Handle type(attribute.ok() ? H5Aget_type(attribute.get()) : -1, H5Tclose);
  const Handle space(attribute.ok() ? H5Aget_space(attribute.get()) : -1, H5Sclose);
  if (!type.ok() || !space.ok() || H5Tget_class(type.get()) != H5T_STRING ||
      H5Sget_simple_extent_npoints(space.get()) != 1) {
    refuse("attribute '" + name + "' is not one string" + hdf5_reason());
  }
  if (H5Tis_variable_str(type.get()) > 0) {
    const RawReferences raw;
    char reference[kTextReference] = {};
    if (H5Aread(attribute.get(), raw.type(), reference) < 0) {
      refuse("attribute '" + name + "' cannot be read" + hdf5_reason());
    }
    auto text = text_heap().text(reference);
    if (!text) refuse("attribute '" + name + "' is a damaged string");
    return text;
  }
  const std::size_t width = H5Tget_size(type.get());
  if (width > kMaxTextBytes) refuse("attribute '" + name + "' is longer than 1 MiB");
  std::vector<char> text(width);
  if (H5Aread(attribute.get(), type.get(), text.data()) < 0) {
    refuse("attribute '" + name + "' cannot be read" + hdf5_reason());
  }
  return fixed_text(text.data(), width);
}

std::optional<std::int64_t> InputFile::integer_attribute(const std::string& name) const {
  const htri_t exists = H5Aexists(file_.get(), name.c_str());
  if (exists < 0) refuse("attribute '" + name + "' cannot be looked up" + hdf5_reason());
  if (exists == 0) return std::nullopt;
  const Handle attribute(H5Aopen(file_.get(), name.c_str(), H5P_DEFAULT), H5Aclose);
  const Handle type(attribute.ok() ? H5Aget_type(attribute.get()) : -1, H5Tclose);
  const Handle space(attribute.ok() ? H5Aget_space(attribute.get()) : -1, H5Sclose);
  std::int64_t value = 0;
  if (!type.ok() || !space.ok() || H5Tget_class(type.get()) != H5T_INTEGER || !is_standard(type.get(), H5T_INTEGER) ||
      H5Sget_simple_extent_npoints(space.get()) != 1 || H5Aread(attribute.get(), H5T_NATIVE_INT64, &value) < 0) {
    refuse("attribute '" + name + "' is not one integer" + hdf5_reason());
  }
  return value;
}

}  // namespace stiction::io
