#pragma once

#include <array>
#include <memory>
#include <vector>

#include "core/job/row_numbers.hpp"
#include "cuda/api/memory.hpp"
#include "stiction/hash.hpp"
#include "stiction/jacobian.hpp"

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
template <class Real>
ContactBatchView<Real> on_device(Arrays& arrays, const ContactBatchView<Real>& host) {
  ContactBatchView<Real> view = host;
  view.env_row_offsets = arrays.put(host.env_row_offsets, host.env_count + 1);
  view.env_cone_offsets = arrays.put(host.env_cone_offsets, host.env_count + 1);
  view.cone_kind = arrays.put(host.cone_kind, host.cone_count);
  view.cone_row_offsets = arrays.put(host.cone_row_offsets, host.cone_count + 1);
  view.cone_group = arrays.put(host.cone_group, host.cone_count);
  view.row_offsets = arrays.put(host.row_offsets, host.row_count + 1);
  view.column = arrays.put(host.column, host.nonzero_count);
  view.A = arrays.put(host.A, host.nonzero_count);
  view.factor_offsets = arrays.put(host.factor_offsets, host.env_count + 1);
  view.factor = arrays.put(host.factor, host.factor_count);
  for (const auto member : kRowNumbers<Real>) view.*member = arrays.put(host.*member, host.row_count);
  view.space = MemorySpace::cuda;
  return view;
}

template <class Real>
JacobianBatchView<Real> on_device(Arrays& arrays, const JacobianBatchView<Real>& host) {
  JacobianBatchView<Real> view = host;
  view.env_row_offsets = arrays.put(host.env_row_offsets, host.env_count + 1);
  view.env_cone_offsets = arrays.put(host.env_cone_offsets, host.env_count + 1);
  view.env_dof_offsets = arrays.put(host.env_dof_offsets, host.env_count + 1);
  view.env_mass_offsets = arrays.put(host.env_mass_offsets, host.env_count + 1);
  view.cone_kind = arrays.put(host.cone_kind, host.cone_count);
  view.cone_row_offsets = arrays.put(host.cone_row_offsets, host.cone_count + 1);
  view.cone_group = arrays.put(host.cone_group, host.cone_count);
  view.row_offsets = arrays.put(host.row_offsets, host.row_count + 1);
  view.column = arrays.put(host.column, host.entry_count);
  view.J = arrays.put(host.J, host.entry_count);
  view.M = arrays.put(host.M, host.mass_count);
  view.v_free = arrays.put(host.v_free, host.dof_count);
  for (const auto member : std::array<const Real * JacobianBatchView<Real>::*, 5>{
           &JacobianBatchView<Real>::target, &JacobianBatchView<Real>::R, &JacobianBatchView<Real>::mu,
           &JacobianBatchView<Real>::lo, &JacobianBatchView<Real>::hi})
    view.*member = arrays.put(host.*member, host.row_count);
  view.space = MemorySpace::cuda;
  return view;
}

/// Where an answer to a contact batch is written.
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
