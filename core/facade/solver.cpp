#include "stiction/solver.hpp"

#include <algorithm>
#include <string>

#include "core/base/extents.hpp"
#include "core/base/fp_env.hpp"
#include "core/facade/batch_in_blocks.hpp"
#include "core/facade/broken_columns.hpp"
#include "core/facade/env_subset.hpp"
#include "core/facade/host_copy.hpp"
#include "core/facade/overlap.hpp"
#include "core/facade/spectrum_classes.hpp"
#include "core/machine/contact_machine.hpp"
#include "core/plan/islands.hpp"
#include "core/plan/plan.hpp"
#include "core/runtime/batch/island_split.hpp"
#include "core/runtime/check/check_options.hpp"
#include "core/runtime/check/defects.hpp"
#include "core/runtime/check/expect.hpp"
#include "stiction/trace.hpp"

namespace stiction {

namespace {

void reject(const std::vector<Defect>& defects) {
  if (!defects.empty()) refuse(defects.front().message);
}

/// A batch in device memory is out of sight: there the environment is flagged kFlagUnsupportedCone.
template <class Real>
void check_matrices(const ContactBatchView<Real>& batch, SolverKind solver) {
  if (solver == SolverKind::automatic || solver == SolverKind::jacobi || solver == SolverKind::apgd ||
      solver == SolverKind::admm)
    return;
  for (Offset env = 0; env < batch.env_count; ++env) {
    const ConeKind* const kinds = batch.cone_kind + batch.env_cone_offsets[env];
    const ConeKind* const end = kinds + batch.env_cones(env);
    const ConeKind* const found = std::find(kinds, end, ConeKind::semidefinite);
    if (found == end) continue;
    throw Error(ErrorCode::unsupported,
                "options.solver is " + std::string(to_string(solver)) + ", but cone_kind[env " + std::to_string(env) +
                    ", cone " + std::to_string(found - kinds) +
                    "] is semidefinite, which only methods that project take: choose jacobi, apgd, admm or auto");
  }
}

void check_space(MemorySpace space, Device device) {
  if (space == MemorySpace::cuda && device.kind == DeviceKind::cpu)
    refuse("batch.space is cuda but the solver's device is cpu: copy the batch to the host or solve on the GPU");
}

std::unique_ptr<ContactMachine> make_machine(Device device) {
  switch (device.kind) {
    case DeviceKind::cpu:
      return make_cpu_contact_machine();
    case DeviceKind::cuda:
      return make_cuda_contact_machine(device.ordinal);
    case DeviceKind::emulated:
      return make_emulated_contact_machine();
  }
  refuse("device.kind " + std::to_string(static_cast<int>(device.kind)) + " is not known: use Device::cpu() or cuda()");
}

template <class Real>
void check_solution(const ContactBatchView<Real>& batch, const SolutionView<Real>& solution) {
  if (batch.env_count > 0 && solution.status == nullptr)
    refuse("solution.status is null: give it room for one EnvStatus per environment (" +
           std::to_string(batch.env_count) + ")");
  if (batch.row_count > 0 && solution.lambda == nullptr)
    refuse("solution.lambda is null: give it room for one number per row (" + std::to_string(batch.row_count) + ")");
}

/// Arrays are read whatever the InvalidPolicy of their values.
template <class Real>
void check_arrays(const ContactBatchView<Real>& batch) {
  if (const char* name = missing_array(batch); name != nullptr)
    refuse(std::string(name) + " is null; point it to the batch's array");
}

/// A device batch is queued now and solved later.
template <class Real>
const char* solve_span(const ContactBatchView<Real>& batch) {
  return batch.space == MemorySpace::host ? "solve" : "queue";
}

/// Work on a batch on the host, among the threads that its solve may use.
ParallelFor sharing(ContactMachine& machine, const SolverOptions& options) {
  return [&machine, threads = options.threads](Offset count, const std::function<void(Offset, Offset)>& work) {
    machine.parallel_for(threads, count, work);
  };
}

template <class Real>
PlanData traced_plan(const ContactBatchView<Real>& batch, const ParallelFor& parallel_for, Tracer* tracer) {
  const ScopedSpan span(tracer, "plan", nullptr, 0, batch.env_count);
  return make_plan(batch, parallel_for);
}

}  // namespace

Solver::Solver(Device device, const SolverOptions& options, const Capacity& capacity)
    : device_(device), options_(options) {
  const ScopedFpEnv fp_env;
  check_options(options);
  if (options.direct_rows != SolverOptions{}.direct_rows && device.kind != DeviceKind::cpu)
    throw Error(ErrorCode::invalid_argument, "direct_rows = " + std::to_string(options.direct_rows) +
                                                 ": a device's memory is laid out for matrices of up to " +
                                                 std::to_string(SolverOptions{}.direct_rows) +
                                                 " rows; use Device::cpu(), or leave direct_rows as it is");
  // Numbers are checked for all that auto may take.
  if (options.choose == SolverChoice::spectrum) {
    options_.solver = SolverKind::automatic;
    kept_ = std::make_shared<KeptClasses>();
  }
  machine_ = make_machine(device);
  if (capacity.envs > 0) machine_->reserve(capacity, options_.solver);
}
Solver::~Solver() = default;
Solver::Solver(Solver&&) noexcept = default;
Solver& Solver::operator=(Solver&&) noexcept = default;

template <class Real>
Plan Solver::plan(const ContactBatchView<Real>& batch, StreamRef stream) const {
  const ScopedFpEnv fp_env;
  const ScopedSpan span(options_.tracer, "plan", nullptr, 0, batch.env_count);
  if (batch.space == MemorySpace::host) {
    const ParallelFor parallel_for = sharing(*machine_, options_);
    reject(validate_structure(batch, 1, parallel_for));
    BatchInBlocks<Real> blocks(batch, options_, nullptr, parallel_for);
    PlanData data = make_plan(blocks.view(), parallel_for);
    data.block_places = std::move(blocks.places());
    return Plan(std::make_shared<const PlanData>(std::move(data)));
  }
  check_space(batch.space, device_);
  const HostCopy<Real> host(batch, false, *machine_, stream);
  reject(validate_structure(host.view(), 1));
  return Plan(std::make_shared<const PlanData>(make_plan(host.view())));
}

template <class Real>
void Solver::solve(const Plan& plan, const ContactBatchView<Real>& batch, const SolutionView<Real>& solution,
                   const Real* warm_start, StreamRef stream) const {
  const ScopedFpEnv fp_env;
  const ScopedSpan span(options_.tracer, solve_span(batch), nullptr, 0, batch.env_count);
  const PlanData& data = plan.data();
  const bool same_size = data.env_count == batch.env_count && data.cone_count == batch.cone_count &&
                         data.row_count == batch.row_count && data.nonzero_count == batch.nonzero_count;
  if (!same_size)
    refuse("plan was made for " + std::to_string(data.env_count) + " environments, " + std::to_string(data.row_count) +
           " rows and " + std::to_string(data.nonzero_count) + " entries, the batch has " +
           std::to_string(batch.env_count) + ", " + std::to_string(batch.row_count) + " and " +
           std::to_string(batch.nonzero_count) + ": make a new plan when the structure changes");
  if (batch.space != MemorySpace::host) {
    check_request(batch, solution, warm_start);
    dispatch(&data, batch, solution, warm_start, stream, nullptr);
    return;
  }
  // The caller may have written to any array since the plan was made. Nothing is hence read through one that was not
  // looked at in this call.
  const ParallelFor parallel_for = sharing(*machine_, options_);
  std::vector<FullRows> full_rows;
  std::vector<Defect> defects = options_.invalid == InvalidPolicy::reject
                                    ? validate(batch, 1, options_.solver, parallel_for, full_rows)
                                    : validate_structure(batch, 1, parallel_for, &full_rows);
  std::optional<BrokenColumns<Real>> isolated;
  if (!defects.empty() && defects.front().structural) {
    if (options_.invalid == InvalidPolicy::reject) reject(defects);
    reject(validate_offsets(batch, 1));
    isolated.emplace(batch);
    defects = validate_structure(isolated->view(), 1, parallel_for, &full_rows);
    reject(defects);
  }
  const ContactBatchView<Real> sound = with_block_visits(isolated ? isolated->view() : batch, options_);
  require_plan_of_blocks(data, options_);
  if (!fits(data, sound, parallel_for))
    refuse(
        "plan was made for environments of other sizes or cones than the batch's, though the totals agree: make a new "
        "plan when the structure changes");
  check_request(batch, solution, warm_start);
  reject(defects);
  dispatch(&data, sound, solution, warm_start, stream, full_rows.empty() ? nullptr : &full_rows);
}

template <class Real>
void Solver::solve(const ContactBatchView<Real>& batch, const SolutionView<Real>& solution, const Real* warm_start,
                   StreamRef stream) const {
  const ScopedFpEnv fp_env;
  const ScopedSpan span(options_.tracer, solve_span(batch), nullptr, 0, batch.env_count);
  std::vector<FullRows> full_rows;
  check(batch, solution, warm_start, full_rows);
  dispatch(nullptr, batch, solution, warm_start, stream, full_rows.empty() ? nullptr : &full_rows);
}

/// Solves a batch that was checked: as a whole, or each environment by the solver that its spectrum calls for.
template <class Real>
void Solver::dispatch(const PlanData* plan, const ContactBatchView<Real>& batch, const SolutionView<Real>& solution,
                      const Real* warm_start, StreamRef stream, const std::vector<FullRows>* full_rows) const {
  if (options_.choose == SolverChoice::spectrum)
    solve_by_spectrum(batch, solution, warm_start, stream);
  else
    solve_islands(options_, plan, batch, solution, warm_start, stream, full_rows);
}

/// Environments of a class are a batch of their own, and auto gets the unsolved ones. Answers are written when all are
/// there: a solve that throws has written none.
template <class Real>
void Solver::solve_by_spectrum(const ContactBatchView<Real>& batch, const SolutionView<Real>& solution,
                               const Real* warm_start, StreamRef stream) const {
  std::optional<ScopedSpan> span(std::in_place, options_.tracer, "spectrum", nullptr, 0, batch.env_count);
  const std::vector<SpectrumClass> found = kept_->of(batch, options_.spectrum, sharing(*machine_, options_));
  span.reset();
  const auto rows = static_cast<std::size_t>(batch.row_count), envs = static_cast<std::size_t>(batch.env_count);
  Solution<Real> own{std::vector<Real>(rows), std::vector<Real>(solution.w != nullptr ? rows : 0),
                     std::vector<EnvStatus>(envs)};
  const SolutionView<Real> answer{own.lambda.data(), solution.w != nullptr ? own.w.data() : nullptr, own.status.data()};
  SolverOptions options = options_;
  const auto solve_where = [&](const auto& is_member, const Real* start) {
    std::vector<Offset> members;
    for (Offset env = 0; env < batch.env_count; ++env)
      if (is_member(static_cast<std::size_t>(env))) members.push_back(env);
    solve_members(options, batch, members, answer, start, stream);
  };
  for (int k = 0; k < kSpectrumClasses; ++k) {
    const auto chosen = static_cast<SpectrumClass>(k);
    options.solver = options_.spectrum.solver_of(chosen);
    options.islands = chosen == SpectrumClass::decomposed ? IslandMode::apart : options_.islands;
    solve_where([&](std::size_t env) { return found[env] == chosen; }, warm_start);
  }
  // Without a tolerance nothing is solved, and all iterations are asked for.
  if (options_.tolerance > 0 || options_.absolute_tolerance > 0) {
    options.solver = SolverKind::automatic;
    options.islands = options_.islands;
    solve_where([&](std::size_t env) { return own.status[env].code != EnvCode::solved; }, answer.lambda);
  }
  write_used_rows(batch, answer, solution);
}

/// Solves some environments.
template <class Real>
void Solver::solve_members(const SolverOptions& options, const ContactBatchView<Real>& batch,
                           std::span<const Offset> members, const SolutionView<Real>& solution, const Real* warm_start,
                           StreamRef stream) const {
  if (members.empty()) return;
  EnvSubset<Real> subset(batch, members, warm_start, solution.w != nullptr);
  solve_islands<Real>(options, nullptr, subset.view(), subset.answer(), subset.warm_start(), stream, nullptr);
  subset.write(solution);
}

/// Solves a batch as it is, or every island by itself.
template <class Real>
void Solver::solve_islands(const SolverOptions& options, const PlanData* plan, const ContactBatchView<Real>& batch,
                           const SolutionView<Real>& solution, const Real* warm_start, StreamRef stream,
                           const std::vector<FullRows>* full_rows) const {
  if (options.islands == IslandMode::together) {
    run(options, plan, batch, solution, warm_start, stream, full_rows);
    return;
  }
  std::optional<ScopedSpan> span(std::in_place, options.tracer, "split", nullptr, 0, batch.env_count);
  IslandSplit<Real> split(batch, warm_start, solution.w != nullptr);
  span.reset();
  if (!split.needed()) {
    run(options, plan, batch, solution, warm_start, stream, full_rows);
    return;
  }
  run<Real>(options, nullptr, split.pieces(), split.answer(), split.warm_start(), stream, nullptr);
  span.emplace(options.tracer, "join", nullptr, 0, batch.env_count);
  split.join(solution);
}

/// Hands a machine its work. A device plans by itself where there is no plan.
template <class Real>
void Solver::run(const SolverOptions& options, const PlanData* plan, const ContactBatchView<Real>& batch,
                 const SolutionView<Real>& solution, const Real* warm_start, StreamRef stream,
                 const std::vector<FullRows>* full_rows) const {
  const ParallelFor parallel_for = sharing(*machine_, options);
  const BatchInBlocks<Real> blocks(batch, options, plan == nullptr ? nullptr : &plan->block_places, parallel_for);
  std::optional<PlanData> made;
  if (plan == nullptr && device_.kind == DeviceKind::cpu)
    plan = &made.emplace(traced_plan(blocks.view(), parallel_for, options.tracer));
  machine_->solve(SolveRequest<Real>{plan, blocks.view(), solution, warm_start, options.law.value_or(batch.law),
                                     options, stream, full_rows});
}

template <class Real>
void Solver::check(const ContactBatchView<Real>& batch, const SolutionView<Real>& solution) const {
  const ScopedFpEnv fp_env;
  std::vector<FullRows> full_rows;
  check(batch, solution, static_cast<const Real*>(nullptr), full_rows);
}

/// Checks a batch, and returns the kind of its rows on the host.
template <class Real>
void Solver::check(const ContactBatchView<Real>& batch, const SolutionView<Real>& solution, const Real* warm_start,
                   std::vector<FullRows>& full_rows) const {
  const bool is_host = batch.space == MemorySpace::host;
  if (!is_host || options_.invalid != InvalidPolicy::reject) {
    if (is_host) reject(validate_structure(batch, 1, sharing(*machine_, options_), &full_rows));
    check_request(batch, solution, warm_start);
    return;
  }
  // One pass finds both; where the answer goes is asked between them, as it is with a plan.
  const std::vector<Defect> defects = validate(batch, 1, options_.solver, sharing(*machine_, options_), full_rows);
  if (!defects.empty() && defects.front().structural) reject(defects);
  check_request(batch, solution, warm_start);
  reject(defects);
}

template <class Real>
std::shared_ptr<Real> Solver::make_array(Offset count) const {
  if (count < 0) refuse("count = " + std::to_string(count) + ": give a number of elements >= 0");
  const std::shared_ptr<ContactMachine> machine = machine_;
  void* const memory = machine->allocate(static_cast<std::size_t>(larger_of<Offset>(count, 1)) * sizeof(Real));
  return {static_cast<Real*>(memory), [machine](Real* array) { machine->release(array); }};
}

template <class Real>
void Solver::islands(const ContactBatchView<Real>& batch, Index* island, Index* count, StreamRef stream) const {
  if (batch.env_count > 0 && count == nullptr)
    refuse("count is null: give it room for one number per environment (" + std::to_string(batch.env_count) + ")");
  if (batch.cone_count > 0 && island == nullptr)
    refuse("island is null: give it room for one number per cone (" + std::to_string(batch.cone_count) + ")");
  if (batch.space == MemorySpace::cuda) {
    check_space(batch.space, device_);
    machine_->islands(batch, island, count, stream);
    return;
  }
  reject(validate_structure(batch, 1));
  const Islands found = find_islands(batch);
  std::copy(found.island.begin(), found.island.end(), island);
  std::copy(found.count.begin(), found.count.end(), count);
}

void Solver::synchronize(StreamRef stream) const {
  machine_->synchronize(stream);
}

/// Checks of both ways of solving: memory of the batch and of its answer.
template <class Real>
void Solver::check_request(const ContactBatchView<Real>& batch, const SolutionView<Real>& solution,
                           const Real* warm_start) const {
  if (batch.space == MemorySpace::host) check_matrices(batch, options_.solver);
  check_arrays(batch);
  check_solution(batch, solution);
  refuse_overlaps(batch, solution, warm_start);
  check_space(batch.space, device_);
  if (options_.islands == IslandMode::apart && batch.space == MemorySpace::cuda)
    throw Error(ErrorCode::unsupported,
                "options.islands is apart and the batch is in device memory, but islands are taken apart on the host: "
                "copy the batch with Solver::to_host, or solve with IslandMode::together");
  if (options_.choose == SolverChoice::spectrum && batch.space == MemorySpace::cuda)
    throw Error(ErrorCode::unsupported,
                "options.choose is spectrum and the batch is in device memory, but spectra are estimated on the host: "
                "copy the batch with Solver::to_host, or solve with solver auto");
}

template <class Real>
Solution<Real> solve(const ContactBatch<Real>& batch, const SolverOptions& options, Device device,
                     std::span<const Real> warm_start) {
  const auto rows = static_cast<std::size_t>(batch.row_count());
  if (!warm_start.empty() && warm_start.size() != rows)
    refuse("warm_start has " + std::to_string(warm_start.size()) + " numbers, the batch has " + std::to_string(rows) +
           " rows: give one number per row, or none");
  const Solver solver(device, options);
  Solution<Real> solution{std::vector<Real>(rows), std::vector<Real>(rows),
                          std::vector<EnvStatus>(static_cast<std::size_t>(batch.env_count()))};
  const auto view = batch.view();
  solver.solve(solver.plan(view), view,
               SolutionView<Real>{solution.lambda.data(), solution.w.data(), solution.status.data()},
               warm_start.empty() ? nullptr : warm_start.data());
  return solution;
}

template Plan Solver::plan(const ContactBatchView<float>&, StreamRef) const;
template Plan Solver::plan(const ContactBatchView<double>&, StreamRef) const;
template void Solver::solve(const Plan&, const ContactBatchView<float>&, const SolutionView<float>&, const float*,
                            StreamRef) const;
template void Solver::solve(const Plan&, const ContactBatchView<double>&, const SolutionView<double>&, const double*,
                            StreamRef) const;
template void Solver::solve(const ContactBatchView<float>&, const SolutionView<float>&, const float*, StreamRef) const;
template void Solver::solve(const ContactBatchView<double>&, const SolutionView<double>&, const double*,
                            StreamRef) const;
template void Solver::islands(const ContactBatchView<float>&, Index*, Index*, StreamRef) const;
template void Solver::islands(const ContactBatchView<double>&, Index*, Index*, StreamRef) const;
template void Solver::check(const ContactBatchView<float>&, const SolutionView<float>&) const;
template void Solver::check(const ContactBatchView<double>&, const SolutionView<double>&) const;
template std::shared_ptr<float> Solver::make_array(Offset) const;
template std::shared_ptr<double> Solver::make_array(Offset) const;
template Solution<float> solve(const ContactBatch<float>&, const SolverOptions&, Device, std::span<const float>);
template Solution<double> solve(const ContactBatch<double>&, const SolverOptions&, Device, std::span<const double>);

}  // namespace stiction
