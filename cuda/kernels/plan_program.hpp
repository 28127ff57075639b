#pragma once

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
    const ContactBatchView<float> batch = with_totals(args.batch);
    for (Offset env = id.index; env < batch.env_count; env += id.count) inspect(team, args, batch, env);
  }

 private:
  template <Team TeamT>
  static STICTION_HD void inspect(TeamT& team, const Args& args, const ContactBatchView<float>& batch, Offset env) {
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
    // Of a factor, whose cones stay in file order, a solve asks no more than whether it has some of these.
    const bool is_boxed = path == EnvPath::factor && has_kind(team, s, ConeKind::box_friction);
    const bool has_matrices = path == EnvPath::factor && has_kind(team, s, ConeKind::semidefinite);
    single(team, [&] {
      *target.path = path;
      *target.counts = ConeCounts{};
      target.counts->box_friction = is_boxed ? 1 : 0;
      target.counts->semidefinite = has_matrices ? 1 : 0;
      *target.color_count = 0;
      args.plan.env_vertex_offsets[env] = first_cone + env;
      args.plan.flags[env] = flags;
      args.plan.key[env] = static_cast<std::uint8_t>(sort_key(own, s.rows, args.limits));
    });
    if (path == EnvPath::dense) plan_dense(team, s, target.counts, target.cone_order);
  }
};

/// The order of execution. One team's work.
struct SortEnvironments {
  using Args = cuda::PlanArgs;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    if (id.index != 0) return;
    const cuda::PlanArrays& plan = args.plan;
    count_sort(
        team, args.batch.env_count, kSortKeys, [&](Offset env) { return plan.key[env]; }, plan.order, plan.key_begin,
        plan.sort_scratch != nullptr ? plan.sort_scratch : static_cast<Index*>(id.shared));
    for_each(team, kSizeClasses + 1, [&](Index k) { plan.class_begin[k] = plan.key_begin[k * kBucketsPerClass]; });
  }
};

/// Order and colours of the sparse environments, a team each.
struct ColorEnvironments {
  using Args = cuda::PlanArgs;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    const ContactBatchView<float> batch = with_totals(args.batch);
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

/// Islands of every environment, a team each. What is broken or beyond the capacity has none.
struct FindIslands {
  using Args = cuda::IslandArgs;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    const ContactBatchView<float> batch = with_totals(args.batch);
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
