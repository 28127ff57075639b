#include "stiction/analysis.hpp"

#include <cmath>
#include <cstddef>
#include <numeric>
#include <string>

#include "core/base/fp_env.hpp"
#include "core/runtime/analysis/environment_operator.hpp"
#include "core/runtime/analysis/pivoted_factors.hpp"
#include "core/runtime/analysis/start_vector.hpp"
#include "core/runtime/check/asymmetry.hpp"
#include "core/runtime/check/defects.hpp"
#include "core/runtime/check/expect.hpp"

namespace stiction {
namespace {

using Vector = std::vector<double>;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A norm from below: the square root of a Rayleigh quotient of B'B.
struct NormEstimate {
  double value = 0;
  double error = 0;  ///< |B'B x - value^2 x| / value^2 for the unit vector x: a singular value's square is that near
  Index steps = 0;
};

/// Power iteration on B'B. `apply` is B, `apply_transposed` B', both n x n.
template <class Apply, class ApplyTransposed>
NormEstimate power_iteration(std::size_t n, const AnalysisOptions& options, const Apply& apply,
                             const ApplyTransposed& apply_transposed) {
  NormEstimate estimate;
  Vector x = start_vector(n);
  while (true) {
    const Vector y = apply(x);
    Vector z = apply_transposed(y);
    estimate.value = norm(y);
    ++estimate.steps;
    const double length = norm(z);
    if (length == 0) return estimate;
    const double square = estimate.value * estimate.value;
    double residual = 0;
    for (std::size_t i = 0; i < n; ++i) residual += (z[i] - square * x[i]) * (z[i] - square * x[i]);
    estimate.error = std::sqrt(residual) / square;
    if (estimate.error <= options.step_tolerance || estimate.steps == options.max_steps) return estimate;
    for (std::size_t i = 0; i < n; ++i) x[i] = z[i] / length;
  }
}

/// T'^-1 x
Vector solve_transposed(const Triangle& T, Vector x) {
  for (std::size_t i = 0; i < T.size; ++i) {
    const double* const row = T.entries.data() + i * T.size;
    x[i] /= row[i];
    for (std::size_t j = i + 1; j < T.size; ++j) x[j] -= row[j] * x[i];
  }
  return x;
}

/// T^-1 x
Vector solve(const Triangle& T, Vector x) {
  for (std::size_t i = T.size; i-- > 0;) {
    const double* const row = T.entries.data() + i * T.size;
    for (std::size_t j = i + 1; j < T.size; ++j) x[i] -= row[j] * x[j];
    x[i] /= row[i];
  }
  return x;
}

void look_at_size(const EnvironmentOperator& A, const AnalysisOptions& options, OperatorAnalysis& seen) {
  const NormEstimate top = power_iteration(
      A.rows(), options, [&](const Vector& x) { return A.multiply(x); },
      [&](const Vector& x) { return A.multiply_transposed(x); });
  seen.largest = top.value;
  seen.largest_error = top.error;
  seen.largest_steps = top.steps;
}

void look_at_rank(const EnvironmentOperator& A, const AnalysisOptions& options, OperatorAnalysis& seen) {
  Vector matrix = A.dense();
  seen.definiteness = definiteness_of(matrix, A.rows(), seen.rank_tolerance);
  const Triangle T = range_triangle(std::move(matrix), A.rows(), seen.rank_tolerance);
  seen.rank = static_cast<Index>(T.size);
  if (T.size == 0) return;
  const NormEstimate inverse = power_iteration(
      T.size, options, [&](const Vector& x) { return solve_transposed(T, x); },
      [&](const Vector& x) { return solve(T, x); });
  seen.smallest = 1 / inverse.value;
  // A singular value s has |1/s - v| <= e v, so it is at most 1 / (v (1 - e)).
  seen.smallest_error = inverse.error < 1 ? inverse.error / (1 - inverse.error) : kInfinity;
  seen.smallest_steps = inverse.steps;
}

template <class Real>
double normal_spread(const ContactBatchView<Real>& batch, Offset env, const EnvironmentOperator& A) {
  double largest = 0, smallest = kInfinity;
  for (Index cone = 0; cone < batch.env_cones(env); ++cone) {
    const Offset row = batch.normal_row(batch.env_cone_offsets[env] + cone) - batch.env_row_offsets[env];
    const double diagonal = A.diagonal(static_cast<std::size_t>(row));
    if (!(diagonal > 0)) continue;
    if (diagonal > largest) largest = diagonal;
    if (diagonal < smallest) smallest = diagonal;
  }
  return largest > 0 ? largest / smallest : OperatorAnalysis::kNone;
}

template <class Real>
OperatorAnalysis look_at(const ContactBatchView<Real>& batch, Offset env, const AnalysisOptions& options) {
  const EnvironmentOperator A(batch, env, options.with_compliance);
  OperatorAnalysis seen;
  seen.rows = batch.env_rows(env);
  seen.nonzeros = A.nonzeros();
  seen.is_finite = A.is_finite();
  if (seen.rows == 0) return seen;
  const auto n = static_cast<double>(seen.rows);
  seen.density = static_cast<double>(seen.nonzeros) / (n * n);
  if (!seen.is_finite) return seen;
  seen.asymmetry = environment_asymmetry(batch, env);
  seen.normal_spread = normal_spread(batch, env, A);
  look_at_size(A, options, seen);
  const double own = n * static_cast<double>(std::numeric_limits<Real>::epsilon());
  seen.rank_tolerance = (options.rank_tolerance > 0 ? options.rank_tolerance : own) * seen.largest;
  if (seen.rows <= options.max_dense_rows) look_at_rank(A, options, seen);
  for (double* const size : {&seen.largest, &seen.smallest, &seen.rank_tolerance}) *size = A.unscaled(*size);
  return seen;
}

template <class Real>
void check(const ContactBatchView<Real>& batch, const AnalysisOptions& options) {
  if (options.max_steps < 1)
    refuse("max_steps = " + std::to_string(options.max_steps) + ": an iteration takes 1 or more");
  if (!(options.step_tolerance >= 0))
    refuse("step_tolerance = " + shortest_text(options.step_tolerance) + ": a relative error is >= 0");
  if (!(options.rank_tolerance >= 0 && options.rank_tolerance < 1))
    refuse("rank_tolerance = " + shortest_text(options.rank_tolerance) +
           ": it is a part of the largest singular value, from 0 (by rows and type) to below 1");
  const std::vector<Defect> defects = validate_structure(batch, 1);
  if (!defects.empty()) refuse("operators cannot be analysed: " + defects.front().message);
}

}  // namespace

const char* to_string(Definiteness definiteness) noexcept {
  switch (definiteness) {
    case Definiteness::unknown:
      return "unknown";
    case Definiteness::positive_definite:
      return "positive definite";
    case Definiteness::positive_semidefinite:
      return "positive semidefinite";
    case Definiteness::indefinite:
      return "indefinite";
  }
  return "?";
}

double OperatorAnalysis::condition() const noexcept {
  return rank < 0 ? kNone : rank < rows ? kInfinity : range_condition();
}

template <class Real>
std::vector<OperatorAnalysis> analyse(const ContactBatchView<Real>& batch, std::span<const Offset> environments,
                                      const AnalysisOptions& options) {
  const ScopedFpEnv fp_env;
  check(batch, options);
  std::vector<OperatorAnalysis> result;
  result.reserve(environments.size());
  for (const Offset env : environments) {
    if (env < 0 || env >= batch.env_count)
      refuse("environment " + std::to_string(env) + ": the batch has " + std::to_string(batch.env_count));
    result.push_back(look_at(batch, env, options));
  }
  return result;
}

template <class Real>
std::vector<OperatorAnalysis> analyse(const ContactBatchView<Real>& batch, const AnalysisOptions& options) {
  check(batch, options);
  std::vector<Offset> all(static_cast<std::size_t>(batch.env_count));
  std::iota(all.begin(), all.end(), Offset{0});
  return analyse(batch, all, options);
}

template std::vector<OperatorAnalysis> analyse(const ContactBatchView<float>&, std::span<const Offset>,
                                               const AnalysisOptions&);
template std::vector<OperatorAnalysis> analyse(const ContactBatchView<double>&, std::span<const Offset>,
                                               const AnalysisOptions&);
template std::vector<OperatorAnalysis> analyse(const ContactBatchView<float>&, const AnalysisOptions&);
template std::vector<OperatorAnalysis> analyse(const ContactBatchView<double>&, const AnalysisOptions&);

}  // namespace stiction
