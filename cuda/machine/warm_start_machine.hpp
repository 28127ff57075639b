#pragma once

#include <memory>

#include "core/machine/warm_start_machine.hpp"
#include "cuda/api/device_api.hpp"
#include "cuda/api/memory.hpp"

namespace stiction::cuda {

/// A store's memory on a device. Its calls queue one launch each and wait for nothing, so they may be captured. Only
/// records() waits, and reset() of a list, for the list before it.
template <class Real>
class DeviceWarmStartMachine final : public WarmStartMachine<Real> {
 public:
  /// `eager`: every call is complete on return, for a device that does nothing before it is waited for.
  DeviceWarmStartMachine(std::shared_ptr<DeviceApi> api, const WarmStartCapacity& capacity, bool eager);
  /// Waits for the last list of reset(), which may still be on its way.
  ~DeviceWarmStartMachine() override;
  DeviceWarmStartMachine(const DeviceWarmStartMachine&) = delete;
  DeviceWarmStartMachine& operator=(const DeviceWarmStartMachine&) = delete;

  void load(const WarmStartLoadJob<Real>& request, StreamRef stream) override;
  void store(const WarmStartStoreJob<Real>& request, StreamRef stream) override;
  void reset(std::span<const Offset> envs, StreamRef stream) override;
  void reset_where(const std::uint8_t* mask, StreamRef stream) override;
  void records(std::span<WarmStartRecord> out, StreamRef stream) override;

 private:
  template <class Job>
  void queue(const KernelRef& kernel, Offset teams, int lanes, const Job& job, StreamRef stream);

  std::shared_ptr<DeviceApi> api_;
  bool eager_;
  int lanes_;
  WarmStartMemory<Real> view_;
  std::uint8_t* mask_ = nullptr;  ///< a list of environments, as a mask  (env_capacity)
  ArraySet arrays_;
  DeviceMemory memory_;
  PinnedMemory mask_host_;
  Event mask_copied_;
};

}  // namespace stiction::cuda
