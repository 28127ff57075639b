#include "distributed/program/shared_file.hpp"
#include "stiction/error.hpp"

namespace stiction::distributed {

bool has_shared_files() {
  return false;
}

std::unique_ptr<SharedFile> make_shared_file(Transport&, const std::filesystem::path&, std::uint64_t) {
  throw Error(ErrorCode::unsupported,
              "--checkpoint-files one: this program was built without parallel HDF5; install libhdf5-openmpi-dev and "
              "build it again, or choose parts");
}

}  // namespace stiction::distributed
