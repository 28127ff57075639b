#include "stiction/recorder.hpp"
#include "core/base/fp_env.hpp"

#include <string>
#include <utility>

#include "stiction/config.hpp"
#include "stiction/error.hpp"

namespace stiction::io {
namespace {

std::size_t at(Offset i) {
  return static_cast<std::size_t>(i);
}

template <class T>
void extend(std::vector<T>& all, const std::vector<T>& more) {
  all.insert(all.end(), more.begin(), more.end());
}

/// Offsets that go on where those before end.
void extend_offsets(std::vector<Offset>& all, const std::vector<Offset>& more) {
  const Offset shift = all.back();
  for (std::size_t k = 1; k < more.size(); ++k) all.push_back(more[k] + shift);
}

/// An array that may be absent on either side: absent is as many times `absent`.
template <class T>
void extend_optional(std::vector<T>& all, std::size_t before, const std::vector<T>& more, std::size_t added, T absent) {
  if (all.empty() && more.empty()) return;
  all.resize(before, absent);
  if (more.empty())
    all.resize(before + added, absent);
  else
    extend(all, more);
}

ContactBatch<double> joined(const ContactBatch<double>& first, const ContactBatch<double>& second) {
  auto all = first.arrays();
  all.factor_offsets.clear();  // no environment has any
  const auto& more = second.arrays();
  extend_optional(all.cone_group, all.cone_kind.size(), more.cone_group, more.cone_kind.size(), Index{-1});
  extend_optional(all.env_flags, all.env_row_offsets.size() - 1, more.env_flags, more.env_row_offsets.size() - 1,
                  std::uint32_t{0});
  const std::size_t envs = all.env_row_offsets.size() - 1, added = more.env_row_offsets.size() - 1;
  extend_optional(all.env_tolerance, envs, more.env_tolerance, added, -1.0);
  extend_optional(all.env_max_iterations, envs, more.env_max_iterations, added, Index{-1});
  for (auto member : {&ContactBatch<double>::Arrays::env_row_offsets, &ContactBatch<double>::Arrays::env_cone_offsets,
                      &ContactBatch<double>::Arrays::cone_row_offsets, &ContactBatch<double>::Arrays::row_offsets})
    extend_offsets(all.*member, more.*member);
  extend(all.cone_kind, more.cone_kind);
  extend(all.column, more.column);
  for (auto member :
       {&ContactBatch<double>::Arrays::A, &ContactBatch<double>::Arrays::b, &ContactBatch<double>::Arrays::R,
        &ContactBatch<double>::Arrays::mu, &ContactBatch<double>::Arrays::lo, &ContactBatch<double>::Arrays::hi})
    extend(all.*member, more.*member);
  return ContactBatch<double>::from_arrays(second.law(), std::move(all));
}

/// The rows in use of the chosen environments.
template <class Real>
std::vector<double> gather_rows(const std::vector<Real>& values, const std::vector<Offset>& first_row,
                                const std::vector<Offset>& packed_offsets, const std::vector<Offset>& chosen) {
  std::vector<double> rows;
  for (const Offset env : chosen) {
    const Offset count = packed_offsets[at(env) + 1] - packed_offsets[at(env)];
    for (Offset row = 0; row < count; ++row) rows.push_back(static_cast<double>(values[at(first_row[at(env)] + row)]));
  }
  return rows;
}

void copy_dynamics(Recording& to, const Recording& from) {
  to.env_dof_offsets = from.env_dof_offsets;
  to.J = from.J;
  to.M = from.M;
  to.v_free = from.v_free;
  to.row_target = from.row_target;
}

void extend_csr(Csr& all, const Csr& more) {
  extend_offsets(all.ptr, more.ptr);
  extend(all.col, more.col);
  extend(all.val, more.val);
}

/// J and M of further environments; a file has them of all its environments or of none.
void extend_dynamics(Recording& all, const Recording& more) {
  if (more.env_dof_offsets.empty()) return;
  extend_offsets(all.env_dof_offsets, more.env_dof_offsets);
  extend_csr(all.J, more.J);
  extend_csr(all.M, more.M);
  extend(all.v_free, more.v_free);
  extend(all.row_target, more.row_target);
}

template <class Real>
constexpr Precision precision_of() {
  return sizeof(Real) == sizeof(float) ? Precision::f32 : Precision::f64;
}

void refuse_factors(const ContactBatch<double>& batch) {
  if (batch.arrays().factor.empty()) return;
  throw Error(ErrorCode::unsupported,
              "an environment to be recorded is kept as a factor, which contact-batch files do not hold: assemble it "
              "with FactorUse::never");
}

}  // namespace

Recorder::Recorder(std::filesystem::path path, RecorderOptions options)
    : path_(std::move(path)), options_(std::move(options)) {
  if (options_.max_environments < 1)
    throw Error(ErrorCode::invalid_argument,
                "options.max_environments = " + std::to_string(options_.max_environments) + ", expected at least 1");
}

std::vector<Offset> Recorder::choose(const std::vector<EnvStatus>& status) {
  if (!options_.mask.empty() && options_.mask.size() < status.size())
    throw Error(ErrorCode::invalid_argument, "options.mask has " + std::to_string(options_.mask.size()) +
                                                 " entries, the batch " + std::to_string(status.size()) +
                                                 " environments: give one per environment, or none");
  std::vector<Offset> chosen;
  Offset without_room = 0;
  for (std::size_t env = 0; env < status.size(); ++env) {
    if (!options_.mask.empty() && !options_.mask[env]) continue;
    if (options_.when == RecordWhen::failed && status[env].code == EnvCode::solved) continue;
    if (recorded() + static_cast<Offset>(chosen.size()) < options_.max_environments)
      chosen.push_back(static_cast<Offset>(env));
    else
      ++without_room;
  }
  left_out_ += without_room;
  return chosen;
}

void Recorder::require_same(const RecordedSolve& solve, Law law) const {
  if (!recording_.solve) return;
  const RecordedSolve& before = *recording_.solve;
  const bool same = before.form == solve.form && before.solver == solve.solver && before.precision == solve.precision &&
                    before.tolerance == solve.tolerance && before.absolute_tolerance == solve.absolute_tolerance &&
                    before.omega == solve.omega && before.max_iterations == solve.max_iterations &&
                    before.stall_window == solve.stall_window && before.direct_rows == solve.direct_rows &&
                    before.islands == solve.islands && before.blocks == solve.blocks && before.choose == solve.choose &&
                    before.spectrum == solve.spectrum && recording_.batch.law() == law;
  if (same) return;
  throw Error(ErrorCode::invalid_argument,
              "the solver's options, law, form or precision are not those that " + path_.string() +
                  " was begun with: record solves of different kinds to files of their own");
}

void Recorder::append(const ContactBatch<double>& batch, const RecordedSolve& solve, const std::vector<Offset>& chosen,
                      const Recording& dynamics) {
  Recording all = recording_;
  if (!all.solve) {
    all.batch = batch;
    all.source = "stiction " + std::string(kVersion) + ", recorded from a running solver";
    all.solve = solve;
    copy_dynamics(all, dynamics);
  } else {
    const auto before = static_cast<std::size_t>(all.batch.row_count());
    const auto added = static_cast<std::size_t>(batch.row_count());
    all.batch = joined(all.batch, batch);
    extend(all.solve->lambda, solve.lambda);
    extend_optional(all.solve->warm_start, before, solve.warm_start, added, 0.0);
    extend_dynamics(all, dynamics);
  }
  all.solve->left_out = left_out_;
  for (const Offset env : chosen) {
    all.env_name.push_back("environment " + std::to_string(env));
    all.step.push_back(takes_);
  }
  write_batch(path_, all);
  recording_ = std::move(all);
}

RecordedSolve Recorder::describe(const SolverOptions& options, Precision precision, RecordedForm form) const {
  RecordedSolve solve;
  solve.form = form;
  solve.solver = options.solver;
  solve.precision = precision;
  solve.tolerance = options.tolerance;
  solve.absolute_tolerance = options.absolute_tolerance;
  solve.omega = options.omega;
  solve.max_iterations = options.max_iterations;
  solve.stall_window = options.stall_window;
  solve.direct_rows = options.direct_rows;
  solve.islands = options.islands;
  solve.blocks = options.blocks;
  solve.choose = options.choose;
  if (options.choose == SolverChoice::spectrum) {
    if (options.spectrum.keep)
      throw Error(ErrorCode::unsupported,
                  "options.spectrum.keep is set, so that an answer depends on batches before it, which no file holds: "
                  "record solves without it");
    solve.spectrum = options.spectrum;
  }
  solve.numerics_epoch = kNumericsEpoch;
  return solve;
}

/// Tells the file how many there were no room for, where that has changed.
void Recorder::count_left_out(Offset before) {
  if (left_out_ == before || !recording_.solve) return;
  recording_.solve->left_out = left_out_;
  write_batch(path_, recording_);
}

template <class Real>
Offset Recorder::take(const Solver& solver, const ContactBatchView<Real>& batch, const SolutionView<Real>& solution,
                      const Real* warm_start, StreamRef stream) {
  const ScopedFpEnv fp_env;
  const auto fetch = [&](auto& storage, const auto* source, Offset count) {
    storage.resize(at(count));
    solver.to_host(std::span(storage), source, batch.space, stream);
  };
  RecordedSolve solve = describe(solver.options(), precision_of<Real>(), RecordedForm::matrix);
  const Law law = solver.options().law.value_or(batch.law);
  require_same(solve, law);

  std::vector<EnvStatus> status;
  fetch(status, solution.status, batch.env_count);
  const Offset left_out_before = left_out_;
  const std::vector<Offset> chosen = choose(status);
  ++takes_;
  if (chosen.empty()) {
    count_left_out(left_out_before);
    return 0;
  }
  const ContactBatch<Real> host = solver.to_host(batch, stream);
  std::vector<Offset> first_row;
  std::vector<Real> values;
  fetch(first_row, batch.env_row_offsets, batch.env_count + 1);
  fetch(values, solution.lambda, batch.row_count);
  solve.lambda = gather_rows(values, first_row, host.arrays().env_row_offsets, chosen);
  if (warm_start != nullptr) {
    fetch(values, warm_start, batch.row_count);
    solve.warm_start = gather_rows(values, first_row, host.arrays().env_row_offsets, chosen);
  }
  ContactBatch<double> picked = convert<double>(gather(host, std::span<const Offset>(chosen)));
  refuse_factors(picked);
  picked.set_law(law);
  append(picked, solve, chosen, {});
  return static_cast<Offset>(chosen.size());
}

template <class Real>
Offset Recorder::take(const Solver& solver, const JacobianBatchView<Real>& batch, const SolutionView<Real>& solution,
                      const Real* warm_start, RecordedForm form) {
  const ScopedFpEnv fp_env;
  if (batch.space != MemorySpace::host)
    throw Error(ErrorCode::invalid_argument, "the batch to be recorded is in device memory: copy it to the host");
  RecordedSolve solve = describe(solver.options(), precision_of<Real>(), form);
  const Law law = solver.options().law.value_or(batch.law);
  require_same(solve, law);

  const Offset left_out_before = left_out_;
  const std::vector<Offset> chosen = choose(std::vector<EnvStatus>(solution.status, solution.status + batch.env_count));
  ++takes_;
  if (chosen.empty()) {
    count_left_out(left_out_before);
    return 0;
  }
  const ContactBatch<Real> host = assemble(batch, FactorUse::never);
  const std::vector<Offset> first_row(batch.env_row_offsets, batch.env_row_offsets + batch.env_count + 1);
  const auto rows = [&](const Real* values) {
    return gather_rows(std::vector<Real>(values, values + batch.row_count), first_row, host.arrays().env_row_offsets,
                       chosen);
  };
  solve.lambda = rows(solution.lambda);
  if (warm_start != nullptr) solve.warm_start = rows(warm_start);
  Recording dynamics;
  keep_dynamics(dynamics, batch, std::span<const Offset>(chosen));
  ContactBatch<double> picked = convert<double>(gather(host, std::span<const Offset>(chosen)));
  picked.set_law(law);
  append(picked, solve, chosen, dynamics);
  return static_cast<Offset>(chosen.size());
}

template Offset Recorder::take(const Solver&, const ContactBatchView<float>&, const SolutionView<float>&, const float*,
                               StreamRef);
template Offset Recorder::take(const Solver&, const ContactBatchView<double>&, const SolutionView<double>&,
                               const double*, StreamRef);
template Offset Recorder::take(const Solver&, const JacobianBatchView<float>&, const SolutionView<float>&, const float*,
                               RecordedForm);
template Offset Recorder::take(const Solver&, const JacobianBatchView<double>&, const SolutionView<double>&,
                               const double*, RecordedForm);

}  // namespace stiction::io
