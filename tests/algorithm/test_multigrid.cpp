#include <gtest/gtest.h>

#ifdef STICTION_TEST_HAS_EIGEN

#include <Eigen/Dense>
#include <Eigen/Sparse>

#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "cpu_fallback/threads/threaded_team.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/machines/stress_team.hpp"
#include "tests/support/systems/multigrid_case.hpp"

namespace stiction::test {
namespace {

using Vector = Eigen::VectorXd;
using Dense = Eigen::MatrixXd;
using Sparse = Eigen::SparseMatrix<double>;

Sparse to_eigen(const BlockMatrix& A) {
  std::vector<Eigen::Triplet<double>> entries;
  for (Index row = 0; row < A.pattern.rows; ++row)
    for (Index k = A.pattern.offsets[row]; k < A.pattern.offsets[row + 1]; ++k)
      for (Index i = 0; i < 36; ++i)
        entries.emplace_back(6 * row + i / 6, 6 * A.pattern.columns[k] + i % 6, A.block(k)[i]);
  Sparse matrix(6 * A.pattern.rows, 6 * A.pattern.columns_total);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

Vector random_vector(Index n, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Vector v(n);
  for (double& x : v) x = normal(random);
  return v;
}

std::string name(const MultigridOptions& options) {
  return std::string(options.prolongation == Prolongation::plain ? "plain " : "smoothed ") +
         (options.cycle == Cycle::v ? "V" : "W");
}

Vector cycle(const Multigrid& grids, const Vector& r) {
  Vector z(r.size());
  SerialTeam team;
  grids.apply(team, r.data(), z.data());
  return z;
}

/// A wall, a body that nothing touches, and a pair that only touch each other.
StackedBoxes mixed_scene(Index n) {
  StackedBoxes scene = StackedBoxes::wall(n);
  scene.add_box({-50, 0, 20.3});
  scene.add_box({-60, 0, 30.5});
  scene.add_box({-60, 0, 31.5});
  return scene;
}

/// Calls f(case, prepared hierarchy) for each kind of multigrid on the mixed scene of n courses.
template <class F>
void with_every_kind(Index n, Index least_levels, F&& f) {
  for (const MultigridOptions& options : kMultigridKinds) {
    SCOPED_TRACE(name(options));
    MultigridCase one(mixed_scene(n), 1e-3, options);
    SerialTeam team;
    const Multigrid grids = one.prepared(team);
    ASSERT_GE(grids.plan.levels(), least_levels);
    f(one, grids);
  }
}

/// Positive definite as Cholesky's factorisation sees it: to rounding.
bool is_positive_definite(const Dense& A) {
  return Eigen::LLT<Dense>(A).info() == Eigen::Success;
}

TEST(Multigrid, ACycleIsSymmetricAndPositiveDefinite) {
  with_every_kind(26, 3, [](const MultigridCase& one, const Multigrid& grids) {
    for (unsigned seed = 0; seed < 100; ++seed) {
      const Vector x = random_vector(static_cast<Index>(one.size()), 2 * seed),
                   y = random_vector(static_cast<Index>(one.size()), 2 * seed + 1);
      const Vector bx = cycle(grids, x), by = cycle(grids, y);
      // A cycle is some hundred products with matrices of condition 1e4: their roundings stay below 1e-10.
      EXPECT_LE(std::abs(bx.dot(y) - x.dot(by)), 1e-10 * bx.norm() * y.norm());
      EXPECT_GT(bx.dot(x), 0.0);
    }
  });
}

TEST(Multigrid, NoErrorGrowsInACycle) {
  with_every_kind(9, 2, [](MultigridCase& one, const Multigrid& grids) {
    const Dense H = to_eigen(one.H());
    Dense inverse(H.rows(), H.cols());
    for (Index j = 0; j < H.cols(); ++j) inverse.col(j) = cycle(grids, Vector::Unit(H.rows(), j));
    EXPECT_LE((inverse - inverse.transpose()).norm(), 1e-12 * inverse.norm());
    // With H = L L' the errors of a cycle B shrink by 1 minus the eigenvalues of L' B L. They are above 0, and at most
    // 1 but for the rounding of numbers that are some 1e6 times apart.
    const Dense symmetric = 0.5 * (inverse + inverse.transpose());
    EXPECT_TRUE(is_positive_definite(symmetric));
    const Dense root = Eigen::LLT<Dense>(H).matrixL();
    const Dense image = symmetric * root;
    const Dense similar = root.transpose() * image;
    EXPECT_TRUE(is_positive_definite((1.0 + 1e-9) * Dense::Identity(H.rows(), H.cols()) - similar));
  });
}

TEST(Multigrid, FewBodiesAndUncoupledOnesAreSolvedExactly) {
  StackedBoxes few = StackedBoxes::wall(7);
  few.add_box({-50, 0, 20.3});
  StackedBoxes pairs;
  for (int i = 0; i < 100; ++i) {
    pairs.add_box({3.0 * i, 0, 20.5});
    pairs.add_box({3.0 * i, 0.25, 21.5});
  }
  MultigridCase one(few, 1e-2, {});
  SerialTeam team;
  const Vector b = random_vector(static_cast<Index>(one.size()), 5);
  const Vector exact = Eigen::LLT<Dense>(to_eigen(one.H())).solve(b);
  const Vector x = cycle(one.prepared(team), b);
  EXPECT_LE((x - exact).norm(), 1e-10 * exact.norm());

  MultigridCase two(pairs, 1e-2, {Prolongation::plain, Cycle::v});
  const Multigrid grids = two.prepared(team);
  ASSERT_EQ(grids.plan.levels(), 2);
  EXPECT_EQ(grids.plan.dense_bodies(), 0);
  // Each pair is an aggregate, and coarse bodies that nothing couples: the remainder is the same for all pairs.
  const Vector right = random_vector(static_cast<Index>(two.size()), 6);
  std::vector<double> answer;
  const GradientOutcome outcome = iterate(two.H(), grids, {right.begin(), right.end()}, 1e-10, 12, answer);
  EXPECT_TRUE(outcome.is_met) << "a pair has twelve unknowns";
}

TEST(Multigrid, NothingAndASingleBodyAreNoSpecialCases) {
  SerialTeam team;
  MultigridCase nothing(StackedBoxes(), 1.0, {});
  cycle(nothing.prepared(team), Vector());
  StackedBoxes scene;
  scene.add_box({0, 0, 0.5});
  MultigridCase one(scene, 1e-3, {});
  const Vector b = random_vector(6, 1);
  const Vector exact = Eigen::LLT<Dense>(to_eigen(one.H())).solve(b);
  EXPECT_LE((cycle(one.prepared(team), b) - exact).norm(), 1e-12 * exact.norm());
}

TEST(Multigrid, CoarseMatricesAreGalerkinProducts) {
  with_every_kind(26, 3, [](const MultigridCase&, const Multigrid& grids) {
    for (Index l = 0; l + 1 < grids.plan.levels(); ++l) {
      const Sparse H = to_eigen(grids.level(l).smoother.H), P = to_eigen(grids.level(l).P);
      const Sparse coarse = to_eigen(grids.level(l + 1).smoother.H);
      for (unsigned seed = 0; seed < 10; ++seed) {
        const Vector e = random_vector(static_cast<Index>(P.cols()), seed);
        const Vector moved = P * e;
        const Vector force = H * moved;
        const Vector expected = P.transpose() * force;
        // Sums of at most some hundred terms of like size.
        EXPECT_LE((coarse * e - expected).norm(), 1e-12 * expected.norm()) << "level " << l;
      }
    }
  });
}

/// The twists of bodies at these positions that move as one: velocity and spin of the body at `origin`.
Vector rigid_motion(const double* positions, Index bodies, const Vector& twist) {
  const Eigen::Vector3d origin(3.0, -2.0, 5.0), velocity = twist.head<3>(), spin = twist.tail<3>();
  Vector motion(6 * bodies);
  for (Index body = 0; body < bodies; ++body) {
    const Eigen::Vector3d d = Eigen::Map<const Eigen::Vector3d>(positions + 3 * body) - origin;
    motion.segment<3>(6 * body) = velocity + spin.cross(d);
    motion.segment<3>(6 * body + 3) = spin;
  }
  return motion;
}

/// Largest error of prolongations in reproducing the six rigid motions of the whole scene, relative.
double rigid_error(const Multigrid& grids, const std::vector<double>& positions) {
  double worst = 0.0;
  for (Index l = 0; l + 1 < grids.plan.levels(); ++l) {
    const GridLevel fine = grids.level(l), coarse = grids.level(l + 1);
    const double* const position = l == 0 ? positions.data() : fine.position;
    for (Index mode = 0; mode < 6; ++mode) {
      const Vector twist = Vector::Unit(6, mode);
      const Vector expected = rigid_motion(position, fine.plan.rows, twist);
      const Vector prolonged = to_eigen(fine.P) * rigid_motion(coarse.position, coarse.plan.rows, twist);
      worst = std::max(worst, (prolonged - expected).norm() / expected.norm());
    }
  }
  return worst;
}

TEST(Multigrid, RigidProlongationsReproduceTheSixMotionsOfTheWhole) {
  const StackedBoxes scene = StackedBoxes::wall(26);
  SerialTeam team;
  MultigridCase one(scene, 1e-3, {Prolongation::plain, Cycle::v});
  EXPECT_LE(rigid_error(one.prepared(team), scene.positions()), 1e-15);
}

TEST(Multigrid, SmoothedProlongationsDoWhereThoseCostNoForce) {
  StackedBoxes scene = StackedBoxes::wall(26);
  scene.lift_off_the_ground();
  SerialTeam team;
  MultigridCase free(scene.matrix(1e-3, 0.0), scene.positions(), {});
  EXPECT_LE(rigid_error(free.prepared(team), scene.positions()), 1e-12);
  // With mass they cost a force, and the error shows.
  MultigridCase heavy(scene.matrix(1e-3, 100.0), scene.positions(), {});
  EXPECT_GE(rigid_error(heavy.prepared(team), scene.positions()), 1e-6);
}

TEST(Multigrid, ThePowerMethodComesCloseToTheLargestEigenvalue) {
  SerialTeam team;
  MultigridCase one(StackedBoxes::wall(18), 1e-3, {});
  const Multigrid grids = one.prepared(team);
  const GridLevel level = grids.level(1);
  const Dense H = to_eigen(level.smoother.H);
  Dense D = Dense::Zero(H.rows(), H.cols());
  for (Index i = 0; i < H.rows(); i += 6) D.block(i, i, 6, 6) = H.block(i, i, 6, 6);
  Vector y(H.rows()), h(H.rows());
  const double found = largest_eigenvalue(team, level.smoother, y.data(), h.data());
  // a D - H is positive definite for an a above the largest eigenvalue of D^-1 H, and not for one below.
  EXPECT_FALSE(is_positive_definite(found * (1.0 - 1e-12) * D - H));
  EXPECT_TRUE(is_positive_definite(kPowerMargin * found * D - H));
}

Index iterations_on(const StackedBoxes& scene) {
  MultigridCase one(scene, 1e-3, {});
  SerialTeam team;
  const Vector b = random_vector(static_cast<Index>(one.size()), 17);
  std::vector<double> x;
  const GradientOutcome outcome = iterate(one.H(), one.prepared(team), {b.begin(), b.end()}, 1e-6, 1000, x);
  EXPECT_TRUE(outcome.is_met);
  const Vector error = to_eigen(one.H()) * Eigen::Map<const Vector>(x.data(), b.size()) - b;
  // The tolerance is of another norm; 100 is more than the two differ by.
  EXPECT_LE(error.norm(), 1e-4 * b.norm());
  return outcome.iterations;
}

TEST(Multigrid, IterationsHardlyGrowWithTheWall) {
  const Index small = iterations_on(StackedBoxes::wall(10)), medium = iterations_on(StackedBoxes::wall(30)),
              large = iterations_on(StackedBoxes::wall(60));
  EXPECT_LE(medium, 2 * small);
  EXPECT_LE(large, 2 * small) << small << ", " << medium << ", " << large;
}

TEST(Multigrid, OpenContactsDoNotTieBodiesTogether) {
  StackedBoxes scene = StackedBoxes::wall(30);
  const Index closed = iterations_on(scene);
  scene.open_beds(20);
  // Without attach_bodies.hpp it is twice as many.
  EXPECT_LE(2 * iterations_on(scene), 3 * closed) << closed;
}

TEST(Multigrid, TheNumberOfLanesChangesNoBit) {
  for (const MultigridOptions& options : kMultigridKinds) {
    const StackedBoxes scene = mixed_scene(13);
    MultigridCase serial(scene, 1e-3, options);
    const Vector r = random_vector(static_cast<Index>(serial.size()), 3);
    SerialTeam alone;
    const Vector expected = cycle(serial.prepared(alone), r);
    const auto expect_same = [&](const MultigridCase& other, const Vector& z, const std::string& who) {
      EXPECT_EQ(std::memcmp(z.data(), expected.data(), sizeof(double) * serial.size()), 0)
          << who << ", " << name(options);
      EXPECT_EQ(std::memcmp(other.memory().data(), serial.memory().data(), sizeof(double) * serial.memory().size()), 0)
          << who << ", " << name(options);
    };
    for (const Index lanes : {1, 3, 32}) {
      MultigridCase there(scene, 1e-3, options);
      Vector z(r.size());
      run_stressed<4>(lanes, [&](auto& team) { there.prepared(team).apply(team, r.data(), z.data()); });
      expect_same(there, z, std::to_string(lanes) + " lanes");
    }
    MultigridCase team_case(scene, 1e-3, options);
    Vector z(r.size());
    cpu::run_team(3, [&](cpu::ThreadTeam& threads, Index rank) {
      ThreadedTeam team(threads, rank);
      team_case.prepared(team).apply(team, r.data(), z.data());
    });
    expect_same(team_case, z, "a team of threads");
  }
}

}  // namespace
}  // namespace stiction::test

#endif
