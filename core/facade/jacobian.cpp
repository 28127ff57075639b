#include "stiction/jacobian.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "core/base/extents.hpp"
#include "core/base/fp_env.hpp"
#include "core/facade/solve_jacobian.hpp"
#include "core/machine/jacobian_machine.hpp"
#include "core/runtime/check/expect.hpp"
#include "stiction/status.hpp"

namespace stiction {

namespace {

/// Rows of environments that follow one another without room.
template <class Real>
std::vector<Offset> compact_rows(const JacobianBatchView<Real>& batch) {
  std::vector<Offset> rows{0};
  for (Offset env = 0; env < batch.env_count; ++env) rows.push_back(rows.back() + batch.env_rows(env));
  return rows;
}

/// The cones and the vectors of one environment, as they are.
template <class Real>
void copy_rows(const JacobianBatchView<Real>& batch, Offset env, typename ContactBatch<Real>::Arrays& to) {
  const Offset cone = batch.env_cone_offsets[env], row = batch.env_row_offsets[env];
  const auto first = to.env_row_offsets.back();
  for (Offset c = cone; c < cone + batch.env_cones(env); ++c) {
    to.cone_kind.push_back(batch.cone_kind[c]);
    to.cone_row_offsets.push_back(batch.cone_row_offsets[c + 1] - row + first);
    if (batch.cone_group != nullptr) to.cone_group.push_back(batch.cone_group[c]);
  }
  const auto copy = [&](std::vector<Real>& target, const Real* source) {
    target.insert(target.end(), source + row, source + row + batch.env_rows(env));
  };
  copy(to.R, batch.R);
  copy(to.mu, batch.mu);
  copy(to.lo, batch.lo);
  copy(to.hi, batch.hi);
  to.env_row_offsets.push_back(first + batch.env_rows(env));
  to.env_cone_offsets.push_back(static_cast<Offset>(to.cone_kind.size()));
  to.env_flags.push_back(batch.env_flags == nullptr ? 0U : batch.env_flags[env]);
  if (batch.env_tolerance != nullptr) to.env_tolerance.push_back(batch.env_tolerance[env]);
  if (batch.env_max_iterations != nullptr) to.env_max_iterations.push_back(batch.env_max_iterations[env]);
}

}  // namespace

template <class Real>
ContactBatch<Real> assemble(const JacobianBatchView<Real>& batch, FactorUse use, int threads) {
  const ScopedFpEnv fp_env;
  check_structure(batch);
  if (threads < 0) refuse("threads = " + std::to_string(threads) + ", expected >= 0 (0: all cores)");
  typename ContactBatch<Real>::Arrays to;
  to.env_row_offsets = to.env_cone_offsets = to.cone_row_offsets = to.row_offsets = {0};
  std::vector<Offset> matrix{0}, factor{0};
  for (Offset env = 0; env < batch.env_count; ++env) {
    const Offset n = batch.env_rows(env), dofs = batch.env_dofs(env);
    const bool as_factor = keeps_factor(use, n, dofs);
    copy_rows(batch, env, to);
    matrix.push_back(matrix.back() + (as_factor ? 0 : n * n));
    factor.push_back(factor.back() + (as_factor ? n * dofs : 0));
    for (Offset i = 0; i < n; ++i) {
      for (Offset j = 0; !as_factor && j < n; ++j) to.column.push_back(static_cast<Index>(j));
      to.row_offsets.push_back(static_cast<Offset>(to.column.size()));
    }
  }
  to.A.resize(static_cast<std::size_t>(matrix.back()));
  to.b.resize(static_cast<std::size_t>(to.env_row_offsets.back()));

  JacobianJob<Real> job{batch, to.env_row_offsets.data(), matrix.data(), factor.data()};
  to.factor.resize(static_cast<std::size_t>(factor.back()));
  job.A = to.A.data();
  job.Y = to.factor.data();
  job.b = to.b.data();
  job.flags = to.env_flags.data();
  assemble_on_cpu(job, threads);
  if (std::all_of(to.env_flags.begin(), to.env_flags.end(), [](std::uint32_t flags) { return flags == 0; }))
    to.env_flags.clear();
  if (!to.factor.empty()) to.factor_offsets = factor;
  return ContactBatch<Real>::from_arrays(batch.law, std::move(to));
}

template <class Real>
std::vector<Real> velocities(const JacobianBatchView<Real>& batch, std::span<const Real> lambda, int threads) {
  const ScopedFpEnv fp_env;
  check_structure(batch);
  if (threads < 0) refuse("threads = " + std::to_string(threads) + ", expected >= 0 (0: all cores)");
  const std::vector<Offset> rows = compact_rows(batch), none(rows.size(), 0);
  expect_length("lambda", lambda.size(), static_cast<std::size_t>(rows.back()),
                "one per row in use; pass the reactions of the assembled batch");
  std::vector<Real> result(static_cast<std::size_t>(batch.dof_count));
  JacobianJob<Real> job{batch, rows.data(), none.data(), none.data()};
  job.lambda = lambda.data();
  job.velocity = result.data();
  velocities_on_cpu(job, threads);
  return result;
}

namespace {

/// Vectors by row as the batch places its rows, room between environments included.
template <class Real>
struct Placed {
  std::vector<Real> lambda, w, guess;
};

/// f(first row of an environment in the batch, its first row without room, rows) for every environment.
template <class Real, class F>
void for_each_span(const JacobianBatchView<Real>& batch, const std::vector<Offset>& compact, const F& f) {
  for (Offset env = 0; env < batch.env_count; ++env)
    f(batch.env_row_offsets[env], compact[static_cast<std::size_t>(env)], batch.env_rows(env));
}
template <class Real>
std::vector<Real> spread(const JacobianBatchView<Real>& batch, const std::vector<Offset>& compact,
                         std::span<const Real> from) {
  std::vector<Real> to(static_cast<std::size_t>(batch.row_count));
  for_each_span(batch, compact, [&](Offset placed, Offset packed, Index rows) {
    std::copy_n(from.begin() + packed, rows, to.begin() + placed);
  });
  return to;
}
template <class Real>
std::vector<Real> gathered(const JacobianBatchView<Real>& batch, const std::vector<Offset>& compact,
                           const std::vector<Real>& from) {
  std::vector<Real> to(static_cast<std::size_t>(compact.back()));
  for_each_span(batch, compact, [&](Offset placed, Offset packed, Index rows) {
    std::copy_n(from.begin() + placed, rows, to.begin() + packed);
  });
  return to;
}

}  // namespace

template <class Real>
JacobianSolution<Real> solve(const JacobianBatchView<Real>& batch, const SolverOptions& options, Device device,
                             std::span<const Real> warm_start, FactorUse use) {
  const ScopedFpEnv fp_env;
  check_structure(batch);
  if (options.threads < 0) refuse("threads = " + std::to_string(options.threads) + ", expected >= 0 (0: all cores)");
  const Solver solver(device, options);
  JacobianSolution<Real> solution;
  solution.env_row_offsets = compact_rows(batch);
  const auto rows = static_cast<std::size_t>(batch.row_count);
  Placed<Real> placed{std::vector<Real>(rows), std::vector<Real>(rows), {}};
  if (!warm_start.empty()) {
    expect_length("warm_start", warm_start.size(), static_cast<std::size_t>(solution.env_row_offsets.back()),
                  "one per row in use; pass the reactions of an earlier solution");
    placed.guess = spread(batch, solution.env_row_offsets, warm_start);
  }
  solution.velocity.resize(static_cast<std::size_t>(batch.dof_count));
  solution.contact.status.resize(static_cast<std::size_t>(batch.env_count));
  const JacobianSolutionView<Real> view{placed.lambda.data(), placed.w.data(), solution.velocity.data(),
                                        solution.contact.status.data()};
  const Real* const guess = placed.guess.empty() ? nullptr : placed.guess.data();
  const auto machine = make_cpu_jacobian_machine<Real>(use, options.threads);
  solve_jacobian(*machine, solver, batch, view, JacobianStart<Real>{guess, nullptr}, StreamRef::default_stream());
  solution.contact.lambda = gathered(batch, solution.env_row_offsets, placed.lambda);
  solution.contact.w = gathered(batch, solution.env_row_offsets, placed.w);
  return solution;
}
template ContactBatch<float> assemble(const JacobianBatchView<float>&, FactorUse, int);
template ContactBatch<double> assemble(const JacobianBatchView<double>&, FactorUse, int);
template std::vector<float> velocities(const JacobianBatchView<float>&, std::span<const float>, int);
template std::vector<double> velocities(const JacobianBatchView<double>&, std::span<const double>, int);
template JacobianSolution<float> solve(const JacobianBatchView<float>&, const SolverOptions&, Device,
                                       std::span<const float>, FactorUse);
template JacobianSolution<double> solve(const JacobianBatchView<double>&, const SolverOptions&, Device,
                                        std::span<const double>, FactorUse);

}  // namespace stiction
