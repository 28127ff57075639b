#include "cuda/native/cuda_check.hpp"

#include <cstring>
#include <string>

#include "stiction/error.hpp"

namespace stiction::cuda {

void fail(cudaError_t error, const char* call, const char* file, int line) {
  cudaGetLastError();
  const char* slash = std::strrchr(file, '/');
  const std::string where = std::string(slash == nullptr ? file : slash + 1) + ":" + std::to_string(line);
  const std::string what = std::string(cudaGetErrorName(error)) + " (" + cudaGetErrorString(error) + ") from " + call +
                           " at cuda/native/" + where;
  if (error == cudaErrorMemoryAllocation)
    throw Error(ErrorCode::out_of_memory, what +
                                              ": the device has too little free memory; solve fewer environments at a "
                                              "time, or in f32");
  throw Error(ErrorCode::device_failure, what + ": results of this call are not valid");
}

}  // namespace stiction::cuda
