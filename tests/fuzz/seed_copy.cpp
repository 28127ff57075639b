#include "tests/fuzz/seed_copy.hpp"

#include <hdf5.h>

#include <stdexcept>
#include <vector>

namespace stiction::fuzz {
namespace {

/// Bytes to read: a few more than any seed has.
constexpr std::size_t kRoom = std::size_t{1} << 16;

herr_t copy_object(hid_t from, const char* name, const H5L_info_t*, void* target) {
  const hid_t to = *static_cast<hid_t*>(target);
  const hid_t object = H5Oopen(from, name, H5P_DEFAULT);
  herr_t outcome = object < 0 ? -1 : 0;
  if (H5Iget_type(object) == H5I_GROUP) {
    outcome = H5Gclose(H5Gcreate2(to, name, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
  } else if (outcome == 0) {
    const hid_t type = H5Dget_type(object), space = H5Dget_space(object);
    const hid_t copy = H5Dcreate2(to, name, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    std::vector<char> values(kRoom);
    outcome = H5Dread(object, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
    if (outcome >= 0) outcome = H5Dwrite(copy, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
    if (H5Tis_variable_str(type) > 0) H5Dvlen_reclaim(type, space, H5P_DEFAULT, values.data());
    H5Dclose(copy);
    H5Sclose(space);
    H5Tclose(type);
  }
  H5Oclose(object);
  return outcome < 0 ? -1 : 0;
}

herr_t copy_attribute(hid_t from, const char* name, const H5A_info_t*, void* target) {
  const hid_t attribute = H5Aopen(from, name, H5P_DEFAULT);
  const hid_t type = H5Aget_type(attribute), space = H5Aget_space(attribute);
  const hid_t copy = H5Acreate2(*static_cast<hid_t*>(target), name, type, space, H5P_DEFAULT, H5P_DEFAULT);
  std::vector<char> values(kRoom);
  herr_t outcome = H5Aread(attribute, type, values.data());
  if (outcome >= 0) outcome = H5Awrite(copy, type, values.data());
  if (H5Tis_variable_str(type) > 0) H5Dvlen_reclaim(type, space, H5P_DEFAULT, values.data());
  H5Aclose(copy);
  H5Sclose(space);
  H5Tclose(type);
  H5Aclose(attribute);
  return outcome;
}

}  // namespace

void copy_to_latest(const std::filesystem::path& from, const std::filesystem::path& to) {
  const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
  H5Pset_libver_bounds(access, H5F_LIBVER_LATEST, H5F_LIBVER_LATEST);
  const hid_t source = H5Fopen(from.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  hid_t target = H5Fcreate(to.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access);
  const bool done = source >= 0 && target >= 0 &&
                    H5Lvisit(source, H5_INDEX_NAME, H5_ITER_INC, copy_object, &target) >= 0 &&
                    H5Aiterate2(source, H5_INDEX_NAME, H5_ITER_INC, nullptr, copy_attribute, &target) >= 0;
  H5Fclose(target);
  H5Fclose(source);
  H5Pclose(access);
  if (!done) throw std::runtime_error("cannot copy " + from.string());
}

}  // namespace stiction::fuzz
