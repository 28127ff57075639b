#pragma once

#include <array>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cuda/emulated/emulated_kernels.hpp"
#include "stiction/batch.hpp"
#include "stiction/solver.hpp"

/// Environments written down by hand, and the few lines every test of a solver begins with.
namespace stiction::test {

using Cone = Environment<double>::Cone;

inline Cone free_row() {
  return {ConeKind::free, 1, -1};
}
inline Cone unilateral() {
  return {ConeKind::unilateral, 1, -1};
}
inline Cone box() {
  return {ConeKind::box, 1, -1};
}
inline Cone friction(Index rows = 3) {
  return {ConeKind::friction, rows, -1};
}

/// An environment from a dense row-major matrix; mu, lo, hi and R may be set afterwards.
inline Environment<double> system(std::vector<Cone> cones, const std::vector<double>& matrix, std::vector<double> b) {
  Environment<double> env;
  env.cones = std::move(cones);
  env.set_dense(matrix, static_cast<Index>(b.size()));
  env.b = std::move(b);
  return env;
}

/// The row-major diagonal matrix of those entries.
inline std::vector<double> diagonal(const std::vector<double>& entries) {
  const std::size_t n = entries.size();
  std::vector<double> matrix(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) matrix[i * n + i] = entries[i];
  return matrix;
}

/// One friction contact of three rows, isotropic, on a diagonal matrix.
inline Environment<double> contact(const std::vector<double>& entries, std::vector<double> b, double mu) {
  Environment<double> env = system({friction(3)}, diagonal(entries), std::move(b));
  env.mu = {0, mu, mu};
  return env;
}

/// Rows with those bounds, each coupled to the next, all pushed alike but the first.
inline Environment<double> chain_of_boxes(std::span<const double[2]> bounds, double push) {
  const std::size_t n = bounds.size();
  std::vector<double> A(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    A[i * n + i] = 2;
    if (i > 0) A[i * n + i - 1] = A[(i - 1) * n + i] = -0.9;
  }
  std::vector<double> b(n, push);
  b[0] = 1;
  Environment<double> env = system(std::vector<Cone>(n, box()), A, std::move(b));
  for (const auto& bound : bounds) {
    env.lo.push_back(bound[0]);
    env.hi.push_back(bound[1]);
  }
  return env;
}

inline ContactBatch<double> batch_of(const std::vector<Environment<double>>& envs, Law law = Law::convex) {
  ContactBatch<double> batch(law);
  for (const auto& env : envs) batch.add(env);
  return batch;
}

inline SolverOptions options(SolverKind solver, double tolerance, Index max_iterations) {
  SolverOptions result;
  result.solver = solver;
  result.tolerance = tolerance;
  result.max_iterations = max_iterations;
  result.stall_window = 0;
  result.threads = 1;
  return result;
}

/// Every solver that can answer, by number.
inline constexpr auto kEverySolver = [] {
  std::array<SolverKind, kSolverKindCount> solvers{};
  for (std::size_t k = 0; k < solvers.size(); ++k) solvers[k] = static_cast<SolverKind>(k);
  return solvers;
}();

inline bool factorises(SolverKind solver) {
  return cuda::emulated_kernels().solvers.at(static_cast<std::size_t>(solver)).workspace.is_direct();
}

/// Solvers that iterate with cheap iterations and take every environment.
inline const std::vector<SolverKind> kAllSolvers = [] {
  std::vector<SolverKind> solvers(kEverySolver.begin(), kEverySolver.end());
  std::erase_if(solvers, factorises);
  return solvers;
}();
inline constexpr Law kBothLaws[] = {Law::convex, Law::coulomb};

/// "npgs, coulomb", for SCOPED_TRACE.
inline std::string label(SolverKind solver, Law law) {
  return std::string(to_string(solver)) + ", " + to_string(law);
}

}  // namespace stiction::test
