// Bullet's solvers on the problems of engine_run.hpp.
//
//     c++ -O2 bullet_solve.cpp $(pkg-config --cflags --libs bullet-float64)
//
// SOLVER is dantzig, lemke or pgs, through btMLCPSolverInterface. lemke leaves bounds and findex out: LCPs only. pgs
// stops before ITERATIONS when the squares of all changes in a sweep add up to less than 1e-20.
//
// Forming is filling Bullet's matrix and vectors.

#include <BulletDynamics/MLCPSolvers/btDantzigSolver.h>
#include <BulletDynamics/MLCPSolvers/btLemkeSolver.h>
#include <BulletDynamics/MLCPSolvers/btSolveProjectedGaussSeidel.h>

#include <memory>

#include "engine_run.hpp"

namespace {

using engines::BoxedLcp;
using engines::Call;
using engines::Stopwatch;

btScalar scalar(double value) {
  return static_cast<btScalar>(std::clamp(value, -double(SIMD_INFINITY), double(SIMD_INFINITY)));
}

/// Bullet's equation is A x = b + w.
Call solve_matrix(btMLCPSolverInterface& solver, const BoxedLcp& p, int iterations) {
  Call call;
  const Stopwatch forming;
  const int n = p.rows();
  btMatrixXu A(n, n);
  btVectorXu b(n), x(n), lo(n), hi(n);
  btAlignedObjectArray<int> findex;
  findex.resize(n);
  x.setZero();
  for (int i = 0; i < n; ++i) {
    const auto row = static_cast<std::size_t>(i);
    for (int j = 0; j < n; ++j)
      A.setElem(i, j, static_cast<btScalar>(p.A[row * static_cast<std::size_t>(n) + static_cast<std::size_t>(j)]));
    b[i] = static_cast<btScalar>(-p.b[row]);
    lo[i] = scalar(p.lo[row]), hi[i] = scalar(p.hi[row]);
    findex[i] = static_cast<int>(p.findex[row]);
  }
  call.form = forming.seconds();
  const Stopwatch solving;
  call.claimed = solver.solveMLCP(A, b, x, lo, hi, findex, iterations);
  call.solve = solving.seconds();
  for (int i = 0; i < n; ++i) call.reaction.push_back(double(x[i]));
  return call;
}

}  // namespace

int main(int count, char** words) {
  if (count != 6) engines::fail("usage: bullet_solve SOLVER ITERATIONS SECONDS IN OUT");
  const std::string name = words[1];
  const int iterations = engines::number<int>(words[2]);
  std::unique_ptr<btMLCPSolverInterface> solver;
  if (name == "dantzig") solver = std::make_unique<btDantzigSolver>();
  if (name == "lemke") {
    auto lemke = std::make_unique<btLemkeSolver>();
    lemke->m_useLoHighBounds = false;
    lemke->m_maxLoops = iterations;
    solver = std::move(lemke);
  }
  if (name == "pgs") {
    auto sweeps = std::make_unique<btSolveProjectedGaussSeidel>();
    sweeps->m_leastSquaresResidualThreshold = btScalar(1e-20);
    solver = std::move(sweeps);
  }
  if (!solver) engines::fail("no such solver");
  return engines::serve(words, [&](const BoxedLcp& p) { return solve_matrix(*solver, p, iterations); });
}
