#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "core/algorithm/driver/solve_environment.hpp"
#include "core/algorithm/pack/load_lanes.hpp"
#include "core/algorithm/solver/npgs.hpp"
#include "tests/support/systems/prepared.hpp"
#include "tests/support/systems/random_systems.hpp"

/// Environments in the lanes of a pack, loaded as the pack driver loads them.
namespace stiction::test {

inline constexpr Law kLaw = Law::convex;

/// Each environment, and behind it in memory one that is no numbers: reads beyond the end are of those.
inline std::vector<Environment<double>> with_broken_neighbours(const std::vector<Environment<double>>& environments) {
  std::vector<Environment<double>> crowd;
  for (const auto& env : environments) {
    crowd.push_back(env);
    crowd.push_back(env);
    crowd.back().A.assign(env.A.size(), std::numeric_limits<double>::quiet_NaN());
  }
  return crowd;
}

/// Environments in the lanes of a pack of W.
template <class Real, int W>
class Lanes {
 public:
  using Packed = Pack<Real, W>;

  explicit Lanes(const std::vector<Environment<double>>& environments)
      : batch_(convert<Real>(batch_of(with_broken_neighbours(environments), kLaw))),
        plan_(make_plan(batch_.view())),
        lambda_(static_cast<std::size_t>(batch_.row_count())),
        w_(lambda_.size()),
        status_(2 * environments.size()) {
    ConeCounts slots;
    for (std::size_t e = 0; e < environments.size(); ++e) {
      const ConeCounts& own = plan_.counts[2 * e];
      const auto grow = [](Index& to, Index count) { to = count > to ? count : to; };
      grow(slots.free, own.free);
      grow(slots.unilateral, own.unilateral);
      grow(slots.box, own.box);
      for (Index m = 2; m <= kMaxConeRows; ++m) grow(slots.friction[m], own.friction[m]);
    }
    const Offset elements = W * DenseSystem<Real>::elements(slots, Npgs::workspace());
    memory_.resize(
        static_cast<std::size_t>(elements + PackWorkspace<Real, W>::elements(row_count(slots), cone_count(slots))) +
        64);
    auto* const memory =
        reinterpret_cast<Real*>((reinterpret_cast<std::uintptr_t>(memory_.data()) + 63) & ~std::uintptr_t{63});
    // Numbers that were not written must not be missed: they are NaN.
    for (Offset k = elements; k < static_cast<Offset>(memory_.size()) - 64; ++k)
      memory[k] = std::numeric_limits<Real>::quiet_NaN();
    for (Offset k = 0; k < elements; ++k) memory[k] = 0;
    pack = std::make_unique<DenseSystem<Packed>>(slots, Npgs::workspace(), reinterpret_cast<Packed*>(memory));
    for (int l = 0; l < W; ++l) lanes.emplace_back(slots, Npgs::workspace(), memory + l);
    workspace = std::make_unique<PackWorkspace<Real, W>>(memory + elements, pack->n, pack->cones);
    for (std::size_t e = 0; e < environments.size(); ++e) {
      envs.push_back(slice(batch_.view(), view_of(plan_), kLaw, static_cast<const Real*>(nullptr), lambda_.data(),
                           w_.data(), status_.data(), static_cast<Offset>(2 * e)));
      envs.back().is_full = has_full_rows(envs.back());
    }
  }

  /// Loads environment e into lane lane[e] for those given, and begins there. Returns the flags of each.
  std::vector<std::uint32_t> enter(const std::vector<std::pair<std::size_t, int>>& which, LoadRules rules = {}) {
    std::vector<PendingLoad<Real>> loads;
    for (const auto& [e, lane] : which) loads.push_back({&envs[e], lane, 0U, nullptr});
    load_lanes_of(*pack, lanes.data(), *workspace, rules, loads.data(), static_cast<int>(loads.size()));
    Packed taken(0);
    std::vector<std::uint32_t> flags;
    for (const auto& load : loads) {
      flags.push_back(load.flags);
      if ((load.flags & ~kHarmlessFlags) == 0) taken.v[load.lane] = Real(1);
    }
    finish_lanes(*pack, *workspace, taken > Packed(0), kLaw);
    std::vector<const EnvView<Real>*> loaded;
    std::vector<int> into;
    for (const auto& load : loads)
      if ((load.flags & ~kHarmlessFlags) == 0) {
        loaded.push_back(load.env);
        into.push_back(load.lane);
      }
    start_lanes(*pack, *workspace, lanes.data(), loaded.data(), into.data(), static_cast<int>(into.size()),
                taken > Packed(0));
    SerialTeam team;
    update_best<Npgs, kLaw>(team, *pack, taken > Packed(0));
    return flags;
  }

  std::unique_ptr<DenseSystem<Packed>> pack;
  std::vector<DenseSystem<Real, W>> lanes;
  std::unique_ptr<PackWorkspace<Real, W>> workspace;
  std::vector<EnvView<Real>> envs;

 private:
  ContactBatch<Real> batch_;
  PlanData plan_;
  std::vector<Real> lambda_, w_, memory_;
  std::vector<EnvStatus> status_;
};

/// Loads environments first, first + 1, ... into all lanes, and starts npgs in them.
template <class Real, int W>
void fill(Lanes<Real, W>& lanes, std::size_t first) {
  std::vector<std::pair<std::size_t, int>> entering;
  for (int l = 0; l < W; ++l) entering.emplace_back(first + static_cast<std::size_t>(l), l);
  lanes.enter(entering);
  SerialTeam team;
  for (int l = 0; l < W; ++l)
    start_method<Npgs, kLaw>(team, lanes.envs[first + static_cast<std::size_t>(l)],
                             lanes.lanes[static_cast<std::size_t>(l)]);
}

/// Makes the first row zero, so that its contact cannot move (docs/math/immovable.md); nothing asks it to.
inline void hold_first_row(Environment<double>& env) {
  for (std::size_t i = 0; i + 1 < env.row_offsets.size(); ++i)
    for (auto k = static_cast<std::size_t>(env.row_offsets[i]); k < static_cast<std::size_t>(env.row_offsets[i + 1]);
         ++k)
      if (i == 0 || env.column[k] == 0) env.A[k] = 0;
  if (!env.R.empty()) env.R[0] = 0;
  const bool opens = env.cones[0].kind == ConeKind::unilateral || env.cones[0].kind == ConeKind::friction;
  env.b[0] = opens ? 1000 : 0;
}

/// Returns environments of one layout or of several, in order and not, stored in full and not.
inline std::vector<Environment<double>> guests(bool alike) {
  std::vector<Environment<double>> envs;
  constexpr ConeOrder kOrders[] = {ConeOrder::friction_last, ConeOrder::friction_first, ConeOrder::shuffled};
  for (std::uint64_t seed = 1; seed <= 24; ++seed) {
    Recipe recipe;
    recipe.seed = seed;
    recipe.contacts = alike ? 4 : 1 + static_cast<int>(seed % 5);
    recipe.others = alike ? 0 : static_cast<int>(seed % 4);
    recipe.friction_rows = alike ? 3 : 0;
    recipe.order = kOrders[seed % 3];
    envs.push_back(random_contacts(recipe));
    Environment<double>& env = envs.back();
    if (seed % 5 == 3) hold_first_row(env);
    if (seed % 4 == 1) {  // columns of the first row backwards, so that rows are not stored in full
      std::reverse(env.column.begin(), env.column.begin() + env.row_offsets[1]);
      std::reverse(env.A.begin(), env.A.begin() + env.row_offsets[1]);
    }
    if (seed % 8 == 2) {  // an entry less
      env.column.erase(env.column.begin() + 1);
      env.A.erase(env.A.begin() + 1);
      for (std::size_t i = 1; i < env.row_offsets.size(); ++i) --env.row_offsets[i];
    }
  }
  return envs;
}

}  // namespace stiction::test
