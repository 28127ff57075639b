#pragma once

#include <memory>

#include "core/machine/world_machine.hpp"
#include "cuda/api/kernel_catalogue.hpp"
#include "cuda/api/memory.hpp"

namespace stiction::cuda {

/// A world in device memory. A step brings the plan's input to the host, the contacts of each environment as numbers
/// of bodies. Everything else stays on the device until it is asked for.
template <class Real>
class DeviceWorldMachine final : public WorldMachine<Real> {
 public:
  DeviceWorldMachine(std::shared_ptr<DeviceApi> api, const WorldModelView<Real>& model, Offset env_count,
                     const WorldOptions& options);
  ~DeviceWorldMachine() override;

  WorldSolve<Real> find_contacts() override;
  void await_solve() override;
  void integrate() override;
  WorldArrays<Real>& observe(WorldPart part) override;
  void restart(std::span<const std::uint8_t> mask) override;
  void resume(const WorldCheckpoint<Real>& from) override;
  std::span<Real> wrench() override;
  void motion(std::span<WorldMotion> out) override;

 private:
  /// Contacts of a step on the device.
  struct Contacts {
    WorldContacts<Real> view{};
    DeviceMemory memory;
    Offset room = 0;  ///< contacts that fit
  };

  void place_bodies();
  void place_state();
  void scan_offsets();
  void make_workspaces(Offset near);
  void launch_find();
  bool lacked_near_pairs();
  void count_contacts();
  void make_room(Contacts& contacts, Offset count);
  void fetch_structure();
  void fetch_contacts();
  void launch(const KernelRef& kernel, Offset teams, int lanes, const void* arguments);

  std::shared_ptr<DeviceApi> api_;
  const WorldKernels& kernels_;
  Stream stream_;
  Offset env_count_;
  Real keep_;
  bool limited_;         ///< planning reads depths, too
  bool pushed_ = false;  ///< wrenches may be written
  WorldArrays<Real> host_;
  bool state_here_ = true, status_here_ = true, contacts_here_ = true;  ///< parts of host_ that are of the last step
  WorldJob<Real> job_{};
  Real* inv_mass_ = nullptr;
  Offset* body_offsets_ = nullptr;
  WorldMotion* motion_ = nullptr;
  DeviceMemory bodies_;     ///< arrays of one element per environment, and the model
  DeviceMemory workspace_;  ///< scratch of all teams that find contacts
  Offset workspace_bytes_ = 0;
  Offset near_room_ = 0;    ///< near pairs of an environment that a workspace has room for
  Offset* near_ = nullptr;  ///< near pairs of each environment
  Offset teams_ = 0;
  Index* count_ = nullptr;
  std::vector<Index> counts_;        ///< copy of count_
  std::vector<Offset> near_counts_;  ///< copy of near_, a member since copies may be queued when a step fails
  Index most_ = 0;                   ///< contacts of an environment that found_ has room for
  DeviceMemory found_;
  Contacts now_, next_;
};

}  // namespace stiction::cuda
