#include <cmath>
#include <functional>
#include <string>

#include "core/base/fp_env.hpp"
#include "core/facade/overlap.hpp"
#include "core/machine/body_machine.hpp"
#include "core/plan/newton_plan.hpp"
#include "core/runtime/check/check_options.hpp"
#include "core/runtime/check/defects.hpp"
#include "core/runtime/check/expect.hpp"

namespace stiction {

namespace {

void reject(const std::vector<Defect>& defects) {
  if (!defects.empty()) refuse(defects.front().message);
}

void check_stepping(const TimeStepping& stepping) {
  const auto at_least = [](const char* name, double value, bool holds, const char* rule) {
    if (!holds || !std::isfinite(value)) refuse(std::string(name) + " = " + shortest_text(value) + ": must be " + rule);
  };
  at_least("dt", stepping.dt, stepping.dt > 0, "finite and > 0");
  at_least("erp", stepping.erp, stepping.erp >= 0 && stepping.erp <= 1, "in [0, 1]");
  at_least("slop", stepping.slop, stepping.slop >= 0, "finite and >= 0");
  at_least("cfm", stepping.cfm, stepping.cfm >= 0, "finite and >= 0");
  at_least("restitution_threshold", stepping.restitution_threshold, stepping.restitution_threshold >= 0,
           "finite and >= 0");
}

/// Work on a batch on the host, among the threads that its solve may use.
ParallelFor sharing(BodyMachine& machine, const BodySolverOptions& options) {
  return [&machine, threads = options.threads](Offset count, const std::function<void(Offset, Offset)>& work) {
    machine.parallel_for(threads, count, work);
  };
}

/// Returns true if a batch is refused for its numbers, which are looked at together with its structure.
bool looks_at_numbers(const BodySolverOptions& options, MemorySpace space) {
  return options.invalid == InvalidPolicy::reject && space == MemorySpace::host;
}

/// `is_used`: a plan will be made with them, for which an ordering's library has to be there.
void check_space_options(const BodySpaceOptions& space, bool is_used) {
  if (static_cast<int>(space.preconditioner) >= kBodyPreconditionerCount)
    refuse("space.preconditioner = " + std::to_string(static_cast<int>(space.preconditioner)) +
           ": no such preconditioner; use one of BodyPreconditioner");
  if (space.multigrid.prolongation != Prolongation::plain && space.multigrid.prolongation != Prolongation::smoothed)
    refuse("space.multigrid.prolongation = " + std::to_string(static_cast<int>(space.multigrid.prolongation)) +
           ": no such prolongation; use Prolongation::plain or smoothed");
  if (space.multigrid.cycle != Cycle::v && space.multigrid.cycle != Cycle::w)
    refuse("space.multigrid.cycle = " + std::to_string(static_cast<int>(space.multigrid.cycle)) +
           ": no such cycle; use Cycle::v or w");
  if (static_cast<int>(space.ordering) >= kOrderingCount)
    refuse("space.ordering = " + std::to_string(static_cast<int>(space.ordering)) +
           ": no such ordering; use one of Ordering");
  const bool orders = space.preconditioner == BodyPreconditioner::incomplete_cholesky ||
                      space.preconditioner == BodyPreconditioner::factor;
  if (is_used && orders && !is_available(space.ordering))
    throw Error(ErrorCode::unsupported, std::string("space.ordering = ") + to_string(space.ordering) +
                                            ": this build lacks its library; use reverse_cuthill_mckee, which every "
                                            "build has");
}

/// Sweeps that do not wait are of threads, and converge for convex problems alone.
void check_asynchronous(const BodySolverOptions& options, Device device) {
  if (!options.asynchronous) return;
  const auto refuse_with = [](const std::string& why) {
    throw Error(ErrorCode::unsupported, "asynchronous = true with " + why + ", or asynchronous = false");
  };
  if (device.kind != DeviceKind::cpu) refuse_with("a GPU: its lanes wait for colours; choose Device::cpu()");
  if (options.method != BodyMethod::impulses)
    refuse_with("method = newton: only sweeps can do without waiting; choose BodyMethod::impulses");
  if (options.box_friction || options.law != Law::convex)
    refuse_with((options.box_friction ? "box_friction = true" : "law = coulomb") +
                std::string(": such sweeps converge for convex problems alone; choose Law::convex"));
  if (options.substeps != 1)
    refuse_with("substeps = " + std::to_string(options.substeps) + ": their sweeps are of fixed number; choose 1");
}

/// Blocks are of contacts between two bodies: there is no A to read, and Newton's method visits nothing.
void check_blocks(const BodySolverOptions& options) {
  if (options.blocks == BlockMode::cones) return;
  if (options.blocks != BlockMode::pairs && options.blocks != BlockMode::strong)
    refuse("blocks = " + std::to_string(static_cast<int>(options.blocks)) +
           ": no such mode; use BlockMode::cones or pairs");
  const std::string blocks = std::string("blocks = ") + to_string(options.blocks);
  if (options.blocks == BlockMode::strong)
    throw Error(ErrorCode::unsupported, blocks + ": it reads numbers of A, and bodies have none; choose pairs");
  if (options.method != BodyMethod::impulses)
    throw Error(ErrorCode::unsupported, blocks +
                                            " with method = newton: blocks are of sweeps; choose "
                                            "BodyMethod::impulses, or leave blocks = cones");
}

/// Sweeps of a step that EnvStatus can count.
constexpr Offset kMostSweeps = 1'000'000'000;

void check_body_options(const BodySolverOptions& options) {
  SolverOptions common;
  common.tolerance = options.tolerance;
  common.absolute_tolerance = options.absolute_tolerance;
  common.omega = options.omega;
  common.threads = options.threads;
  check_options(common);
  if (options.iterations < 0) refuse("iterations = " + std::to_string(options.iterations) + ": must be >= 0");
  if (options.substeps < 1)
    refuse("substeps = " + std::to_string(options.substeps) + ": must be >= 1 (1 takes the step in one piece)");
  if (Offset{options.substeps} * options.iterations > kMostSweeps)
    refuse("substeps * iterations = " + std::to_string(Offset{options.substeps} * options.iterations) +
           ": must be at most " + std::to_string(kMostSweeps) + ", which a status can count");
  if (options.method != BodyMethod::impulses && options.method != BodyMethod::newton)
    refuse("method = " + std::to_string(static_cast<int>(options.method)) +
           ": no such method; use BodyMethod::impulses or newton");
  if (options.law != Law::convex && options.law != Law::coulomb)
    refuse("law = " + std::to_string(static_cast<int>(options.law)) +
           ": no such law; use Law::convex or coulomb, or box_friction = true");
  if (options.box_friction && options.method == BodyMethod::newton)
    throw Error(ErrorCode::unsupported,
                "method = newton with box_friction = true: Newton's method has no boxed friction; use sequential "
                "impulses (method = impulses, solver si), or friction cones (box_friction = false)");
  check_space_options(options.space, options.method == BodyMethod::newton);
  check_blocks(options);
  if (options.max_contacts_per_env < 0)
    refuse("max_contacts_per_env = " + std::to_string(options.max_contacts_per_env) + ": must be >= 0 (0: no limit)");
}

template <class Real>
void check_solution(const BodyBatchView<Real>& batch, const BodySolutionView<Real>& solution, const Real* warm_start) {
  const auto need = [](bool present, Offset count, const char* name, const char* what) {
    if (count > 0 && !present)
      refuse(std::string("solution.") + name + " is null: give it room for " + what + " (" + std::to_string(count) +
             ")");
  };
  need(solution.status != nullptr, batch.env_count, "status", "one EnvStatus per environment");
  need(solution.impulse != nullptr, 3 * batch.contact_count, "impulse", "three numbers per contact");
  need(solution.twist != nullptr, 6 * batch.body_count, "twist", "six numbers per body");
  refuse_overlaps(batch, solution, warm_start);
}

template <class Real>
void check_arrays(const BodyBatchView<Real>& batch) {
  if (const char* name = missing_array(batch); name != nullptr)
    refuse(std::string(name) + " is null; point it to the batch's array");
}

std::unique_ptr<BodyMachine> make_machine(Device device) {
  if (device.kind == DeviceKind::cuda) return make_cuda_body_machine(device.ordinal);
  if (device.kind == DeviceKind::emulated) return make_emulated_body_machine();
  return make_cpu_body_machine();
}

/// The structure of a batch in device memory, on the host: the input of a plan.
template <class Real>
class HostBodies {
 public:
  HostBodies(const BodyBatchView<Real>& batch, bool with_depth, BodyMachine& machine, StreamRef stream) : view_(batch) {
    const auto fetch = [&](auto*& pointer, auto& array, Offset count) {
      if (pointer == nullptr) return;
      array.resize(static_cast<std::size_t>(count));
      machine.copy_to_host(array.data(), pointer, array.size() * sizeof(*pointer), stream);
      pointer = array.data();
    };
    fetch(view_.env_body_offsets, env_body_offsets_, batch.env_count + 1);
    fetch(view_.env_contact_offsets, env_contact_offsets_, batch.env_count + 1);
    fetch(view_.body_a, body_a_, batch.contact_count);
    fetch(view_.body_b, body_b_, batch.contact_count);
    fetch(view_.kinematic, kinematic_, batch.body_count);
    if (with_depth) fetch(view_.depth, depth_, batch.contact_count);
    view_.space = MemorySpace::host;
  }
  [[nodiscard]] const BodyBatchView<Real>& view() const { return view_; }

 private:
  BodyBatchView<Real> view_;
  std::vector<Offset> env_body_offsets_, env_contact_offsets_;
  std::vector<Index> body_a_, body_b_;
  std::vector<std::uint8_t> kinematic_;
  std::vector<Real> depth_;
};

}  // namespace

Index BodyPlan::color_count(Offset env) const {
  if (env < 0 || env >= data_->env_count())
    refuse("env = " + std::to_string(env) + ": expected an environment in 0.." +
           std::to_string(data_->env_count() - 1));
  return data_->color_count[static_cast<std::size_t>(env)];
}

BodySolver::BodySolver(Device device, const TimeStepping& stepping, const BodySolverOptions& options)
    : device_(device), stepping_(stepping), options_(options) {
  const ScopedFpEnv fp_env;
  check_stepping(stepping);
  check_body_options(options);
  check_asynchronous(options, device);
  machine_ = make_machine(device);
}
BodySolver::~BodySolver() = default;
BodySolver::BodySolver(BodySolver&&) noexcept = default;
BodySolver& BodySolver::operator=(BodySolver&&) noexcept = default;

template <class Real>
void BodySolver::check_space(const BodyBatchView<Real>& batch) const {
  if (batch.space != MemorySpace::host && device_.kind == DeviceKind::cpu)
    refuse("batch.space is cuda but the solver's device is cpu: copy the batch to the host or solve on the GPU");
}

template <class Real>
BodyPlan BodySolver::make_plan(const BodyBatchView<Real>& host) const {
  BodyPlanData plan = make_body_plan(host, options_.max_contacts_per_env, sharing(*machine_, options_));
  if (options_.method == BodyMethod::newton) add_newton_plan(plan, options_.space);
  return BodyPlan(std::make_shared<const BodyPlanData>(std::move(plan)));
}

template <class Real>
BodyPlan BodySolver::plan(const BodyBatchView<Real>& batch, StreamRef stream) const {
  const ScopedFpEnv fp_env;
  check_space(batch);
  const auto make = [&](const BodyBatchView<Real>& host) {
    if (options_.max_contacts_per_env > 0 && host.contact_count > 0 && host.depth == nullptr)
      refuse("depth is null; max_contacts_per_env keeps the deepest contacts: point it to the batch's array");
    reject(validate_structure(host, 1, sharing(*machine_, options_)));
    return make_plan(host);
  };
  if (batch.space == MemorySpace::host) return make(batch);
  return make(HostBodies<Real>(batch, options_.max_contacts_per_env > 0, *machine_, stream).view());
}

template <class Real>
void BodySolver::check(const BodyPlan& plan, const BodyBatchView<Real>& batch, const BodySolutionView<Real>& solution,
                       const Real* warm_start) const {
  const ScopedFpEnv fp_env;
  check_space(batch);
  check_arrays(batch);
  const BodyPlanData& data = plan.data();
  // The caller may have written to any array since the plan was made. Nothing is hence read through one that was not
  // looked at in this call.
  const bool is_looked_at = looks_at_numbers(options_, batch.space);
  std::vector<Defect> defects;
  if (is_looked_at) {
    defects = validate(batch, 1, sharing(*machine_, options_));
  } else if (batch.space == MemorySpace::host) {
    defects = validate_structure(batch, 1, sharing(*machine_, options_));
  }
  if (!defects.empty() && defects.front().structural) reject(defects);
  const bool fitting = batch.space == MemorySpace::host
                           ? fits(data, batch)
                           : data.env_count() == batch.env_count && data.env_body_offsets.back() == batch.body_count &&
                                 data.env_contact_offsets.back() == batch.contact_count;
  if (!fitting) refuse("plan was made for other bodies or contacts than the batch's: make a new plan when they change");
  if (options_.method == BodyMethod::newton && !(data.has_newton && data.space == options_.space))
    refuse("plan was not made for method = newton with these space options: make it by a solver that has them");
  check_solution(batch, solution, warm_start);
  reject(defects);
}

template <class Real>
void BodySolver::check(const BodyPlan& plan, const BodyBatchView<Real>& batch,
                       const BodySolutionView<Real>& solution) const {
  check(plan, batch, solution, static_cast<const Real*>(nullptr));
}

template <class Real>
void BodySolver::solve(const BodyPlan& plan, const BodyBatchView<Real>& batch, const BodySolutionView<Real>& solution,
                       const Real* warm_start, StreamRef stream) const {
  const ScopedFpEnv fp_env;
  check(plan, batch, solution, warm_start);
  machine_->solve(BodyRequest<Real>{plan.shared(), batch, solution, warm_start, stepping_, options_, stream});
}

template <class Real>
void BodySolver::solve(const BodyBatchView<Real>& batch, const BodySolutionView<Real>& solution, const Real* warm_start,
                       StreamRef stream) const {
  const ScopedFpEnv fp_env;
  check_space(batch);
  check_arrays(batch);
  check_solution(batch, solution, warm_start);
  const bool is_looked_at = looks_at_numbers(options_, batch.space);
  if (is_looked_at) reject(validate(batch, 1, sharing(*machine_, options_)));
  const BodyPlan made = is_looked_at ? make_plan(batch) : plan(batch, stream);
  machine_->solve(BodyRequest<Real>{made.shared(), batch, solution, warm_start, stepping_, options_, stream});
}

template <class Real>
BodySolution<Real> solve_bodies(const BodyBatch<Real>& batch, const TimeStepping& stepping,
                                const BodySolverOptions& options, Device device, std::span<const Real> warm_start) {
  const auto contacts = static_cast<std::size_t>(batch.contact_count());
  if (!warm_start.empty() && warm_start.size() != 3 * contacts)
    refuse("warm_start has " + std::to_string(warm_start.size()) + " numbers, the batch has " +
           std::to_string(contacts) + " contacts: give three numbers per contact, or none");
  const BodySolver solver(device, stepping, options);
  BodySolution<Real> solution{
      std::vector<Real>(3 * contacts), std::vector<Real>(6 * static_cast<std::size_t>(batch.body_count())),
      std::vector<Real>(3 * contacts), std::vector<EnvStatus>(static_cast<std::size_t>(batch.env_count()))};
  const BodyBatchView<Real> view = batch.view();
  solver.solve(view, {solution.impulse.data(), solution.twist.data(), solution.w.data(), solution.status.data()},
               warm_start.empty() ? nullptr : warm_start.data());
  return solution;
}

template BodyPlan BodySolver::plan(const BodyBatchView<float>&, StreamRef) const;
template BodyPlan BodySolver::plan(const BodyBatchView<double>&, StreamRef) const;
template void BodySolver::check(const BodyPlan&, const BodyBatchView<float>&, const BodySolutionView<float>&) const;
template void BodySolver::check(const BodyPlan&, const BodyBatchView<double>&, const BodySolutionView<double>&) const;
template void BodySolver::solve(const BodyPlan&, const BodyBatchView<float>&, const BodySolutionView<float>&,
                                const float*, StreamRef) const;
template void BodySolver::solve(const BodyPlan&, const BodyBatchView<double>&, const BodySolutionView<double>&,
                                const double*, StreamRef) const;
template void BodySolver::solve(const BodyBatchView<float>&, const BodySolutionView<float>&, const float*,
                                StreamRef) const;
template void BodySolver::solve(const BodyBatchView<double>&, const BodySolutionView<double>&, const double*,
                                StreamRef) const;
template BodySolution<float> solve_bodies(const BodyBatch<float>&, const TimeStepping&, const BodySolverOptions&,
                                          Device, std::span<const float>);
template BodySolution<double> solve_bodies(const BodyBatch<double>&, const TimeStepping&, const BodySolverOptions&,
                                           Device, std::span<const double>);

}  // namespace stiction
