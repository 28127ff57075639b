#include "cuda/machine/engine.hpp"

#include <string>

#include "core/job/fallback_order.hpp"
#include "core/machine/count_captured_call.hpp"
#include "cuda/kernels/choose_program.hpp"
#include "cuda/kernels/trivial_program.hpp"
#include "cuda/machine/engine_classes.hpp"
#include "stiction/error.hpp"

namespace stiction::cuda {

namespace {

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
    case SizeClass::thread_large:
      return "thread_large";
    case SizeClass::thread_medium:
      return "thread_medium";
    case SizeClass::thread_small:
      return "thread_small";
    case SizeClass::trivial:
      return "trivial";
  }
  return "?";
}

}  // namespace

Engine::Engine(DeviceApi& api, const ClassRules& rules) : api_(api), rules_(rules), timer_(api), plan_{} {
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

template <class Real>
void Engine::queue_plan(const SolveRequest<Real>& request) {
  const PlanArgs args{request.batch,
                      plan_,
                      reserved_.capacity.env_rows,
                      reserved_.capacity.env_dofs,
                      reserved_.capacity.env_nonzeros,
                      may_be_sparse(reserved_.capacity),
                      limits_for(request.options.solver, request.batch)};
  const PlanKernels& kernels = api_.kernels().plan;
  const StreamHandle stream = request.stream.handle();
  api_.launch(kernels.inspect, {request.batch.env_count, kPlanLanes}, &args, stream);
  const SortArgs sort{request.batch.env_count, plan_, 0, {}, nullptr, {}};
  api_.launch(kernels.sort, sort_, &sort, stream);
  if (may_be_sparse(reserved_.capacity)) api_.launch(kernels.color, graph_, &args, stream);
}

template <class Real>
void Engine::queue_trivial(const SolveRequest<Real>& request, const SolveJob<Real>& job, int lane,
                           StreamHandle stream) {
  // An environment without anything to solve is answered in the name of the first stage.
  const SolverKind solver =
      request.options.solver == SolverKind::automatic ? fallback_stage(0).solver : request.options.solver;
  const WorkQueue<Real> queue{plan_.order, plan_.class_begin, plan_.work_counter, SizeClass::trivial, nullptr, 0};
  const TrivialArgs<Real> args{job, queue, plan_.flags, solver};
  const KernelRef& kernel = api_.kernels().trivial[static_cast<std::size_t>(kPrecisionOf<Real>)];
  const LaunchShape& shape = shapes_of(solver)[static_cast<std::size_t>(SizeClass::trivial)].launch;
  timer_.time(name_of(SizeClass::trivial), kernel.name, lane, stream,
              [&] { api_.launch(kernel, shape, &args, stream); });
}

/// Returns true if environments of a class can come to a solver.
bool Engine::has_class(SolverKind solver, SizeClass size_class) const {
  return shapes_of(solver)[static_cast<std::size_t>(size_class)].launch.teams > 0;
}

/// The kernel that solves a class of environments, of which no trivial one is.
const KernelRef& Engine::kernel_of(SolverKind solver, SizeClass size_class, Precision precision, Law law) const {
  const SolveKernels& kernels =
      api_.kernels().solvers[static_cast<std::size_t>(solver)].by_precision_and_law[static_cast<std::size_t>(precision)]
                                                                                   [static_cast<std::size_t>(law)];
  if (is_thread_per_env(size_class)) return kernels.bundles;
  if (is_sparse(size_class)) return kernels.sparse;
  return size_class == SizeClass::factor_warp ? kernels.factor : kernels.dense;
}

template <class Real>
void Engine::queue_class(const SolveRequest<Real>& request, const SolveJob<Real>& job, SolverKind solver,
                         SizeClass size_class, int lane, StreamHandle stream) {
  const ClassShape& shape = shapes_of(solver)[static_cast<std::size_t>(size_class)];
  const auto precision = static_cast<std::size_t>(kPrecisionOf<Real>);
  const KernelRef& kernel = kernel_of(solver, size_class, kPrecisionOf<Real>, request.law);
  const QueuedJob<Real> args{
      job,
      {plan_.order, plan_.class_begin, plan_.work_counter, size_class,
       shape.shared ? nullptr : reinterpret_cast<Real*>(shape.workspace), shape.slot_elements[precision]}};
  timer_.time(name_of(size_class), kernel.name, lane, stream,
              [&] { api_.launch(kernel, shape.launch, &args, stream); });
}

/// Classes on branches of their own, so that a small one fills what a large one leaves idle at its end.
template <class Real>
void Engine::queue_classes(const SolveRequest<Real>& request, const SolveJob<Real>& job, SolverKind solver,
                           const ClassLimits& limits, bool with_trivial) {
  const StreamHandle stream = request.stream.handle();
  api_.record(forked_->get(), stream);
  for (const auto& branch : branch_) api_.wait(branch->get(), forked_->get());
  int next = 0;
  for (int k = 0; k < kSizeClasses; ++k) {
    const auto size_class = static_cast<SizeClass>(k);
    if (!has_class(solver, size_class) || (size_class == SizeClass::trivial && !with_trivial)) continue;
    if (is_dense(size_class) && !limits.holds(size_class)) continue;
    if (is_dense(size_class) && reserved_.capacity.env_rows <= limits.below(size_class)) continue;
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

/// Queues the fallback chain (docs/math/auto.md): each stage restarts its environments from the current answer. The
/// device decides which environments a stage gets.
template <class Real>
void Engine::queue_fallbacks(const SolveRequest<Real>& request, SolveJob<Real> job) {
  const StreamHandle stream = request.stream.handle();
  const KernelRef& choose = api_.kernels().choose[static_cast<std::size_t>(kPrecisionOf<Real>)];
  const Offset envs = request.batch.env_count;
  const Real omega = job.omega;
  job.stage = 0;
  queue_trivial(request, job, 0, stream);
  for (int turn = 0; turn < kFallbackTurns; ++turn) {
    if (!may_take(turn)) continue;
    const FallbackTurn own = fallback_turn(turn);
    const ClassLimits limits = limits_of_turn(turn, envs);
    const ChooseArgs<Real> chosen{job, plan_, chain_, limits};
    const SortArgs sort{envs, plan_, turn, chain_, job.status, limits};
    timer_.time("choose", to_string(own.solver), 0, stream, [&] {
      if (turn == 0) api_.launch(choose, {envs, kPlanLanes}, &chosen, stream);
      api_.launch(api_.kernels().plan.sort, sort_, &sort, stream);
    });
    job.warm_start = job.lambda;
    job.stage = own.stage;
    job.omega = omega * static_cast<Real>(own.omega);
    queue_classes(request, job, own.solver, limits, false);
  }
}

template <class Real>
void Engine::queue_solve(const SolveRequest<Real>& request, bool is_planned) {
  const StreamHandle stream = request.stream.handle();
  const bool capturing = api_.capturing(stream);
  if (capturing) count_captured_call();
  captured_ = captured_ || capturing;
  // The arrays are one set: a solve waits for the one before, whatever stream that was on. A graph's solves are ordered
  // where the graph is launched.
  if (!capturing) api_.wait(stream, done_->get());
  timer_.attach(request.options.tracer, capturing);
  if (is_planned)
    api_.fill_zero(plan_.work_counter, kSizeClasses * sizeof(Offset), stream);
  else
    timer_.time("plan", nullptr, 0, stream, [&] { queue_plan(request); });

  const SolverOptions& options = request.options;
  const bool is_ladder = options.solver == SolverKind::automatic;
  const SolveJob<Real> job{request.batch,
                           plan_.view(),
                           request.warm_start,
                           request.solution.lambda,
                           request.solution.w,
                           request.solution.status,
                           options.tolerance,
                           options.max_iterations,
                           options.stall_window,
                           static_cast<Real>(options.omega),
                           request.law,
                           -1,
                           options.absolute_tolerance};
  if (is_ladder)
    queue_fallbacks(request, job);
  else
    queue_classes(request, job, options.solver, limits_for(options.solver, request.batch), true);
  if (!capturing) api_.record(done_->get(), stream);
}

template <class Real>
void Engine::solve(const SolveRequest<Real>& request, bool is_planned) {
  if (request.batch.env_count == 0) return;
  try {
    queue_solve(request, is_planned);
  } catch (const Error&) {
    // Whatever was queued before the failure must not run on while the caller takes its memory back.
    finish(request.stream.handle());
    throw;
  }
}

void Engine::islands(const BatchStructure& batch, Index* island, Index* count, StreamHandle stream) {
  if (batch.env_count == 0) return;
  const bool capturing = api_.capturing(stream);
  if (capturing) count_captured_call();
  captured_ = captured_ || capturing;
  if (!capturing) api_.wait(stream, done_->get());
  const IslandArgs args{
      batch,           island, count, reserved_.capacity.env_rows, reserved_.capacity.env_nonzeros, plan_.graph_scratch,
      plan_.graph_slot};
  api_.launch(api_.kernels().plan.islands, graph_, &args, stream);
  if (!capturing) api_.record(done_->get(), stream);
}

template void Engine::solve(const SolveRequest<float>&, bool);
template void Engine::solve(const SolveRequest<double>&, bool);

}  // namespace stiction::cuda
