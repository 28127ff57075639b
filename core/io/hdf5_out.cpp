#include "core/io/hdf5_out.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <utility>

#include "stiction/error.hpp"

namespace stiction::io {
namespace {

/// Arrays from this many elements on are packed (shuffle, deflate): below, the chunk index outweighs the gain.
constexpr std::size_t kPackedFrom = 1024;
constexpr std::size_t kChunk = std::size_t{1} << 16;
constexpr unsigned kDeflateLevel = 4;

std::filesystem::path beside(const std::filesystem::path& path) {
  static std::atomic<unsigned> serial{0};
  std::filesystem::path temporary = path;
  temporary += "." + std::to_string(getpid()) + "." + std::to_string(serial++) + ".part";
  return temporary;
}

/// Returns the type that h5py reads as str.
Handle variable_text() {
  Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type.get(), H5T_VARIABLE);
  H5Tset_cset(type.get(), H5T_CSET_UTF8);
  return type;
}

/// Forces a file or a folder to the disk.
void force_to_disk(const std::filesystem::path& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  const bool forced = file >= 0 && fsync(file) == 0;
  const int reason = errno;
  if (file >= 0) close(file);
  if (!forced) throw Error(ErrorCode::io, path.string() + ": cannot be forced to the disk: " + std::strerror(reason));
}

void rename_to(const std::filesystem::path& written, const std::filesystem::path& path) {
  std::error_code trouble;
  std::filesystem::rename(written, path, trouble);
  if (trouble) throw Error(ErrorCode::io, path.string() + ": cannot be put in place: " + trouble.message());
}

}  // namespace

OutputFile::OutputFile(std::filesystem::path path) : path_(std::move(path)), temporary_(beside(path_)) {
  const Handle create(H5Pcreate(H5P_FILE_CREATE), H5Pclose);
  H5Pset_obj_track_times(create.get(), false);
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  constexpr std::size_t kGrowth = std::size_t{1} << 20;
  H5Pset_fapl_core(access.get(), kGrowth, /*backing_store=*/false);
  file_ = Handle(H5Fcreate(temporary_.c_str(), H5F_ACC_EXCL, create.get(), access.get()), H5Fclose);
  if (!file_.ok()) fail("cannot be created");
  disk_ = open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (disk_ < 0) fail_on_disk("cannot be created: is the folder there and writable?");
}

OutputFile::~OutputFile() {
  file_.close();
  if (disk_ >= 0) close(disk_);
  std::error_code ignored;
  if (!committed_) std::filesystem::remove(temporary_, ignored);
}

void OutputFile::fail(const std::string& what) const {
  throw Error(ErrorCode::io, path_.string() + ": " + what + hdf5_reason());
}

void OutputFile::fail_on_disk(const std::string& what) const {
  const int reason = errno;
  throw Error(ErrorCode::io, path_.string() + ": " + what + ": " + std::strerror(reason));
}

void OutputFile::write_to_disk() {
  const ssize_t size = H5Fflush(file_.get(), H5F_SCOPE_GLOBAL) < 0 ? -1 : H5Fget_file_image(file_.get(), nullptr, 0);
  std::vector<std::byte> image(size < 0 ? 0 : static_cast<std::size_t>(size));
  if (image.empty() || H5Fget_file_image(file_.get(), image.data(), image.size()) != size) fail("cannot be completed");
  file_.close();
  for (std::span<const std::byte> rest(image); !rest.empty();) {
    const ssize_t written = ::write(disk_, rest.data(), rest.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail_on_disk("cannot be written");
    rest = rest.subspan(static_cast<std::size_t>(written));
  }
  if (close(std::exchange(disk_, -1)) != 0) fail_on_disk("cannot be written");
}

void OutputFile::group(const std::string& path) {
  const Handle create(H5Pcreate(H5P_GROUP_CREATE), H5Pclose);
  H5Pset_obj_track_times(create.get(), false);
  const Handle group(H5Gcreate2(file_.get(), path.c_str(), H5P_DEFAULT, create.get(), H5P_DEFAULT), H5Gclose);
  if (!group.ok()) fail("group '" + path + "' cannot be written");
}

void OutputFile::write(const std::string& path, hid_t file_type, hid_t memory_type, std::size_t width,
                       std::size_t count, const void* values) {
  const hsize_t extent = count;
  const Handle space(H5Screate_simple(1, &extent, nullptr), H5Sclose);
  const Handle create(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  H5Pset_obj_track_times(create.get(), false);
  if (width > 0 && count >= kPackedFrom && H5Zfilter_avail(H5Z_FILTER_DEFLATE) > 0) {
    const hsize_t chunk = count < kChunk ? count : kChunk;
    H5Pset_chunk(create.get(), 1, &chunk);
    H5Pset_shuffle(create.get());
    H5Pset_deflate(create.get(), kDeflateLevel);
  }
  const Handle dataset(
      H5Dcreate2(file_.get(), path.c_str(), file_type, space.get(), H5P_DEFAULT, create.get(), H5P_DEFAULT), H5Dclose);
  if (!dataset.ok() || (count > 0 && H5Dwrite(dataset.get(), memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) < 0)) {
    fail("dataset '" + path + "' cannot be written");
  }
}

void OutputFile::array(const std::string& path, std::span<const double> values) {
  write(path, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, sizeof(double), values.size(), values.data());
}

void OutputFile::array(const std::string& path, std::span<const float> values) {
  write(path, H5T_IEEE_F32LE, H5T_NATIVE_FLOAT, sizeof(float), values.size(), values.data());
}

void OutputFile::array(const std::string& path, std::span<const std::int64_t> values) {
  write(path, H5T_STD_I64LE, H5T_NATIVE_INT64, sizeof(std::int64_t), values.size(), values.data());
}

void OutputFile::array(const std::string& path, std::span<const std::int32_t> values) {
  write(path, H5T_STD_I32LE, H5T_NATIVE_INT32, sizeof(std::int32_t), values.size(), values.data());
}

void OutputFile::array(const std::string& path, std::span<const std::uint64_t> values) {
  write(path, H5T_STD_U64LE, H5T_NATIVE_UINT64, sizeof(std::uint64_t), values.size(), values.data());
}

void OutputFile::array(const std::string& path, std::span<const std::uint32_t> values) {
  write(path, H5T_STD_U32LE, H5T_NATIVE_UINT32, sizeof(std::uint32_t), values.size(), values.data());
}

void OutputFile::array(const std::string& path, std::span<const std::uint8_t> values) {
  write(path, H5T_STD_U8LE, H5T_NATIVE_UINT8, sizeof(std::uint8_t), values.size(), values.data());
}

void OutputFile::reals(const std::string& path, const std::vector<double>& values, Precision precision) {
  if (precision == Precision::f64) return array(path, std::span<const double>(values));
  std::vector<float> narrow;
  narrow.reserve(values.size());
  for (const double value : values) narrow.push_back(static_cast<float>(value));
  array(path, std::span<const float>(narrow));
}

void OutputFile::strings(const std::string& path, const std::vector<std::string>& values) {
  std::vector<const char*> texts;
  texts.reserve(values.size());
  for (const std::string& value : values) texts.push_back(value.c_str());
  const Handle type = variable_text();
  constexpr std::size_t kNeverPacked = 0;  // the texts lie in HDF5's heap, the array holds only where
  write(path, type.get(), type.get(), kNeverPacked, texts.size(), static_cast<const void*>(texts.data()));
}

void OutputFile::text(const std::string& path, const std::string& value) {
  const Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type.get(), value.size() + 1);
  H5Tset_cset(type.get(), H5T_CSET_UTF8);
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle create(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  H5Pset_obj_track_times(create.get(), false);
  const Handle dataset(
      H5Dcreate2(file_.get(), path.c_str(), type.get(), space.get(), H5P_DEFAULT, create.get(), H5P_DEFAULT), H5Dclose);
  if (!dataset.ok() || H5Dwrite(dataset.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, value.c_str()) < 0) {
    fail("dataset '" + path + "' cannot be written");
  }
}

void OutputFile::attribute(const std::string& name, const std::string& value) {
  const Handle type = variable_text();
  const char* text = value.c_str();
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle attribute(H5Acreate2(file_.get(), name.c_str(), type.get(), space.get(), H5P_DEFAULT, H5P_DEFAULT),
                         H5Aclose);
  if (!attribute.ok() || H5Awrite(attribute.get(), type.get(), static_cast<const void*>(&text)) < 0) {
    fail("attribute '" + name + "' cannot be written");
  }
}

void OutputFile::attribute(const std::string& name, std::int64_t value) {
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle attribute(H5Acreate2(file_.get(), name.c_str(), H5T_STD_I64LE, space.get(), H5P_DEFAULT, H5P_DEFAULT),
                         H5Aclose);
  if (!attribute.ok() || H5Awrite(attribute.get(), H5T_NATIVE_INT64, &value) < 0) {
    fail("attribute '" + name + "' cannot be written");
  }
}

void OutputFile::commit() {
  write_to_disk();
  put_in_place();
}

void OutputFile::commit_to_disk() {
  write_to_disk();
  put_on_disk(temporary_, path_);
  committed_ = true;
}

void OutputFile::put_in_place() {
  rename_to(temporary_, path_);
  committed_ = true;
}

void put_on_disk(const std::filesystem::path& written, const std::filesystem::path& path) {
  force_to_disk(written);
  rename_to(written, path);
  force_to_disk(path.has_parent_path() ? path.parent_path() : std::filesystem::path("."));
}

void require_length(const std::string& what, std::size_t found, std::size_t expected) {
  if (found == 0 || found == expected) return;
  throw Error(ErrorCode::invalid_argument,
              what + " has " + std::to_string(found) + " elements, expected " + std::to_string(expected) + " or none");
}

}  // namespace stiction::io
