#pragma once

#include <algorithm>

#include "core/algorithm/velocity/lanes/likeness.hpp"
#include "cpu_fallback/tables/velocity_kernels.hpp"

namespace stiction::inline STICTION_ISA {

/// Environments of up to 64 degrees of freedom, so that those that follow one another have like cones. Their cones are
/// found on the way.
template <class Real>
class AlikeEnvs {
 public:
  /// in_double(env): whether it goes behind those of which that is false. Up to `width` of them make one pack.
  template <class F>
  AlikeEnvs(const JacobianBatchView<Real>& batch, const LaneEnv<Real>* envs, Offset count, Index width,
            cpu::VelocityScratch& scratch, F&& in_double)
      : count_(count) {
    Offset cones = 0;
    for (Offset i = 0; i < count; ++i) cones += envs[i].cones;
    auto* next = scratch.items.reserve<SlotItem<DofSet>>(cones);
    auto* const begins = scratch.begins.reserve<const SlotItem<DofSet>*>(count);
    keys_ = scratch.keys.reserve<Likeness>(count);
    for (Offset i = 0; i < count; ++i) {
      SerialTeam alone;
      list_items(alone, batch, envs[i], next);
      const bool is_double = in_double(envs[i]);
      keys_[i] = likeness_of(next, count > width ? envs[i].cones : 0, envs[i].dofs, is_double, static_cast<Index>(i));
      begins[i] = next;
      next += envs[i].cones;
      doubles_ += is_double ? 1 : 0;
    }
    if (!std::is_sorted(keys_, keys_ + count)) std::sort(keys_, keys_ + count);
    envs_ = scratch.envs.reserve<LaneEnv<Real>>(count);
    listed_ = scratch.listed.reserve<const SlotItem<DofSet>*>(count);
    for (Offset i = 0; i < count; ++i) {
      envs_[i] = envs[from(i)];
      listed_[i] = begins[from(i)];
    }
  }

  [[nodiscard]] const LaneEnv<Real>* envs() const { return envs_; }
  /// Counts of those before those in double, and of all.
  [[nodiscard]] Offset singles() const { return count_ - doubles_; }
  [[nodiscard]] Offset doubles() const { return doubles_; }
  /// The cones of a pack's members.
  [[nodiscard]] const SlotItem<DofSet>* const* cones_of(const LaneEnv<Real>* members) const {
    return listed_ + (members - envs_);
  }
  /// Leaves those behind `singles()` out of which keep(env) is false.
  template <class F>
  void keep_doubles(F&& keep) {
    Offset kept = singles();
    for (Offset i = kept; i < count_; ++i) {
      if (!keep(envs_[i])) continue;
      envs_[kept] = envs_[i];
      listed_[kept++] = listed_[i];
    }
    doubles_ -= count_ - kept;
    count_ = kept;
  }
  /// Returns the former index of the i-th.
  [[nodiscard]] Offset from(Offset i) const { return keys_[i].at; }

 private:
  Likeness* keys_ = nullptr;
  LaneEnv<Real>* envs_ = nullptr;
  const SlotItem<DofSet>** listed_ = nullptr;
  Offset count_, doubles_ = 0;
};

}  // namespace stiction::inline STICTION_ISA
