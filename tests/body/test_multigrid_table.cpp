#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include "tests/support/multigrid_case.hpp"

/// The table of docs/math/multigrid.md: iterations of conjugate gradients under each preconditioner.
namespace stiction::test {
namespace {

/// Blocks of all levels' matrices over those of the finest.
double operator_complexity(const Multigrid& grids) {
  return 1.0 + static_cast<double>(grids.plan.coarse_blocks()) / static_cast<double>(grids.finest.pattern.blocks());
}

/// Prints a line of the table and expects smoothed V-cycles to need fewer iterations than block Jacobi.
void measure(const std::string& name, const StackedBoxes& scene, double R) {
  constexpr double kTolerance = 1e-6;
  constexpr Index kMost = 5000;
  std::mt19937 random(17);
  std::normal_distribution<double> normal;
  std::vector<double> b(6 * static_cast<std::size_t>(scene.bodies())), x, factors(6 * b.size());
  for (double& entry : b) entry = normal(random);
  SerialBlock block;
  OwnedBlocks H = scene.matrix(R);
  const BlockDiagonal diagonal{scene.bodies(), factors.data()};
  diagonal.prepare(block, H.view());
  const Index alone = iterate(H.view(), diagonal, b, kTolerance, kMost, x).iterations;
  std::printf("| %s | %d | %g | %d |", name.c_str(), scene.bodies(), R, alone);
  double complexity[2] = {};
  for (const MultigridOptions& options : kMultigridKinds) {
    MultigridCase one(scene, R, options);
    const Multigrid grids = one.prepared(block);
    const GradientOutcome outcome = iterate(one.H(), grids, b, kTolerance, kMost, x);
    std::printf(" %d |", outcome.iterations);
    EXPECT_TRUE(outcome.is_met) << name;
    EXPECT_LT(outcome.iterations, alone) << name;
    complexity[options.prolongation == Prolongation::smoothed ? 1 : 0] = operator_complexity(grids);
  }
  std::printf(" %.2f, %.2f |\n", complexity[0], complexity[1]);
}

TEST(MultigridTable, scenes_of_some_hundred_bodies) {
  for (const double R : {1e-3, 1e-5}) {
    measure("tower", StackedBoxes::tower(200), R);
    measure("wall", StackedBoxes::wall(10), R);
    measure("pyramid", StackedBoxes::pyramid(10), R);
  }
}

TEST(MultigridTable, DISABLED_scenes_of_some_thousand_bodies) {
  for (const double R : {1e-3, 1e-5}) {
    measure("tower", StackedBoxes::tower(1000), R);
    for (const Index n : {30, 60}) measure("wall", StackedBoxes::wall(n), R);
    measure("pyramid", StackedBoxes::pyramid(20), R);
    for (const unsigned percent : {20U, 50U}) {
      StackedBoxes wall = StackedBoxes::wall(30);
      wall.open_beds(percent);
      measure("wall, open beds: " + std::to_string(percent) + " %", wall, R);
    }
    StackedBoxes tower = StackedBoxes::tower(200);
    tower.open_beds(20);
    measure("tower, open beds: 20 %", tower, R);
  }
}

}  // namespace
}  // namespace stiction::test
