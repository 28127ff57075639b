#pragma once

#include <memory>
#include <mutex>

#include "core/machine/contact_machine.hpp"
#include "cuda/machine/engine.hpp"
#include "cuda/machine/staging.hpp"

namespace stiction::cuda {

/// The machine on a device, whichever implementation of DeviceApi that is. Solves may be asked for from several
/// threads; they are queued one after the other.
class DeviceContactMachine final : public ContactMachine {
 public:
  explicit DeviceContactMachine(std::shared_ptr<DeviceApi> api, Offset piece_bytes = kPieceBytes,
                                const ClassRules& rules = {});

  void solve(const SolveRequest<float>& request) override;
  void solve(const SolveRequest<double>& request) override;
  void reserve(const Capacity& capacity, SolverKind solver) override;
  void islands(const BatchStructure& batch, Index* island, Index* count, StreamRef stream) override;
  void synchronize(StreamRef stream) override;
  void* allocate(std::size_t bytes) override { return api_->allocate(bytes); }
  void release(void* memory) noexcept override { api_->release(memory); }
  void copy_to_host(void* target, const void* source, std::size_t bytes, StreamRef stream) override;

  [[nodiscard]] DeviceApi& api() noexcept { return *api_; }
  [[nodiscard]] const Engine& engine() const noexcept { return engine_; }

 private:
  template <class Real>
  void run(const SolveRequest<Real>& request);
  template <class Real>
  void run_on_device(const SolveRequest<Real>& request);

  std::shared_ptr<DeviceApi> api_;
  Engine engine_;
  Staging staging_;
  std::weak_ptr<const PlanData> planned_;  ///< whose integers the engine holds; expired: no plan's
  std::mutex mutex_;
};

}  // namespace stiction::cuda
