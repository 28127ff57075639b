// DART's solvers on the boxed LCPs of engine_run.hpp.
//
//     c++ -O2 dart_solve.cpp $(pkg-config --cflags --libs-only-L dart) -ldart
//
// SOLVER:
//
// * dantzig and pgs are the two BoxedLcpSolvers of its constraint solver. pgs has ITERATIONS and tolerances so small
//   (1e-12 absolute, 1e-10 relative) that it stops at rounding.
// * lemke is dart::lcpsolver::Lemke (LCPs only: it leaves bounds and findex out).
//
// Forming is padding A's rows as the solvers read them, or filling Eigen's matrix, and copying data that they destroy.

#include <dart/external/odelcpsolver/lcp.h>
#include <dart/constraint/ContactConstraint.hpp>
#include <dart/constraint/DantzigBoxedLcpSolver.hpp>
#include <dart/constraint/PgsBoxedLcpSolver.hpp>
#include <dart/lcpsolver/Lemke.hpp>

#include <memory>

#include "engine_run.hpp"

namespace {

using engines::BoxedLcp;
using engines::Call;
using engines::Stopwatch;

std::vector<double> negated(const std::vector<double>& values) {
  std::vector<double> all(values);
  for (double& value : all) value = -value;
  return all;
}

/// These solvers' equation is A x = b + w.
Call solve_boxed(dart::constraint::BoxedLcpSolver& solver, const BoxedLcp& p, double mixing) {
  Call call;
  const Stopwatch forming;
  const auto n = static_cast<std::size_t>(p.rows());
  const auto stride = static_cast<std::size_t>(dPAD(p.rows()));
  std::vector<double> A(n * stride), b = negated(p.b), x(n), lo = p.lo, hi = p.hi;
  std::vector<int> findex(p.findex.begin(), p.findex.end());
  for (std::size_t i = 0; i < n; ++i) {
    std::copy_n(p.A.data() + i * n, n, A.data() + i * stride);
    A[i * stride + i] *= 1 + mixing;
  }
  call.form = forming.seconds();
  const Stopwatch solving;
  call.claimed = solver.solve(p.rows(), A.data(), x.data(), b.data(), 0, lo.data(), hi.data(), findex.data(), false);
  call.solve = solving.seconds();
  call.reaction = x;
  return call;
}

Call solve_lemke(const BoxedLcp& p) {
  Call call;
  const Stopwatch forming;
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::MatrixXd A = Eigen::Map<const Rows>(p.A.data(), p.rows(), p.rows());
  const Eigen::VectorXd b = Eigen::Map<const Eigen::VectorXd>(p.b.data(), p.rows());
  Eigen::VectorXd x = Eigen::VectorXd::Zero(p.rows());
  call.form = forming.seconds();
  const Stopwatch solving;
  call.claimed = dart::lcpsolver::Lemke(A, b, &x) == 0;
  call.solve = solving.seconds();
  if (x.size() == p.rows())
    call.reaction.assign(x.data(), x.data() + x.size());
  else
    call.reaction.assign(p.b.size(), std::numeric_limits<double>::quiet_NaN());
  return call;
}

}  // namespace

int main(int count, char** words) {
  if (count != 6) engines::fail("usage: dart_solve SOLVER ITERATIONS SECONDS IN OUT");
  const std::string name = words[1];
  if (name == "lemke") return engines::serve(words, solve_lemke);
  std::unique_ptr<dart::constraint::BoxedLcpSolver> solver;
  const bool mixed = name == "dantzig_cfm";
  if (name == "dantzig" || mixed) solver = std::make_unique<dart::constraint::DantzigBoxedLcpSolver>();
  if (name == "pgs") {
    auto sweeps = std::make_unique<dart::constraint::PgsBoxedLcpSolver>();
    sweeps->setOption({engines::number<int>(words[2]), 1e-12, 1e-10});
    solver = std::move(sweeps);
  }
  if (!solver) engines::fail("no such solver");
  const double mixing = mixed ? dart::constraint::ContactConstraint::getConstraintForceMixing() : 0;
  return engines::serve(words, [&](const BoxedLcp& p) { return solve_boxed(*solver, p, mixing); });
}
