#pragma once

#include "core/algorithm/driver/solver_selection.hpp"
#include "core/algorithm/plan/counting_sort.hpp"
#include "core/algorithm/plan/islands.hpp"
#include "core/algorithm/plan/plan_environment.hpp"
#include "cuda/api/kernel.hpp"
#include "cuda/kernels/batch_totals.hpp"
#include "cuda/kernels/plan_args.hpp"

/// The scheduler: three programs that make a plan on the device, in the integers that make_plan() makes on the host.
namespace stiction::inline STICTION_ISA {

STICTION_HD PlanTarget target_of(const cuda::PlanArgs& args, Offset env, Offset first_cone) {
  const cuda::PlanArrays& plan = args.plan;
  return {plan.path + env,
          plan.counts + env,
          plan.cone_order + first_cone,
          plan.vertex_offsets + first_cone + env,
          plan.color_offsets + first_cone + env,
          plan.color_count + env};
}

/// Soundness, size and class of every environment, and the whole plan of those that are not sparse.
struct InspectEnvironments {
  using Args = cuda::PlanArgs;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    const BatchStructure batch = with_totals(args.batch);
    for (Offset env = id.index; env < batch.env_count; env += id.count) inspect(team, args, batch, env);
  }

 private:
  template <Team TeamT>
  static STICTION_HD void inspect(TeamT& team, const Args& args, const BatchStructure& batch, Offset env) {
    const bool sound = structure_is_sound(team, batch, env);
    StructureView s{};
    if (sound) s = structure_of(batch, env);
    EnvPath path = sound ? path_of(team, s) : EnvPath::empty;
    const Index dofs = sound ? batch.env_dofs(env) : 0;
    if (dofs > 0) path = EnvPath::factor;
    const bool fits = s.rows <= args.most_rows && dofs <= args.most_dofs &&
                      (path != EnvPath::sparse || (args.may_be_sparse && s.entry_span() <= args.most_nonzeros));
    const std::uint32_t flags = !sound ? kFlagBadStructure : !fits ? kFlagOverCapacity : 0U;
    if (flags != 0) path = EnvPath::empty;
    const Offset first_cone = sound ? batch.env_cone_offsets[env] : 0;
    const PlanTarget target = target_of(args, env, first_cone);
    const SizeClass own = size_class(path, s.rows, args.limits);
    single(team, [&] {
      *target.path = path;
      *target.counts = ConeCounts{};
      *target.color_count = 0;
      args.plan.env_vertex_offsets[env] = first_cone + env;
      args.plan.flags[env] = flags;
      args.plan.key[env] = static_cast<std::uint8_t>(sort_key(own, s.rows, args.limits));
    });
    if (path == EnvPath::dense) plan_dense(team, s, target.counts, target.cone_order);
    // Cones of a factor stay in file order.
    if (path == EnvPath::factor) single(team, [&] { *target.counts = count_cones(s); });
  }
};

/// The order of execution, with nothing taken of it yet. One team's work. Before a later turn of the fallback chain it
/// begins with those that fell short of a turn before. If the turn has none, there is nothing to sort.
struct SortEnvironments {
  using Args = cuda::SortArgs;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    if (id.index != 0) return;
    const cuda::PlanArrays& plan = args.plan;
    for_each(team, kSizeClasses, [&](Index k) { plan.work_counter[k] = 0; });
    if (args.turn > 0 && !find_turn(team, args)) {
      for_each(team, kSizeClasses + 1, [&](Index k) { plan.class_begin[k] = 0; });
      return;
    }
    count_sort(
        team, args.env_count, kSortKeys, [&](Offset env) { return plan.key[env]; }, plan.order, plan.key_begin,
        plan.sort_scratch != nullptr ? plan.sort_scratch : static_cast<Index*>(id.shared));
    for_each(team, kSizeClasses + 1, [&](Index k) { plan.class_begin[k] = plan.key_begin[k * kBucketsPerClass]; });
  }

 private:
  /// Moves environments that fell short of a turn before to the next that is for them. Writes all keys: environments
  /// that this turn leaves are of the trivial class, which no turn launches. True if the turn has any, on every lane.
  template <Team TeamT>
  static STICTION_HD bool find_turn(TeamT& team, const Args& args) {
    std::uint32_t found = 0;
    for (Offset env = team.rank(); env < args.env_count; env += team.size()) {
      const EnvPath path = args.plan.path[env];
      SizeClass own = SizeClass::trivial;
      Index rows = 0;
      if (path != EnvPath::empty && turn_of(args, env) == args.turn) {
        rows = args.chain.features[env].rows;
        own = size_class(path, rows, args.limits);
        found = 1;
      }
      args.plan.key[env] = static_cast<std::uint8_t>(sort_key(own, rows, args.limits));
    }
    team.sync();
    return team.combine(found) != 0;
  }

  /// The turn that an environment takes now.
  static STICTION_HD int turn_of(const Args& args, Offset env) {
    std::uint8_t& assigned = args.chain.assigned[env];
    if (assigned < args.turn && falls_short(args.status[env]))
      assigned = static_cast<std::uint8_t>(next_turn(assigned, args.chain.features[env]));
    return assigned;
  }
};

/// Order and colours of the sparse environments, a team each.
struct ColorEnvironments {
  using Args = cuda::PlanArgs;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    const BatchStructure batch = with_totals(args.batch);
    const cuda::PlanArrays& plan = args.plan;
    const Offset end = plan.class_begin[static_cast<int>(SizeClass::sparse_block) + 1];
    for (Offset position = plan.class_begin[static_cast<int>(SizeClass::sparse_device)] + id.index; position < end;
         position += id.count) {
      const Offset env = plan.order[position];
      plan_sparse(team, structure_of(batch, env), target_of(args, env, batch.env_cone_offsets[env]),
                  plan.graph_scratch + id.index * plan.graph_slot);
    }
  }
};

/// Islands of every environment, a team each. An environment that is broken or beyond the capacity has none.
struct FindIslands {
  using Args = cuda::IslandArgs;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    const BatchStructure batch = with_totals(args.batch);
    for (Offset env = id.index; env < batch.env_count; env += id.count) {
      Index found = 0;
      if (structure_is_sound(team, batch, env)) {
        const StructureView s = structure_of(batch, env);
        if (s.rows > 0 && s.rows <= args.most_rows && s.entry_span() <= args.most_nonzeros)
          found =
              number_islands(team, s, args.island + batch.env_cone_offsets[env], args.scratch + id.index * args.slot);
      }
      single(team, [&] { args.count[env] = found; });
    }
  }
};

}  // namespace stiction::inline STICTION_ISA
