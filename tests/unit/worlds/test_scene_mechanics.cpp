#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "scenes/geometry.hpp"
#include "scenes/multibody.hpp"
#include "scenes/scenes.hpp"
#include "tests/support/systems/scene_algebra.hpp"

// The mechanics of the scenes against independent knowledge: weights, textbook matrices, rates of theory.

namespace stiction::scenes {
namespace {

constexpr std::uint64_t kSeed = 20240607;

/// Normal impulses with w_n = 0, tangential ones left at zero, by Gauss-Seidel on the dense normal block.
std::vector<double> frictionless_impulses(const SceneEnv& env, const std::vector<double>& velocity) {
  const Dense a = dense_A(env), j = dense_J(env);
  std::vector<std::size_t> normals;
  std::size_t row = 0;
  for (const auto& cone : env.system.cones) {
    normals.push_back(row);
    row += static_cast<std::size_t>(cone.row_count);
  }
  std::vector<double> lambda(normals.size(), 0.0);
  for (int sweep = 0; sweep < 20000; ++sweep) {
    for (std::size_t i = 0; i < normals.size(); ++i) {
      double w = 0;
      for (std::size_t k = 0; k < j.cols; ++k) w += j(normals[i], k) * velocity[k];
      for (std::size_t k = 0; k < normals.size(); ++k) w += a(normals[i], normals[k]) * lambda[k];
      lambda[i] -= w / a(normals[i], normals[i]);
    }
  }
  return lambda;
}

TEST(Scenes, ABoxAtRestIsCarriedByItsWeight) {
  const SceneEnv env = make("stack", kSeed, 0, 1);
  ASSERT_EQ(env.dof_count, 6);
  ASSERT_EQ(rows_of(env), 12U);
  const double mass = dense_M(env)(0, 0);
  EXPECT_NEAR(mass, 4.0, 0.8);  // a cube of 0.2 m at 500 kg/m^3, give or take a fifth
  const std::vector<double> lambda = frictionless_impulses(env, {0, 0, -kGravity * kTimeStep, 0, 0, 0});
  double sum = 0;
  for (const double value : lambda) sum += value;
  EXPECT_NEAR(sum, mass * kGravity * kTimeStep, 1e-9);
}

TEST(Scenes, TheFreeVelocityOfABoxIsItsOwnPlusGravity) {
  // Velocities before the step are below 0.02 m/s and 0.1 rad/s, gravity adds 0.049 m/s downwards.
  for (std::uint64_t i = 0; i < 50; ++i) {
    const SceneEnv env = make("stack", kSeed, i, 1);
    EXPECT_LE(std::abs(env.v_free[0]), 0.02);
    EXPECT_NEAR(env.v_free[2], -kGravity * kTimeStep, 0.02);
    EXPECT_LE(std::abs(env.v_free[5]), 0.1);
  }
}

TEST(Scenes, EveryContactOfAColumnCarriesWhatStandsOnIt) {
  constexpr int kBodies = 10;
  const SceneEnv env = make("column", kSeed, 0, kBodies);
  const Dense a = dense_A(env);
  for (std::size_t i = 0; i < kBodies; ++i) {
    for (std::size_t k = 0; k < kBodies; ++k) {
      EXPECT_EQ(a(i, k), i == k ? (i == 0 ? 1 : 2) : (i + 1 == k || k + 1 == i ? -1 : 0));
    }
  }
  const std::vector<double> lambda = frictionless_impulses(env, std::vector<double>(kBodies, -kGravity * kTimeStep));
  for (std::size_t i = 0; i < kBodies; ++i) {
    EXPECT_NEAR(lambda[i], static_cast<double>(kBodies - i) * kGravity * kTimeStep, 1e-9);
  }
}

TEST(Scenes, GaussSeidelOnAColumnConvergesAtTheRateOfTheory) {
  // The Jacobi matrix, scaled to be symmetric, is tridiagonal with 1/2 beside the diagonal, but 1/sqrt(2) at the
  // ground. Its eigenvalues are cos((2 k - 1) pi / (2 n)), those of Gauss-Seidel their squares. Some n^2 sweeps.
  constexpr std::size_t kBodies = 10;
  const Dense a = dense_A(make("column", kSeed, 0, kBodies));
  std::vector<double> lambda(kBodies, 0.0);
  double error = 1, rate = 0;
  for (int sweep = 0; sweep < 500; ++sweep) {
    double squares = 0;
    for (std::size_t i = 0; i < kBodies; ++i) {
      double w = i == 0 ? -1 : 0;
      for (std::size_t k = 0; k < kBodies; ++k) w += a(i, k) * lambda[k];
      lambda[i] = std::max(0.0, lambda[i] - w / a(i, i));
    }
    for (std::size_t i = 0; i < kBodies; ++i) {
      const double difference = lambda[i] - static_cast<double>(kBodies - i);
      squares += difference * difference;
    }
    rate = std::sqrt(squares) / error;
    error = std::sqrt(squares);
  }
  const double cosine = std::cos(3.141592653589793 / (2 * kBodies));
  EXPECT_NEAR(rate, cosine * cosine, 1e-9);
}

TEST(Scenes, AWalkersTrunkCarriesTheWholeRobotAndItsFeetFollowIt) {
  for (std::uint64_t i = 0; i < 20; ++i) {
    const SceneEnv env = make("walker", kSeed, i);
    ASSERT_EQ(env.dof_count, 18);
    const Dense m = dense_M(env), j = dense_J(env);
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(m(k, k), 6.0 + 4 * (0.6 + 0.9 + 0.2), 1e-12);
    // Translating the trunk with locked joints translates every foot: the columns are the contact frame.
    std::size_t row = 0;
    for (const auto& cone : env.system.cones) {
      if (cone.kind == ConeKind::friction) {
        for (std::size_t p = 0; p < 3; ++p) {
          for (std::size_t q = 0; q < 3; ++q) {
            double product = 0;
            for (std::size_t k = 0; k < 3; ++k) product += j(row + p, k) * j(row + q, k);
            EXPECT_NEAR(product, p == q ? 1 : 0, 1e-14);
          }
        }
        EXPECT_GT(j(row, 2), 0.9) << "the ground's normal points up";
      }
      row += static_cast<std::size_t>(cone.row_count);
    }
  }
}

TEST(Scenes, AHandHasTorsionalContactsLimitsAndJointFriction) {
  std::map<ConeKind, std::size_t> kinds;
  bool table = false;
  for (std::uint64_t i = 0; i < 50; ++i) {
    const SceneEnv env = make("grasp", kSeed, i);
    EXPECT_EQ(env.dof_count, 6 + 4 * 4);
    std::size_t torsional = 0;
    for (const auto& cone : env.system.cones) {
      ++kinds[cone.kind];
      torsional += cone.row_count == 4 ? 1 : 0;
    }
    EXPECT_EQ(torsional, 4U);
    table = table || contact_count(env) == 8;
  }
  EXPECT_EQ(kinds[ConeKind::box], 50U * 16U);
  EXPECT_GT(kinds[ConeKind::unilateral], 0U);
  EXPECT_TRUE(table);
}

TEST(SceneMath, SineAndCosineAgreeWithTheLibrarysToRounding) {
  for (int k = -1000; k <= 1000; ++k) {
    const double angle = 3.141592653589793 * k / 1000;
    const auto [s, c] = sin_cos(angle);
    EXPECT_NEAR(s, std::sin(angle), 1e-14);
    EXPECT_NEAR(c, std::cos(angle), 1e-14);
  }
}

TEST(SceneMath, TheMassMatrixOfADoublePendulumIsTheTextbooks) {
  const double m1 = 2, m2 = 3, l1 = 0.5, l2 = 0.7, q2 = 0.6;
  const auto [s, c] = sin_cos(q2);
  Multibody bodies;
  const Index first = bodies.add_hinge(kWorld, {0, 1, 0}, {0, 0, 0}, 0);
  const Vec3 elbow{l1, 0, 0};
  const Vec3 end = elbow + Vec3{l2 * c, 0, -l2 * s};
  const Index second = bodies.add_hinge(first, {0, 1, 0}, elbow, 0);
  bodies.add_mass(first, m1, elbow, {{}, {}, {}});
  bodies.add_mass(second, m2, end, {{}, {}, {}});
  const std::vector<double> m = bodies.mass_block(0, 2);
  EXPECT_NEAR(m[0], m1 * l1 * l1 + m2 * (l1 * l1 + l2 * l2 + 2 * l1 * l2 * c), 1e-14);
  EXPECT_NEAR(m[1], m2 * (l2 * l2 + l1 * l2 * c), 1e-14);
  EXPECT_EQ(m[2], m[1]);
  EXPECT_NEAR(m[3], m2 * l2 * l2, 1e-14);
  // Gravity turns the arm with its weights' levers.
  const std::vector<double> impulse = bodies.step_impulse();
  EXPECT_NEAR(impulse[0], kTimeStep * kGravity * (m1 * l1 + m2 * (l1 + l2 * c)), 1e-14);
  EXPECT_NEAR(impulse[1], kTimeStep * kGravity * m2 * l2 * c, 1e-14);
}

TEST(SceneMath, RandomRotationsAreOrthonormalAndRightHanded) {
  Rng rng(42);
  for (int k = 0; k < 100; ++k) {
    const Mat3 r = random_rotation(rng);
    EXPECT_NEAR(dot(r.x, r.y), 0, 1e-14);
    EXPECT_NEAR(norm(r.z), 1, 1e-14);
    const Vec3 z = cross(r.x, r.y);
    EXPECT_NEAR(dot(z, r.z), 1, 1e-14);
  }
}

}  // namespace
}  // namespace stiction::scenes
