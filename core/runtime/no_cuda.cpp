#include "core/runtime/backend.hpp"
#include "stiction/error.hpp"

namespace stiction {

namespace {
constexpr const char* kNotBuilt =
    "this build has no CUDA machine: configure with nvcc on the PATH (scripts/get_cuda.sh fetches one) and "
    "-DSTICTION_ENABLE_CUDA=ON";
}

std::unique_ptr<Backend> make_cuda_backend(int) {
  throw Error(ErrorCode::unsupported, kNotBuilt);
}

std::vector<DeviceReport> cuda_reports() {
  return {{Device::cuda(0), false, "cuda", kNotBuilt}};
}

}  // namespace stiction
