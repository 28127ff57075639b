#include "cuda/engine.hpp"

#include <string>

#include "core/algorithm/plan/counting_sort.hpp"
#include "core/algorithm/plan/islands.hpp"
#include "core/algorithm/plan/plan_environment.hpp"
#include "core/algorithm/system/dense_system.hpp"
#include "core/algorithm/system/factor_system.hpp"
#include "core/algorithm/system/sparse_system.hpp"
#include "core/base/extents.hpp"
#include "core/job/fallback_chain.hpp"
#include "core/plan/structure_view.hpp"
#include "cuda/programs/choose_program.hpp"
#include "cuda/programs/solve_thread_per_env.hpp"
#include "cuda/programs/trivial_program.hpp"
#include "stiction/error.hpp"

namespace stiction::cuda {

namespace {

/// Most device memory that the systems of one class may take, unless a single one needs more.
constexpr Offset kWorkspaceBytes = Offset{1} << 30;
constexpr int kSortLanes = 256;
/// Smallest class of a method that factorises.
constexpr SizeClass kFinestDirect = SizeClass::dense_tile;
constexpr int kPlanLanes = 32;

Capacity joined(const Capacity& a, const Capacity& b) {
  Capacity both;
  both.envs = larger_of(a.envs, b.envs);
  both.rows = larger_of(a.rows, b.rows);
  both.cones = larger_of(a.cones, b.cones);
  both.nonzeros = larger_of(a.nonzeros, b.nonzeros);
  both.env_rows = larger_of(a.env_rows, b.env_rows);
  both.env_nonzeros = larger_of(a.env_nonzeros, b.env_nonzeros);
  both.env_dofs = larger_of(a.env_dofs, b.env_dofs);
  return both;
}

bool within(const Capacity& a, const Capacity& b) {
  return a.envs <= b.envs && a.rows <= b.rows && a.cones <= b.cones && a.nonzeros <= b.nonzeros &&
         a.env_rows <= b.env_rows && a.env_nonzeros <= b.env_nonzeros && a.env_dofs <= b.env_dofs;
}

bool is_sparse(SizeClass size_class) {
  return size_class == SizeClass::sparse_block || size_class == SizeClass::sparse_device;
}

bool is_thread_per_env(SizeClass size_class) {
  return size_class == SizeClass::thread_medium || size_class == SizeClass::thread_small;
}

const char* name_of(SizeClass size_class) {
  switch (size_class) {
    case SizeClass::sparse_device:
      return "sparse_device";
    case SizeClass::sparse_block:
      return "sparse_block";
    case SizeClass::factor_warp:
      return "factor_warp";
    case SizeClass::dense_large:
      return "dense_large";
    case SizeClass::dense_block:
      return "dense_block";
    case SizeClass::dense_warp:
      return "dense_warp";
    case SizeClass::dense_tile:
      return "dense_tile";
    case SizeClass::thread_medium:
      return "thread_medium";
    case SizeClass::thread_small:
      return "thread_small";
    case SizeClass::trivial:
      return "trivial";
  }
  return "?";
}

int lanes_of(SizeClass size_class) {
  switch (size_class) {
    case SizeClass::dense_tile:
      return 8;
    case SizeClass::dense_warp:
    case SizeClass::factor_warp:
      return kWarp;
    case SizeClass::thread_medium:
    case SizeClass::thread_small:
      return kBundle;
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

/// Whether environments can be so large that they are sparse.
bool may_be_sparse(const Capacity& capacity) {
  return choose_path(capacity.env_rows, 0) == EnvPath::sparse;
}

template <class Real>
constexpr Precision kPrecisionOf = sizeof(Real) == sizeof(float) ? Precision::f32 : Precision::f64;

}  // namespace

Engine::Engine(DeviceApi& api, SizeClass finest) : api_(api), finest_(finest), timer_(api), plan_{} {
  for (int k = 0; k < kBranches; ++k) {
    branch_[static_cast<std::size_t>(k)] = std::make_unique<Stream>(api_);
    joined_[static_cast<std::size_t>(k)] = std::make_unique<Event>(api_);
  }
  forked_ = std::make_unique<Event>(api_);
  done_ = std::make_unique<Event>(api_);
}

Engine::~Engine() {
  finish(branch_[0]->get());
  timer_.collect();
}

/// Waits for everything this engine has queued.
void Engine::wait_for_all() {
  api_.wait(branch_[0]->get(), done_->get());
  for (const auto& branch : branch_) api_.synchronize(branch->get());
}

/// Waits for all after a failure or at the end, `stream` included; the device may be lost.
void Engine::finish(StreamHandle stream) noexcept {
  try {
    if (api_.capturing(stream)) return;
    wait_for_all();
    api_.synchronize(stream);
  } catch (const Error&) {
    return;
  }
}

Engine::ClassShape Engine::shape_of(SizeClass size_class, const Reserved& reserved) const {
  const Capacity& capacity = reserved.capacity;
  ClassShape shape;
  shape.launch.lanes = lanes_of(size_class);
  shape.launch.teams = capacity.envs;
  if (size_class == SizeClass::trivial) return shape;

  Offset elements = 0;
  Offset per_processor = 2;
  if (is_sparse(size_class)) {
    if (!may_be_sparse(capacity)) return {};
    if (size_class == SizeClass::sparse_device && capacity.env_rows < kWholeDeviceRows) return {};
    // A smaller environment may have matrices, and with them take more room than the largest.
    for (const Index rows : {capacity.env_rows, smaller_of(capacity.env_rows, kDirectRows)})
      elements = larger_of<Offset>(elements,
                                   SparseSystem<float>::elements(rows, rows, capacity.env_nonzeros, reserved.method));
    shape.launch.whole_device = size_class == SizeClass::sparse_device;
    shape.shared = false;
  } else if (size_class == SizeClass::factor_warp) {
    if (capacity.env_dofs == 0) return {};
    for (const Index rows : {capacity.env_rows, smaller_of(capacity.env_rows, kDirectRows)})
      elements =
          larger_of<Offset>(elements, FactorSystem<float>::elements(rows, rows, capacity.env_dofs, reserved.method));
    per_processor = 16;
  } else {
    if (size_class > finest_) return {};
    const SizeClass smaller = static_cast<SizeClass>(static_cast<int>(size_class) + 1);
    // A method that factorises never takes a bundle: what would be one is a tile.
    const bool is_finest = size_class == finest_ || (reserved.method.is_direct() && size_class == kFinestDirect);
    if (capacity.env_rows <= (is_finest ? 0 : class_rows(smaller))) return {};
    const Offset rows = smaller_of(class_rows(size_class), capacity.env_rows);
    // One row each: no cones take more room than cones of one row.
    const Workspace method = is_thread_per_env(size_class) ? reserved.method.in_bundles() : reserved.method;
    elements = SystemArrays<float, 1>::elements(rows, rows, method) + rows * rows + method.square_elements(rows);
  }
  // Even, so that doubles in it are aligned.
  elements += elements % 2;
  shape.slot_elements = elements;
  std::size_t team_bytes = static_cast<std::size_t>(elements) * reserved.scalar_bytes;
  std::size_t head_bytes = 0;
  if (is_thread_per_env(size_class)) {
    team_bytes *= kBundle;
    head_bytes = sizeof(BundleHead<double>);
    shape.launch.teams = (capacity.envs + kBundleIntake - 1) / kBundleIntake;
    per_processor = 8;
  }
  shape.shared = shape.shared && head_bytes + team_bytes <= api_.facts().shared_bytes;
  if (shape.shared) {
    shape.launch.shared_bytes = head_bytes + team_bytes;
    return shape;
  }
  shape.launch.shared_bytes = head_bytes;
  const Offset fitting = larger_of<Offset>(1, kWorkspaceBytes / static_cast<Offset>(team_bytes));
  shape.launch.teams =
      shape.launch.whole_device
          ? 1
          : smaller_of(shape.launch.teams, smaller_of(fitting, per_processor * api_.facts().processors));
  shape.workspace_bytes = static_cast<std::size_t>(shape.launch.teams) * team_bytes;
  return shape;
}

Workspace Engine::method_workspace(SolverKind solver) const {
  const auto& solvers = api_.kernels().solvers;
  if (solver != SolverKind::automatic) return solvers[static_cast<std::size_t>(solver)].workspace;
  Workspace workspace;
  for (int stage = 0; stage < kFallbackStages; ++stage)
    workspace = workspace.joined(solvers[static_cast<std::size_t>(fallback_stage(stage).solver)].workspace);
  return workspace;
}

/// Class of the smallest dense environments under a solver. The fallback chain's stages sort anew.
SizeClass Engine::finest_for(SolverKind solver) const {
  return solver != SolverKind::automatic && method_workspace(solver).is_direct() ? smaller_of(finest_, kFinestDirect)
                                                                                 : finest_;
}

bool Engine::has_reserved(const Capacity& capacity, SolverKind solver, Precision precision) const {
  return within(capacity, reserved_.capacity) &&
         method_workspace(solver).joined(reserved_.method) == reserved_.method &&
         (precision == Precision::f64 ? sizeof(double) : sizeof(float)) <= reserved_.scalar_bytes;
}

void Engine::reserve(const Capacity& capacity, SolverKind solver, Precision precision) {
  if (has_reserved(capacity, solver, precision)) return;
  if (captured_)
    throw Error(ErrorCode::invalid_argument,
                "capacity: the solver would have to make room, and its memory is part of captured graphs: use another "
                "Solver for this batch, or construct this one with the Capacity of all batches to come");
  Reserved reserved;
  std::uint8_t* assigned = nullptr;
  reserved.capacity = joined(reserved_.capacity, capacity);
  reserved.method = method_workspace(solver).joined(reserved_.method);
  reserved.scalar_bytes =
      larger_of(reserved_.scalar_bytes, precision == Precision::f64 ? sizeof(double) : sizeof(float));

  std::array<ClassShape, kSizeClasses> shapes;
  for (int k = 0; k < kSizeClasses; ++k)
    shapes[static_cast<std::size_t>(k)] = shape_of(static_cast<SizeClass>(k), reserved);
  PlanArrays plan{};
  const Offset envs = reserved.capacity.envs, cones = reserved.capacity.cones;
  plan.graph_slot = graph_slot(reserved.capacity);
  const Offset graph_teams = larger_of<Offset>(
      1, smaller_of(smaller_of(envs, Offset{2} * api_.facts().processors),
                    larger_of<Offset>(1, kWorkspaceBytes / (plan.graph_slot * Offset{sizeof(Index)}))));
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
  arrays.add(assigned, envs);
  arrays.add(plan.order, envs);
  arrays.add(plan.key_begin, kSortKeys + 1);
  arrays.add(plan.class_begin, kSizeClasses + 1);
  arrays.add(plan.work_counter, kSizeClasses);
  arrays.add(plan.sort_scratch, count_sort_scratch(kSortLanes, kSortKeys));
  arrays.add(plan.graph_scratch, graph_teams * plan.graph_slot);
  for (ClassShape& shape : shapes)
    if (shape.workspace_bytes > 0) arrays.add(shape.workspace, static_cast<Offset>(shape.workspace_bytes));

  wait_for_all();
  DeviceMemory memory(api_, arrays.bytes());
  arrays.place(memory.get());
  memory_ = std::move(memory);
  reserved_ = reserved;
  plan_ = plan;
  assigned_ = assigned;
  shapes_ = shapes;
  graph_ = {graph_teams, graph_lanes(reserved.capacity)};
}

template <class Real>
void Engine::queue_plan(const EngineRequest<Real>& request) {
  const PlanArgs args{structure_view(request.batch),   plan_,
                      reserved_.capacity.env_rows,     reserved_.capacity.env_dofs,
                      reserved_.capacity.env_nonzeros, finest_for(request.options.solver)};
  const PlanKernels& kernels = api_.kernels().plan;
  const StreamHandle stream = request.stream;
  api_.launch(kernels.inspect, {request.batch.env_count, kPlanLanes}, &args, stream);
  api_.launch(kernels.sort, {1, kSortLanes}, &args, stream);
  if (may_be_sparse(reserved_.capacity)) api_.launch(kernels.color, graph_, &args, stream);
}

template <class Real>
void Engine::queue_trivial(const EngineRequest<Real>& request, const SolveJob<Real>& job, int lane,
                           StreamHandle stream) {
  const ClassQueue queue{plan_.order, plan_.class_begin, plan_.work_counter};
  // An environment without anything to solve is answered in the name of the first stage.
  const SolverKind solver =
      request.options.solver == SolverKind::automatic ? fallback_stage(0).solver : request.options.solver;
  const TrivialArgs<Real> args{job, queue, plan_.flags, solver};
  const KernelRef& kernel = api_.kernels().trivial[static_cast<std::size_t>(kPrecisionOf<Real>)];
  const LaunchShape& shape = shapes_[static_cast<std::size_t>(SizeClass::trivial)].launch;
  timer_.time(name_of(SizeClass::trivial), kernel.name, lane, stream,
              [&] { api_.launch(kernel, shape, &args, stream); });
}

template <class Real>
void Engine::queue_class(const EngineRequest<Real>& request, const SolveJob<Real>& job, SolverKind solver,
                         SizeClass size_class, int lane, StreamHandle stream) {
  const ClassShape& shape = shapes_[static_cast<std::size_t>(size_class)];
  const ClassQueue queue{plan_.order, plan_.class_begin, plan_.work_counter};
  const auto precision = static_cast<std::size_t>(kPrecisionOf<Real>);
  const SolveKernels& kernels = api_.kernels()
                                    .solvers[static_cast<std::size_t>(solver)]
                                    .by_precision_and_law[precision][static_cast<std::size_t>(request.law)];
  const KernelRef& kernel = is_thread_per_env(size_class)          ? kernels.bundles
                            : is_sparse(size_class)                ? kernels.sparse
                            : size_class == SizeClass::factor_warp ? kernels.factor
                                                                   : kernels.dense;
  const SolveArgs<Real> args{job, queue, size_class, shape.shared ? nullptr : reinterpret_cast<Real*>(shape.workspace),
                             shape.slot_elements};
  timer_.time(name_of(size_class), kernel.name, lane, stream,
              [&] { api_.launch(kernel, shape.launch, &args, stream); });
}

/// Classes on branches of their own, so that a small one fills what a large one leaves idle at its end.
template <class Real>
void Engine::queue_classes(const EngineRequest<Real>& request, const SolveJob<Real>& job, SolverKind solver,
                           bool with_trivial) {
  const StreamHandle stream = request.stream;
  api_.record(forked_->get(), stream);
  for (const auto& branch : branch_) api_.wait(branch->get(), forked_->get());
  int next = 0;
  for (int k = 0; k < kSizeClasses; ++k) {
    const auto size_class = static_cast<SizeClass>(k);
    if (shapes_[static_cast<std::size_t>(k)].launch.teams == 0) continue;
    if (is_thread_per_env(size_class) && size_class > finest_for(solver)) continue;
    if (size_class == SizeClass::trivial && !with_trivial) continue;
    const int lane = next++ % (kBranches + 1);
    const StreamHandle own = lane == 0 ? stream : branch_[static_cast<std::size_t>(lane - 1)]->get();
    if (size_class == SizeClass::trivial)
      queue_trivial(request, job, lane, own);
    else
      queue_class(request, job, solver, size_class, lane, own);
  }
  for (int k = 0; k < kBranches; ++k) {
    const auto index = static_cast<std::size_t>(k);
    api_.record(joined_[index]->get(), branch_[index]->get());
    api_.wait(stream, joined_[index]->get());
  }
}

/// Stage by stage, each from the answer so far, those environments that have come to it (docs/math/auto.md). Who they
/// are is decided on the device.
template <class Real>
void Engine::queue_fallbacks(const EngineRequest<Real>& request, SolveJob<Real> job) {
  const StreamHandle stream = request.stream;
  const PlanArgs plan{structure_view(request.batch), plan_, 0, 0, 0, SizeClass::trivial};
  const KernelRef& choose = api_.kernels().choose[static_cast<std::size_t>(kPrecisionOf<Real>)];
  const Real omega = job.omega;
  job.stage = 0;
  queue_trivial(request, job, 0, stream);
  for (int stage = 0; stage < kFallbackStages; ++stage) {
    const SolverKind solver = fallback_stage(stage).solver;
    const ChooseArgs<Real> args{job, plan_, assigned_, stage, finest_for(solver)};
    timer_.time("choose", to_string(solver), 0, stream, [&] {
      api_.launch(choose, {request.batch.env_count, kPlanLanes}, &args, stream);
      api_.launch(api_.kernels().plan.sort, {1, kSortLanes}, &plan, stream);
      api_.fill_zero(plan_.work_counter, kSizeClasses * sizeof(Offset), stream);
    });
    job.warm_start = job.lambda;
    job.stage = stage;
    job.omega = omega * static_cast<Real>(fallback_stage(stage).omega);
    queue_classes(request, job, solver, false);
  }
}

template <class Real>
void Engine::queue_solve(const EngineRequest<Real>& request) {
  const StreamHandle stream = request.stream;
  const bool capturing = api_.capturing(stream);
  captured_ = captured_ || capturing;
  // The arrays are one set: a solve waits for the one before, whatever stream that was on. A graph's solves are ordered
  // where the graph is launched.
  if (!capturing) api_.wait(stream, done_->get());
  timer_.attach(request.options.tracer, capturing);
  api_.fill_zero(plan_.work_counter, kSizeClasses * sizeof(Offset), stream);
  if (!request.planned) timer_.time("plan", nullptr, 0, stream, [&] { queue_plan(request); });

  const SolverOptions& options = request.options;
  const bool is_ladder = options.solver == SolverKind::automatic;
  const SolveJob<Real> job{request.batch,        plan_.view(),
                           request.warm_start,   request.solution.lambda,
                           request.solution.w,   request.solution.status,
                           options.tolerance,    options.max_iterations,
                           options.stall_window, static_cast<Real>(options.omega),
                           request.law};
  if (is_ladder)
    queue_fallbacks(request, job);
  else
    queue_classes(request, job, options.solver, true);
  if (!capturing) api_.record(done_->get(), stream);
}

template <class Real>
void Engine::solve(const EngineRequest<Real>& request) {
  if (request.batch.env_count == 0) return;
  try {
    queue_solve(request);
  } catch (const Error&) {
    // Whatever was queued before the failure must not run on while the caller takes its memory back.
    finish(request.stream);
    throw;
  }
}

void Engine::islands(const ContactBatchView<float>& batch, Index* island, Index* count, StreamHandle stream) {
  if (batch.env_count == 0) return;
  const bool capturing = api_.capturing(stream);
  captured_ = captured_ || capturing;
  if (!capturing) api_.wait(stream, done_->get());
  const IslandArgs args{
      batch,           island, count, reserved_.capacity.env_rows, reserved_.capacity.env_nonzeros, plan_.graph_scratch,
      plan_.graph_slot};
  api_.launch(api_.kernels().plan.islands, graph_, &args, stream);
  if (!capturing) api_.record(done_->get(), stream);
}

template void Engine::solve(const EngineRequest<float>&);
template void Engine::solve(const EngineRequest<double>&);

}  // namespace stiction::cuda
