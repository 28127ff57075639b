#include "c_api/errors.hpp"
#include "stiction/error.hpp"

namespace {

/// Error of every file function in a library built without files.
stiction_code no_files() {
  return stiction::c::guarded([] {
    throw stiction::Error(
        stiction::ErrorCode::unsupported,
        "this library was built without files: build it where CMake finds HDF5 (Debian: libhdf5-dev)");
  });
}

}  // namespace

stiction_code stiction_batch_read(const char*, stiction_batch**) {
  return no_files();
}
stiction_code stiction_batch_destroy(stiction_batch* batch) {
  return batch == nullptr ? STICTION_OK : no_files();
}
stiction_code stiction_batch_get_view(stiction_batch*, int32_t, stiction_batch_view*) {
  return no_files();
}
stiction_code stiction_batch_get_cone_ids(stiction_batch*, const uint64_t**) {
  return no_files();
}
stiction_code stiction_batch_write(const char*, const stiction_batch_view*, const char*) {
  return no_files();
}
stiction_code stiction_solution_write(const char*, const stiction_batch_view*, const stiction_solution*,
                                      const stiction_solver_options*, const char*) {
  return no_files();
}
