#include "cuda/cuda_memory.hpp"

#include <cstdint>

#include "cuda/cuda_check.hpp"

namespace stiction::cuda {

MemoryPool::MemoryPool(int ordinal) {
  int supported = 0;
  STICTION_CUDA_TRY(cudaDeviceGetAttribute(&supported, cudaDevAttrMemoryPoolsSupported, ordinal));
  if (supported == 0) return;
  cudaMemPoolProps properties{};
  properties.allocType = cudaMemAllocationTypePinned;
  properties.location.type = cudaMemLocationTypeDevice;
  properties.location.id = ordinal;
  STICTION_CUDA_TRY(cudaMemPoolCreate(&pool_, &properties));
  // Otherwise every synchronisation returns the memory to the driver, and every solve asks for it again.
  std::uint64_t keep_all = UINT64_MAX;
  STICTION_CUDA_TRY(cudaMemPoolSetAttribute(pool_, cudaMemPoolAttrReleaseThreshold, &keep_all));
}

MemoryPool::~MemoryPool() {
  if (pool_ != nullptr) cudaMemPoolDestroy(pool_);
}

void* MemoryPool::allocate(std::size_t bytes, cudaStream_t stream) {
  void* memory = nullptr;
  if (pool_ != nullptr) {
    STICTION_CUDA_TRY(cudaMallocFromPoolAsync(&memory, bytes, pool_, stream));
  } else {
    STICTION_CUDA_TRY(cudaMalloc(&memory, bytes));
  }
  return memory;
}

void MemoryPool::free(void* memory, cudaStream_t stream) noexcept {
  if (pool_ != nullptr) {
    cudaFreeAsync(memory, stream);
  } else {
    cudaFree(memory);
  }
}

}  // namespace stiction::cuda
