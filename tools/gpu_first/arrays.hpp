#pragma once

#include <memory>
#include <vector>

#include "cuda/api/memory.hpp"
#include "stiction/batch_arrays.hpp"
#include "stiction/hash.hpp"

namespace stiction::gpu_first {

/// Arrays in a device's memory for as long as this lives. Every copy is done on return.
class Arrays {
 public:
  explicit Arrays(std::shared_ptr<cuda::DeviceApi> api) : api_(std::move(api)), stream_(*api_) {}

  template <class T>
  T* room(Offset count) {
    memory_.emplace_back(*api_, static_cast<std::size_t>(count + 1) * sizeof(T));
    return reinterpret_cast<T*>(memory_.back().get());
  }
  /// A copy; null stays null.
  template <class T>
  T* put(const T* host, Offset count) {
    if (host == nullptr) return nullptr;
    T* const there = room<T>(count);
    if (count == 0) return there;
    api_->copy(there, host, static_cast<std::size_t>(count) * sizeof(T), cuda::CopyKind::to_device, stream_.get());
    api_->synchronize(stream_.get());
    return there;
  }
  template <class T>
  T* put(const std::vector<T>& host) {
    return put(host.data(), static_cast<Offset>(host.size()));
  }
  template <class T>
  std::vector<T> fetch(const T* there, Offset count) {
    std::vector<T> host(static_cast<std::size_t>(count));
    if (host.empty()) return host;
    api_->copy(host.data(), there, host.size() * sizeof(T), cuda::CopyKind::to_host, stream_.get());
    api_->synchronize(stream_.get());
    return host;
  }

  [[nodiscard]] cuda::StreamHandle stream() const { return stream_.get(); }
  void synchronize() { api_->synchronize(stream_.get()); }

 private:
  std::shared_ptr<cuda::DeviceApi> api_;
  cuda::Stream stream_;
  std::vector<cuda::DeviceMemory> memory_;
};

template <class T>
std::uint64_t hash_of(const std::vector<T>& values) {
  return hash_bits(std::span<const T>(values));
}

/// The batch with every array on the device.
template <class Batch>
Batch on_device(Arrays& arrays, const Batch& host) {
  Batch view = host;
  for_each_array(host, [&](const BatchArray& what, auto*& array) { array = arrays.put(array, what.length); }, view);
  view.space = MemorySpace::cuda;
  return view;
}

/// Arrays that an answer to a contact batch is written to.
template <class Real>
SolutionView<Real> solution_room(Arrays& arrays, const ContactBatchView<Real>& batch) {
  return {arrays.room<Real>(batch.row_count), arrays.room<Real>(batch.row_count),
          arrays.room<EnvStatus>(batch.env_count)};
}
template <class Real>
Solution<Real> fetch(Arrays& arrays, const ContactBatchView<Real>& batch, const SolutionView<Real>& there) {
  return {arrays.fetch(there.lambda, batch.row_count), arrays.fetch(there.w, batch.row_count),
          arrays.fetch(there.status, batch.env_count)};
}

}  // namespace stiction::gpu_first
