#pragma once

#include <memory>
#include <span>

#include "core/job/warm_start_job.hpp"

namespace stiction {

/// A store's memory on one machine and its operations; everything was checked before.
template <class Real>
class WarmStartMachine {
 public:
  virtual ~WarmStartMachine() = default;
  /// The jobs come without memory: the machine fills in its own.
  virtual void load(const WarmStartLoadJob<Real>& job, StreamRef stream) = 0;
  virtual void store(const WarmStartStoreJob<Real>& job, StreamRef stream) = 0;
  virtual void reset(std::span<const Offset> envs, StreamRef stream) = 0;
  /// mask null: every environment.
  virtual void reset_where(const std::uint8_t* mask, StreamRef stream) = 0;
  virtual void records(std::span<WarmStartRecord> out, StreamRef stream) = 0;
};

template <class Real>
std::unique_ptr<WarmStartMachine<Real>> make_cpu_warm_start_machine(const WarmStartCapacity& capacity, int threads);
/// \throws Error(no_device) with the reason, Error(unsupported) in a build without CUDA.
template <class Real>
std::unique_ptr<WarmStartMachine<Real>> make_cuda_warm_start_machine(int ordinal, const WarmStartCapacity& capacity);
template <class Real>
std::unique_ptr<WarmStartMachine<Real>> make_emulated_warm_start_machine(const WarmStartCapacity& capacity);

}  // namespace stiction
