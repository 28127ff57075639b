#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "core/algorithm/velocity/lanes/dof_islands.hpp"

namespace stiction::cpu {

/// The parts of environments that are too large for a lane. Their lists live as long as this.
template <class Real>
class LargeParts {
 public:
  /// Appends the parts of each environment of which takes(part) is true for all.
  template <class Takes>
  void append(const JacobianBatchView<Real>& batch, std::span<const Offset> envs, std::vector<LaneEnv<Real>>& parts,
              const Takes& takes) {
    Offset integers = 0;
    const auto size = [&](Offset env) { return DofIslands<Real>::integers(batch.env_dofs(env), batch.env_cones(env)); };
    for (const Offset env : envs) integers += size(env);
    if (lists_.size() < static_cast<std::size_t>(integers)) lists_.resize(static_cast<std::size_t>(integers));
    Index* memory = lists_.data();
    for (const Offset env : envs) {
      DofIslands<Real> islands(batch, env, memory);
      memory += size(env);
      islands.find();
      const std::size_t before = parts.size();
      bool takes_all = true;
      for (Index i = 0; i < islands.count(); ++i) {
        parts.push_back(islands.part(i));
        takes_all = takes_all && takes(parts.back());
      }
      if (!takes_all) parts.resize(before);
    }
  }

 private:
  std::vector<Index> lists_;
};

/// Like robots side by side, and large parts behind those that go into packs.
template <class Real>
void sort_by_size(std::vector<LaneEnv<Real>>& parts) {
  const auto is_smaller = [](const LaneEnv<Real>& a, const LaneEnv<Real>& b) { return a.dofs < b.dofs; };
  if (!std::ranges::is_sorted(parts, is_smaller)) std::ranges::stable_sort(parts, is_smaller);
}

}  // namespace stiction::cpu
