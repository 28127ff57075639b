#include "core/io/guard/dataset_check.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "core/io/guard/inflated_size.hpp"
#include "core/io/guard/text_heap.hpp"

/// Compares the claims of a dataset with the bytes stored for it, before anything of it is read.
namespace stiction::io {
namespace {

/// No deflate stream expands more (zlib's documented limit of 1032:1). No honest dataset hence claims more than this
/// many bytes for each byte that is stored for it.
constexpr std::uint64_t kDeflateLimit = 1032;

const char* class_name(H5T_class_t type_class) {
  switch (type_class) {
    case H5T_INTEGER:
      return "integers";
    case H5T_FLOAT:
      return "floating-point numbers";
    case H5T_STRING:
      return "strings";
    case H5T_ENUM:
      return "enumerators";
    default:
      return "an unusual type";
  }
}

/// Bytes that a chunk unpacks to, the filters that `skipped` leaves out of account; nothing if it is damaged.
/// HDF5 1.10.8 assumes that their number is that of its elements.
std::optional<std::uint64_t> unpacked_size(const std::vector<H5Z_filter_t>& filters, std::uint32_t skipped,
                                           std::span<const char> stored, std::uint64_t limit) {
  constexpr std::uint64_t kChecksum = 4;
  std::uint64_t size = stored.size();
  bool packed = true;  // not inflated yet
  for (auto i = static_cast<std::ptrdiff_t>(filters.size()); i-- > 0;) {
    const H5Z_filter_t filter = filters[static_cast<std::size_t>(i)];
    if ((skipped >> i & 1) != 0) continue;
    if (filter == H5Z_FILTER_FLETCHER32) {
      if (size < kChecksum) return std::nullopt;
      size -= kChecksum;
    } else if (filter == H5Z_FILTER_DEFLATE) {
      const auto inflated = packed ? inflated_size(stored.first(size), limit + kChecksum) : std::nullopt;
      if (!inflated) return std::nullopt;
      size = *inflated;
      packed = false;
    } else if (packed && std::find(filters.begin(), filters.begin() + i, H5Z_FILTER_DEFLATE) != filters.begin() + i) {
      return std::nullopt;  // shuffled after it was packed, as no writer does
    }
  }
  return size;
}

/// Returns true if a chunk has `wanted` bytes when its filters are undone.
bool holds_chunk(hid_t dataset, hsize_t begin, const std::vector<H5Z_filter_t>& filters, std::size_t stored,
                 std::uint64_t wanted) {
  if (filters.empty()) return stored == wanted;
  std::vector<char> content(stored);
  std::uint32_t skipped = 0;
  return H5Dread_chunk(dataset, H5P_DEFAULT, &begin, &skipped, content.data()) >= 0 &&
         unpacked_size(filters, skipped, content, wanted) == wanted;
}

/// Names the defect in the chunks of a dataset of so many bytes, or nothing.
std::string chunk_defect(const Claim& claim, hid_t properties, std::size_t bytes, std::uint64_t file_bytes) {
  const int filters = H5Pget_nfilters(properties);
  bool deflated = false;
  std::vector<H5Z_filter_t> pipeline;
  for (int i = 0; i < filters; ++i) {
    unsigned flags = 0, config = 0;
    std::size_t value_count = 0;
    const H5Z_filter_t filter =
        H5Pget_filter2(properties, static_cast<unsigned>(i), &flags, &value_count, nullptr, 0, nullptr, &config);
    if (filter != H5Z_FILTER_DEFLATE && filter != H5Z_FILTER_SHUFFLE && filter != H5Z_FILTER_FLETCHER32) {
      return "is packed with filter " + std::to_string(filter) + ", only deflate, shuffle and fletcher32 are read";
    }
    deflated = deflated || filter == H5Z_FILTER_DEFLATE;
    pipeline.push_back(filter);
  }
  const std::uint64_t limit = deflated ? kDeflateLimit : 1;
  if (bytes / limit > file_bytes) {
    return "claims " + std::to_string(claim.count) + " elements (" + std::to_string(bytes) +
           " bytes), more than a file of " + std::to_string(file_bytes) + " bytes holds";
  }
  hsize_t chunk = 0;
  if (H5Pget_chunk(properties, 1, &chunk) != 1 || chunk == 0) return "has an unreadable chunk size";
  if (chunk > claim.count && chunk * (bytes / claim.count) / limit > file_bytes) {
    return "claims chunks of " + std::to_string(chunk) + " elements, more than the file holds";
  }
  const std::uint64_t chunk_bytes = chunk * (bytes / claim.count);
  std::uint64_t left = file_bytes;  // honest chunks do not overlap
  // HDF5 gives the size that chunks without filters should have, and their own size only by a search of all.
  constexpr std::uint64_t kMostUnpacked = 1 << 14;
  if (pipeline.empty() && (claim.count - 1) / chunk >= kMostUnpacked) {
    return "has more than " + std::to_string(kMostUnpacked) + " chunks that are not packed";
  }
  for (hsize_t begin = 0; begin < claim.count; begin += chunk) {
    hsize_t stored = 0;
    haddr_t address = HADDR_UNDEF;
    unsigned mask = 0;
    const herr_t found = pipeline.empty() ? H5Dget_chunk_info_by_coord(claim.dataset, &begin, &mask, &address, &stored)
                                          : H5Dget_chunk_storage_size(claim.dataset, &begin, &stored);
    if (found < 0 || stored == 0) return "lacks the chunk that begins at element " + std::to_string(begin);
    if (stored > left) {
      return "has a chunk of " + std::to_string(stored) + " bytes in a file of " + std::to_string(file_bytes);
    }
    left -= stored;
    if (!holds_chunk(claim.dataset, begin, pipeline, static_cast<std::size_t>(stored), chunk_bytes)) {
      return "has a damaged chunk that begins at element " + std::to_string(begin);
    }
  }
  return "";
}

}  // namespace

bool is_standard(hid_t type, H5T_class_t type_class) {
  const auto any_of = [type](const auto& known) {
    return std::any_of(known.begin(), known.end(), [type](hid_t one) { return H5Tequal(type, one) > 0; });
  };
  if (type_class == H5T_FLOAT) {
    return any_of(std::array{H5T_IEEE_F32LE, H5T_IEEE_F32BE, H5T_IEEE_F64LE, H5T_IEEE_F64BE});
  }
  return any_of(std::array{H5T_STD_I8LE, H5T_STD_I8BE, H5T_STD_U8LE, H5T_STD_U8BE, H5T_STD_I16LE, H5T_STD_I16BE,
                           H5T_STD_U16LE, H5T_STD_U16BE, H5T_STD_I32LE, H5T_STD_I32BE, H5T_STD_U32LE, H5T_STD_U32BE,
                           H5T_STD_I64LE, H5T_STD_I64BE, H5T_STD_U64LE, H5T_STD_U64BE});
}

std::string type_defect(hid_t type, Values values) {
  const H5T_class_t found = H5Tget_class(type);
  const H5T_class_t wanted = values == Values::real ? H5T_FLOAT : values == Values::integer ? H5T_INTEGER : H5T_STRING;
  if (found != wanted) return std::string("holds ") + class_name(found) + ", expected " + class_name(wanted);
  if (wanted == H5T_STRING) {
    if (H5Tis_variable_str(type) <= 0 && H5Tget_size(type) > kMaxTextBytes) return "holds strings of more than 1 MiB";
  } else if (!is_standard(type, wanted)) {
    return std::string("holds ") + class_name(found) + " of no standard layout (" + std::to_string(H5Tget_size(type)) +
           " bytes)";
  }
  return "";
}

std::string storage_defect(const Claim& claim, std::uint64_t file_bytes) {
  if (claim.count == 0) return "";
  // For a string of variable length the array holds a reference; in memory that would be a pointer.
  const bool reference = H5Tis_variable_str(claim.type) > 0;
  const std::size_t width = reference ? kTextReference : H5Tget_size(claim.type);
  if (width == 0 || claim.count > std::numeric_limits<std::size_t>::max() / kDeflateLimit / width) {
    return "claims " + std::to_string(claim.count) + " elements, more than any file holds";
  }
  const std::size_t bytes = claim.count * width;
  const Handle properties(H5Dget_create_plist(claim.dataset), H5Pclose);
  if (!properties.ok()) return "has an unreadable layout" + hdf5_reason();
  if (H5Pget_external_count(properties.get()) > 0) return "keeps its data in another file";
  switch (H5Pget_layout(properties.get())) {
    case H5D_CHUNKED:
      return chunk_defect(claim, properties.get(), bytes, file_bytes);
    case H5D_COMPACT:
    case H5D_CONTIGUOUS:
      break;
    default:
      return "has neither a compact, contiguous nor chunked layout";
  }
  const std::uint64_t stored = H5Dget_storage_size(claim.dataset);
  if (stored < bytes || bytes > file_bytes) {
    return "claims " + std::to_string(claim.count) + " elements (" + std::to_string(bytes) + " bytes), the file of " +
           std::to_string(file_bytes) + " bytes stores " + std::to_string(stored) + " for it";
  }
  return "";
}

}  // namespace stiction::io
