#pragma once

#include <vector>

#include "core/job/world_job.hpp"

namespace stiction {

/// f(numbers per contact, the array of each), over the arrays that both WorldContacts and HostContacts name.
template <class F, class... Contacts>
void for_each_contact_array(F&& f, Contacts&... each) {
  f(Offset{1}, each.body_a...);
  f(Offset{1}, each.body_b...);
  f(Offset{3}, each.arm_a...);
  f(Offset{3}, each.arm_b...);
  f(Offset{3}, each.normal...);
  f(Offset{1}, each.mu...);
  f(Offset{1}, each.depth...);
  f(Offset{1}, each.restitution...);
  f(Offset{1}, each.id...);
  f(Offset{3}, each.guess...);
  f(Offset{3}, each.impulse...);
}

/// f(numbers per body, the array of each), over the arrays that both WorldJob and WorldArrays name.
template <class F, class... Bodies>
void for_each_body_array(F&& f, Bodies&... each) {
  f(Offset{3}, each.position...);
  f(Offset{4}, each.orientation...);
  f(Offset{6}, each.twist...);
  f(Offset{6}, each.wrench...);
  f(Offset{6}, each.inv_inertia...);
  f(Offset{6}, each.twist_change...);
  f(Offset{6}, each.solved_twist...);
}

/// Contacts of a step in host memory.
template <class Real>
struct HostContacts {
  std::vector<Offset> offsets;
  std::vector<Index> body_a, body_b;
  std::vector<Real> arm_a, arm_b, normal, mu, depth, restitution;
  std::vector<std::uint64_t> id;
  std::vector<Real> guess, impulse;

  void resize(Offset count);
  [[nodiscard]] WorldContacts<Real> view();
};

/// A world in host memory: the CPU's own, or a copy of a device's.
template <class Real>
struct WorldArrays {
  WorldArrays(const WorldModelView<Real>& world, Offset envs);

  /// Returns the arguments of kernels.
  [[nodiscard]] WorldJob<Real> job();
  /// The last step's contacts.
  [[nodiscard]] BodyBatchView<Real> batch();
  /// Replaces state, wrenches, statuses and contacts by a checkpoint's.
  void resume(const WorldCheckpoint<Real>& from);

  WorldModelView<Real> model;
  Offset env_count;
  std::vector<Real> position, orientation, twist, wrench, inv_inertia, twist_change, solved_twist, inv_mass;
  std::vector<Offset> body_offsets;
  std::vector<EnvStatus> status;
  HostContacts<Real> contacts;
};

/// The bodies of a job and these contacts as a batch, in whichever memory they lie.
template <class Real>
BodyBatchView<Real> batch_of(const WorldJob<Real>& job, const Real* inv_mass, const Offset* body_offsets,
                             const WorldContacts<Real>& contacts, Offset env_count, Offset contact_count,
                             MemorySpace space);

}  // namespace stiction
