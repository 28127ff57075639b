#include <limits>
#include <string>

#include "core/algorithm/plan/counting_sort.hpp"
#include "core/algorithm/plan/islands.hpp"
#include "core/algorithm/plan/plan_environment.hpp"
#include "core/algorithm/system/dense_system.hpp"
#include "core/algorithm/system/factor_system.hpp"
#include "core/algorithm/system/sparse_system.hpp"
#include "core/base/extents.hpp"
#include "core/job/fallback_order.hpp"
#include "cuda/kernels/solve_thread_per_env.hpp"
#include "cuda/machine/engine.hpp"
#include "cuda/machine/engine_classes.hpp"
#include "cuda/machine/memory_limits.hpp"
#include "stiction/error.hpp"

/// The engine's memory: that of each size class, the plan and the fallback chain for a capacity.
namespace stiction::cuda {

namespace {

/// Most environments of a batch: the sort counts them in integers of 32 bits.
constexpr Offset kMostEnvs = std::numeric_limits<Index>::max();
/// Warps with an environment a lane that run at once on a multiprocessor, as registers allow.
constexpr Offset kWarpsPerProcessor = 8;
/// Smallest class that has more than a lane for an environment.
constexpr SizeClass kFinestTeam = SizeClass::dense_tile;

Capacity joined(const Capacity& a, const Capacity& b) {
  Capacity both;
  both.envs = larger_of(a.envs, b.envs);
  both.rows = larger_of(a.rows, b.rows);
  both.cones = larger_of(a.cones, b.cones);
  both.nonzeros = larger_of(a.nonzeros, b.nonzeros);
  both.env_rows = larger_of(a.env_rows, b.env_rows);
  both.env_nonzeros = larger_of(a.env_nonzeros, b.env_nonzeros);
  both.env_dofs = larger_of(a.env_dofs, b.env_dofs);
  both.semidefinite = a.semidefinite || b.semidefinite;
  return both;
}

bool within(const Capacity& a, const Capacity& b) {
  return a.envs <= b.envs && a.rows <= b.rows && a.cones <= b.cones && a.nonzeros <= b.nonzeros &&
         a.env_rows <= b.env_rows && a.env_nonzeros <= b.env_nonzeros && a.env_dofs <= b.env_dofs &&
         (!a.semidefinite || b.semidefinite);
}

int lanes_of(SizeClass size_class) {
  switch (size_class) {
    case SizeClass::dense_tile:
      return 8;
    case SizeClass::dense_warp:
    case SizeClass::factor_warp:
    case SizeClass::thread_large:
    case SizeClass::thread_medium:
    case SizeClass::thread_small:
      return kWarp;
    case SizeClass::trivial:
      return 1;
    default:
      return kMostLanes;
  }
}

/// Integers of scratch that colouring an environment or finding its islands takes.
Offset graph_slot(const Capacity& capacity) {
  return larger_of<Offset>(plan_scratch_elements(capacity.env_rows, capacity.env_rows, capacity.env_nonzeros),
                           islands_scratch_elements(capacity.env_rows, capacity.env_rows, capacity.env_nonzeros));
}

/// Lanes of a team that looks at a whole environment's graph.
int graph_lanes(const Capacity& capacity) {
  return capacity.env_rows > 512 ? kMostLanes : kWarp;
}

}  // namespace

/// Numbers of Real that an environment of a class takes at most; 0: the capacity has none of the class.
template <class Real>
Offset Engine::slot_elements(SizeClass size_class, const Capacity& capacity, const Workspace& method) const {
  Offset elements = 0;
  if (is_sparse(size_class)) {
    if (!may_be_sparse(capacity)) return 0;
    if (size_class == SizeClass::sparse_device && capacity.env_rows < kWholeDeviceRows) return 0;
    // A smaller environment may have matrices, and with them take more room than the largest.
    for (const Index rows : {capacity.env_rows, smaller_of(capacity.env_rows, kDirectRows)})
      elements = larger_of<Offset>(elements, SparseSystem<Real>::elements(rows, rows, capacity.env_nonzeros, method));
  } else if (size_class == SizeClass::factor_warp) {
    if (capacity.env_dofs == 0) return 0;
    for (const Index rows : {capacity.env_rows, smaller_of(capacity.env_rows, kDirectRows)})
      elements = larger_of<Offset>(elements, FactorSystem<Real>::elements(rows, rows, capacity.env_dofs, method));
  } else {
    // A batch of few environments may come, too: then memory of single lanes is shared by more lanes. A later stage of
    // the fallback chain has teams alone.
    const bool needs_many = size_class == SizeClass::thread_large;
    ClassLimits limits = limits_for(method, needs_many ? capacity.envs : 0);
    if (!is_thread_per_env(size_class)) limits = limits.from(kFinestTeam);
    if (!limits.holds(size_class) || capacity.env_rows <= limits.below(size_class)) return 0;
    const Offset rows = smaller_of(limits.of(size_class), capacity.env_rows);
    // One row each: no cones take more room than cones of one row.
    const Workspace own = is_thread_per_env(size_class) ? method.in_bundles() : method;
    elements = SystemArrays<Real, 1>::elements(rows, rows, own) + rows * rows + own.square_elements(rows);
  }
  // Even, so that doubles in it are aligned.
  return elements + elements % 2;
}

Engine::ClassShape Engine::shape_of(SizeClass size_class, const Reserved& reserved, const Workspace& method) const {
  const Capacity& capacity = reserved.capacity;
  ClassShape shape;
  shape.launch.lanes = lanes_of(size_class);
  shape.launch.teams = capacity.envs;
  if (size_class == SizeClass::trivial) return shape;

  shape.slot_elements[0] = slot_elements<float>(size_class, capacity, method);
  if (shape.slot_elements[0] == 0) return {};
  if (reserved.has_doubles) shape.slot_elements[1] = slot_elements<double>(size_class, capacity, method);
  auto team_bytes = static_cast<std::size_t>(
      larger_of(Offset{sizeof(float)} * shape.slot_elements[0], Offset{sizeof(double)} * shape.slot_elements[1]));
  Offset per_processor = size_class == SizeClass::factor_warp ? 16 : 2;
  if (is_sparse(size_class)) {
    shape.launch.whole_device = size_class == SizeClass::sparse_device;
    shape.shared = false;
  }
  std::size_t head_bytes = 0;
  if (is_thread_per_env(size_class)) {
    team_bytes *= kWarpSlots;
    head_bytes = sizeof(BundleHead<double>);
    shape.launch.teams = (capacity.envs + kWarpSlots - 1) / kWarpSlots;
    per_processor = kWarpsPerProcessor;
  }
  shape.shared =
      shape.shared && least_block_bytes(shape.launch.lanes, head_bytes + team_bytes) <= api_.facts().shared_bytes;
  if (shape.shared) {
    shape.launch.shared_bytes = head_bytes + team_bytes;
    return shape;
  }
  shape.launch.shared_bytes = head_bytes;
  const Offset fitting = larger_of<Offset>(1, most_workspace_bytes(api_.facts()) / static_cast<Offset>(team_bytes));
  shape.launch.teams =
      shape.launch.whole_device
          ? 1
          : smaller_of(shape.launch.teams, smaller_of(fitting, per_processor * api_.facts().processors));
  shape.workspace_bytes = static_cast<std::size_t>(shape.launch.teams) * team_bytes;
  return shape;
}

/// The solvers that one of this name may come to.
std::bitset<kSolverKindCount> Engine::stages_of(SolverKind solver) {
  std::bitset<kSolverKindCount> solvers;
  if (solver != SolverKind::automatic) return solvers.set(static_cast<std::size_t>(solver));
  for (int turn = 0; turn < kFallbackTurns; ++turn) solvers.set(static_cast<std::size_t>(turn_solver(turn)));
  return solvers;
}

const Workspace& Engine::method_workspace(SolverKind solver) const {
  return api_.kernels().solvers[static_cast<std::size_t>(solver)].workspace;
}

/// Returns the limits of a batch's dense environments under a method. One that factorises never takes a lane each.
ClassLimits Engine::limits_for(const Workspace& method, Offset envs) const {
  ClassLimits limits = rules_.limits;
  if (envs >= rules_.many_per_processor * api_.facts().processors)
    limits = limits.with(SizeClass::thread_large, rules_.most_rows_of_many);
  return method.is_direct() ? limits.from(kFinestTeam) : limits;
}

/// Returns their limits under a solver. The fallback chain's stages sort anew.
ClassLimits Engine::limits_for(SolverKind solver, Offset envs) const {
  return limits_for(solver == SolverKind::automatic ? Workspace{} : method_workspace(solver), envs);
}

/// Returns the limits of classes for a batch under a solver. A lane with an environment of its own sweeps in no blocks.
ClassLimits Engine::limits_for(SolverKind solver, const BatchStructure& batch) const {
  const ClassLimits limits = limits_for(solver, batch.env_count);
  return batch.block_visits > 1 ? limits.from(kFinestTeam) : limits;
}

/// Returns their limits under a turn of the fallback chain. Few environments come to a later one, however large the
/// batch is. A lane each would leave the device idle, and its classes would be launches for nothing.
ClassLimits Engine::limits_of_turn(int turn, Offset envs) const {
  const SolverKind solver = turn_solver(turn);
  return turn == 0 ? limits_for(solver, envs) : limits_for(solver, 0).from(kFinestTeam);
}

/// Returns true if the capacity has environments that a turn of the fallback chain may be for.
bool Engine::may_take(int turn) const {
  const Capacity& capacity = reserved_.capacity;
  if (turn == kEarlyGradientTurn) return may_take_early_gradients(capacity.env_rows);
  return turn != kJacobiTurn || may_be_sparse(capacity) || capacity.env_dofs > 0;
}

/// Prepares every kernel that a solve may launch, under either law: the first solve can be captured.
void Engine::prepare_launches(Precision precision) {
  const KernelCatalogue& kernels = api_.kernels();
  const auto p = static_cast<std::size_t>(precision);
  api_.prepare(kernels.plan.inspect, {1, kPlanLanes});
  api_.prepare(kernels.plan.sort, sort_);
  api_.prepare(kernels.plan.islands, graph_);
  if (may_be_sparse(reserved_.capacity)) api_.prepare(kernels.plan.color, graph_);
  api_.prepare(kernels.choose[p], {1, kPlanLanes});
  for (std::size_t kind = 0; kind < shapes_.size(); ++kind) {
    if (!reserved_.solvers.test(kind)) continue;
    const auto solver = static_cast<SolverKind>(kind);
    for (int k = 0; k < kSizeClasses; ++k) {
      const auto size_class = static_cast<SizeClass>(k);
      if (!has_class(solver, size_class)) continue;
      const LaunchShape& shape = shapes_[kind][static_cast<std::size_t>(k)].launch;
      if (size_class == SizeClass::trivial) {
        api_.prepare(kernels.trivial[p], shape);
        continue;
      }
      for (const Law law : {Law::convex, Law::coulomb})
        api_.prepare(kernel_of(solver, size_class, precision, law), shape);
    }
  }
}

bool Engine::has_room(const Capacity& capacity) const {
  return within(capacity, reserved_.capacity);
}

bool Engine::has_reserved(const Capacity& capacity, SolverKind solver, Precision precision) const {
  return has_room(capacity) && (stages_of(solver) & ~reserved_.solvers).none() &&
         (precision == Precision::f32 || reserved_.has_doubles);
}

void Engine::reserve(const Capacity& capacity, SolverKind solver, Precision precision) {
  if (has_reserved(capacity, solver, precision)) return;
  if (capacity.envs > kMostEnvs)
    throw Error(ErrorCode::invalid_argument, "capacity.envs = " + std::to_string(capacity.envs) +
                                                 ", expected at most " + std::to_string(kMostEnvs) +
                                                 ": solve the batch in parts");
  if (captured_)
    throw Error(ErrorCode::invalid_argument,
                "capacity: the solver would have to make room, and its memory is part of captured graphs: use another "
                "Solver for this batch, or construct this one with the Capacity of all batches to come");
  Reserved reserved;
  ChainArrays chain{};
  reserved.capacity = joined(reserved_.capacity, capacity);
  reserved.solvers = reserved_.solvers | stages_of(solver);
  reserved.has_doubles = reserved_.has_doubles || precision == Precision::f64;

  // Stages follow one another, so those of a class share its device memory. Fast memory is asked for by each launch.
  std::array<Shapes, kSolverKindCount> shapes;
  std::array<std::size_t, kSizeClasses> workspace_bytes{};
  std::array<std::byte*, kSizeClasses> workspace{};
  for (std::size_t kind = 0; kind < shapes.size(); ++kind) {
    if (!reserved.solvers.test(kind)) continue;
    for (std::size_t k = 0; k < workspace_bytes.size(); ++k) {
      shapes[kind][k] = shape_of(static_cast<SizeClass>(k), reserved, method_workspace(static_cast<SolverKind>(kind)));
      workspace_bytes[k] = larger_of(workspace_bytes[k], shapes[kind][k].workspace_bytes);
    }
  }
  PlanArrays plan{};
  const Offset envs = reserved.capacity.envs, cones = reserved.capacity.cones;
  plan.graph_slot = graph_slot(reserved.capacity);
  const Offset graph_teams = larger_of<Offset>(
      1,
      smaller_of(smaller_of(envs, Offset{2} * api_.facts().processors),
                 larger_of<Offset>(1, most_workspace_bytes(api_.facts()) / (plan.graph_slot * Offset{sizeof(Index)}))));
  ArraySet arrays;
  arrays.add(plan.path, envs);
  arrays.add(plan.counts, envs);
  arrays.add(plan.cone_order, cones);
  arrays.add(plan.env_vertex_offsets, envs);
  arrays.add(plan.vertex_offsets, cones + envs);
  arrays.add(plan.color_offsets, cones + envs);
  arrays.add(plan.color_count, envs);
  arrays.add(plan.flags, envs);
  arrays.add(plan.key, envs);
  arrays.add(chain.features, envs);
  arrays.add(chain.assigned, envs);
  arrays.add(plan.order, envs);
  arrays.add(plan.key_begin, kSortKeys + 1);
  arrays.add(plan.class_begin, kSizeClasses + 1);
  arrays.add(plan.work_counter, kSizeClasses);
  LaunchShape sort{1, kSortLanes, sizeof(Index) * static_cast<std::size_t>(count_sort_scratch(kSortLanes, kSortKeys))};
  if (least_block_bytes(sort.lanes, sort.shared_bytes) > api_.facts().shared_bytes) {
    sort.shared_bytes = 0;
    arrays.add(plan.sort_scratch, count_sort_scratch(kSortLanes, kSortKeys));
  }
  arrays.add(plan.graph_scratch, graph_teams * plan.graph_slot);
  for (std::size_t k = 0; k < workspace.size(); ++k)
    if (workspace_bytes[k] > 0) arrays.add(workspace[k], static_cast<Offset>(workspace_bytes[k]));

  wait_for_all();
  DeviceMemory memory(api_, arrays.bytes());
  arrays.place(memory.get());
  memory_ = std::move(memory);
  reserved_ = reserved;
  plan_ = plan;
  chain_ = chain;
  shapes_ = shapes;
  for (Shapes& of_solver : shapes_)
    for (std::size_t k = 0; k < of_solver.size(); ++k) of_solver[k].workspace = workspace[k];
  sort_ = sort;
  graph_ = {graph_teams, graph_lanes(reserved.capacity)};
  prepare_launches(Precision::f32);
  if (reserved_.has_doubles) prepare_launches(Precision::f64);
}

}  // namespace stiction::cuda
