#pragma once

#include <cuda_runtime_api.h>

namespace stiction::cuda {

/// Throws Error(out_of_memory) or Error(device_failure) that says which call failed, where and why, after clearing the
/// error that CUDA keeps for the next caller.
[[noreturn]] void fail(cudaError_t error, const char* call, const char* file, int line);

inline void check(cudaError_t error, const char* call, const char* file, int line) {
  if (error != cudaSuccess) fail(error, call, file, line);
}

}  // namespace stiction::cuda

/// Every call into CUDA whose failure the caller must learn of.
#define STICTION_CUDA_TRY(call) ::stiction::cuda::check((call), #call, __FILE__, __LINE__)
