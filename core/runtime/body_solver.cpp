#include <cmath>
#include <string>

#include "core/runtime/body_backend.hpp"
#include "core/runtime/check_options.hpp"
#include "core/runtime/defects.hpp"
#include "stiction/error.hpp"

namespace stiction {

namespace {

[[noreturn]] void fail(const std::string& message) {
  throw Error(ErrorCode::invalid_argument, message);
}

void reject(const std::vector<Defect>& defects) {
  if (!defects.empty()) fail(defects.front().message);
}

void check_stepping(const TimeStepping& stepping) {
  const auto at_least = [](const char* name, double value, bool holds, const char* rule) {
    if (!holds || !std::isfinite(value)) fail(std::string(name) + " = " + shortest_text(value) + ": must be " + rule);
  };
  at_least("dt", stepping.dt, stepping.dt > 0, "finite and > 0");
  at_least("erp", stepping.erp, stepping.erp >= 0 && stepping.erp <= 1, "in [0, 1]");
  at_least("slop", stepping.slop, stepping.slop >= 0, "finite and >= 0");
  at_least("cfm", stepping.cfm, stepping.cfm >= 0, "finite and >= 0");
  at_least("restitution_threshold", stepping.restitution_threshold, stepping.restitution_threshold >= 0,
           "finite and >= 0");
}

/// Sweeps of a step that EnvStatus can count.
constexpr Offset kMostSweeps = 1'000'000'000;

void check_body_options(const BodySolverOptions& options) {
  SolverOptions common;
  common.tolerance = options.tolerance;
  common.omega = options.omega;
  common.threads = options.threads;
  check_options(common);
  if (options.iterations < 0) fail("iterations = " + std::to_string(options.iterations) + ": must be >= 0");
  if (options.substeps < 1)
    fail("substeps = " + std::to_string(options.substeps) + ": must be >= 1 (1 takes the step in one piece)");
  if (Offset{options.substeps} * options.iterations > kMostSweeps)
    fail("substeps * iterations = " + std::to_string(Offset{options.substeps} * options.iterations) +
         ": must be at most " + std::to_string(kMostSweeps) + ", which a status can count");
  if (options.max_contacts_per_env < 0)
    fail("max_contacts_per_env = " + std::to_string(options.max_contacts_per_env) + ": must be >= 0 (0: no limit)");
}

template <class Real>
void check_solution(const BodyBatchView<Real>& batch, const BodySolutionView<Real>& solution) {
  const auto need = [](bool present, Offset count, const char* name, const char* what) {
    if (count > 0 && !present)
      fail(std::string("solution.") + name + " is null: give it room for " + what + " (" + std::to_string(count) + ")");
  };
  need(solution.status != nullptr, batch.env_count, "status", "one EnvStatus per environment");
  need(solution.impulse != nullptr, 3 * batch.contact_count, "impulse", "three numbers per contact");
  need(solution.twist != nullptr, 6 * batch.body_count, "twist", "six numbers per body");
}

void on_host(MemorySpace space) {
  if (space != MemorySpace::host)
    throw Error(ErrorCode::unsupported,
                "batch.space is cuda: bodies are solved on the CPU; copy the batch to the host");
}

}  // namespace

Index BodyPlan::color_count(Offset env) const {
  if (env < 0 || env >= data_->env_count())
    fail("env = " + std::to_string(env) + ": expected an environment in 0.." + std::to_string(data_->env_count() - 1));
  return data_->color_count[static_cast<std::size_t>(env)];
}

BodySolver::BodySolver(Device device, const TimeStepping& stepping, const BodySolverOptions& options)
    : stepping_(stepping), options_(options) {
  check_stepping(stepping);
  check_body_options(options);
  if (device.kind != DeviceKind::cpu)
    throw Error(ErrorCode::unsupported, "device is cuda: bodies are solved on the CPU; use Device::cpu()");
}

template <class Real>
BodyPlan BodySolver::plan(const BodyBatchView<Real>& batch) const {
  on_host(batch.space);
  reject(validate_structure(batch, 1));
  return BodyPlan(std::make_shared<const BodyPlanData>(make_body_plan(batch, options_.max_contacts_per_env)));
}

template <class Real>
void BodySolver::solve(const BodyPlan& plan, const BodyBatchView<Real>& batch, const BodySolutionView<Real>& solution,
                       const Real* warm_start) const {
  on_host(batch.space);
  if (!fits(plan.data(), batch))
    fail("plan was made for other bodies or contacts than the batch's: make a new plan when they change");
  check_solution(batch, solution);
  if (options_.invalid == InvalidPolicy::reject) reject(validate(batch, 1));
  solve_bodies_on_cpu(BodyRequest<Real>{plan.data(), batch, solution, warm_start, stepping_, options_});
}

template <class Real>
BodySolution<Real> solve_bodies(const BodyBatch<Real>& batch, const TimeStepping& stepping,
                                const BodySolverOptions& options, Device device, std::span<const Real> warm_start) {
  const auto contacts = static_cast<std::size_t>(batch.contact_count());
  if (!warm_start.empty() && warm_start.size() != 3 * contacts)
    fail("warm_start has " + std::to_string(warm_start.size()) + " numbers, the batch has " + std::to_string(contacts) +
         " contacts: give three numbers per contact, or none");
  const BodySolver solver(device, stepping, options);
  BodySolution<Real> solution{
      std::vector<Real>(3 * contacts), std::vector<Real>(6 * static_cast<std::size_t>(batch.body_count())),
      std::vector<Real>(3 * contacts), std::vector<EnvStatus>(static_cast<std::size_t>(batch.env_count()))};
  const BodyBatchView<Real> view = batch.view();
  solver.solve(solver.plan(view), view,
               {solution.impulse.data(), solution.twist.data(), solution.w.data(), solution.status.data()},
               warm_start.empty() ? nullptr : warm_start.data());
  return solution;
}

template BodyPlan BodySolver::plan(const BodyBatchView<float>&) const;
template BodyPlan BodySolver::plan(const BodyBatchView<double>&) const;
template void BodySolver::solve(const BodyPlan&, const BodyBatchView<float>&, const BodySolutionView<float>&,
                                const float*) const;
template void BodySolver::solve(const BodyPlan&, const BodyBatchView<double>&, const BodySolutionView<double>&,
                                const double*) const;
template BodySolution<float> solve_bodies(const BodyBatch<float>&, const TimeStepping&, const BodySolverOptions&,
                                          Device, std::span<const float>);
template BodySolution<double> solve_bodies(const BodyBatch<double>&, const TimeStepping&, const BodySolverOptions&,
                                           Device, std::span<const double>);

}  // namespace stiction
