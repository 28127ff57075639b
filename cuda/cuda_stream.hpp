#pragma once

#include <cuda_runtime_api.h>

#include <utility>

#include "cuda/cuda_check.hpp"

namespace stiction::cuda {

/// Owner of a stream that does not wait for the legacy default stream.
class Stream {
 public:
  Stream() { STICTION_CUDA_TRY(cudaStreamCreateWithFlags(&handle_, cudaStreamNonBlocking)); }
  ~Stream() { cudaStreamDestroy(handle_); }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;
  [[nodiscard]] cudaStream_t get() const noexcept { return handle_; }

 private:
  cudaStream_t handle_ = nullptr;
};

/// Owner of an event: a point on one stream that others can wait for.
class Event {
 public:
  Event() { STICTION_CUDA_TRY(cudaEventCreateWithFlags(&handle_, cudaEventDisableTiming)); }
  ~Event() {
    if (handle_ != nullptr) cudaEventDestroy(handle_);
  }
  Event(Event&& other) noexcept : handle_(std::exchange(other.handle_, nullptr)) {}
  Event& operator=(Event&& other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }
  void record(cudaStream_t stream) { STICTION_CUDA_TRY(cudaEventRecord(handle_, stream)); }
  /// What `stream` does from now on waits for what was recorded.
  void hold(cudaStream_t stream) const { STICTION_CUDA_TRY(cudaStreamWaitEvent(stream, handle_, 0)); }

 private:
  cudaEvent_t handle_ = nullptr;
};

}  // namespace stiction::cuda
