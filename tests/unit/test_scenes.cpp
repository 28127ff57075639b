#include "bench/scenes/scenes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <ostream>
#include <set>

#include "bench/scenes/geometry.hpp"
#include "bench/scenes/multibody.hpp"
#include "stiction/batch.hpp"
#include "stiction/error.hpp"
#include "stiction/hash.hpp"

namespace stiction::scenes {
namespace {

/// Dense row-major matrix; what the scenes compute sparsely is checked densely, by another method.
struct Dense {
  std::size_t rows = 0, cols = 0;
  std::vector<double> value;
  Dense(std::size_t r, std::size_t c) : rows(r), cols(c), value(r * c, 0.0) {}
  double& operator()(std::size_t i, std::size_t j) { return value[i * cols + j]; }
  double operator()(std::size_t i, std::size_t j) const { return value[i * cols + j]; }
};

template <class Pointers, class Columns>
Dense densify(const Pointers& ptr, const Columns& col, const std::vector<double>& val, std::size_t cols) {
  Dense dense(ptr.size() - 1, cols);
  for (std::size_t i = 0; i + 1 < ptr.size(); ++i) {
    for (auto k = static_cast<std::size_t>(ptr[i]); k < static_cast<std::size_t>(ptr[i + 1]); ++k) {
      dense(i, static_cast<std::size_t>(col[k])) += val[k];
    }
  }
  return dense;
}

std::size_t rows_of(const SceneEnv& env) {
  return env.system.b.size();
}
Dense dense_A(const SceneEnv& env) {
  return densify(env.system.row_offsets, env.system.column, env.system.A, rows_of(env));
}
Dense dense_J(const SceneEnv& env) {
  return densify(env.J.ptr, env.J.col, env.J.val, static_cast<std::size_t>(env.dof_count));
}
Dense dense_M(const SceneEnv& env) {
  return densify(env.M.ptr, env.M.col, env.M.val, static_cast<std::size_t>(env.dof_count));
}

/// X with M X = B by Gaussian elimination with partial pivoting.
Dense gauss_solve(Dense m, Dense b) {
  const std::size_t n = m.rows;
  for (std::size_t k = 0; k < n; ++k) {
    std::size_t pivot = k;
    for (std::size_t i = k + 1; i < n; ++i) {
      if (std::abs(m(i, k)) > std::abs(m(pivot, k))) pivot = i;
    }
    for (std::size_t j = 0; j < n; ++j) std::swap(m(k, j), m(pivot, j));
    for (std::size_t j = 0; j < b.cols; ++j) std::swap(b(k, j), b(pivot, j));
    for (std::size_t i = 0; i < n; ++i) {
      if (i == k || m(i, k) == 0) continue;
      const double factor = m(i, k) / m(k, k);
      for (std::size_t j = k; j < n; ++j) m(i, j) -= factor * m(k, j);
      for (std::size_t j = 0; j < b.cols; ++j) b(i, j) -= factor * b(k, j);
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < b.cols; ++j) b(i, j) /= m(i, i);
  }
  return b;
}

/// The smallest pivot of the Cholesky factorisation of A scaled to a unit diagonal, plus shift; positive exactly
/// when the shifted matrix is positive definite.
double smallest_pivot(Dense a, double shift) {
  const std::size_t n = a.rows;
  std::vector<double> scale(n);
  for (std::size_t i = 0; i < n; ++i) scale[i] = 1 / std::sqrt(a(i, i));
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) a(i, j) *= scale[i] * scale[j];
    a(i, i) += shift;
  }
  double smallest = 1;
  for (std::size_t k = 0; k < n; ++k) {
    smallest = std::min(smallest, a(k, k));
    if (!(a(k, k) > 0)) return a(k, k);
    for (std::size_t i = k + 1; i < n; ++i) {
      const double factor = a(i, k) / a(k, k);
      for (std::size_t j = k + 1; j < n; ++j) a(i, j) -= factor * a(k, j);
    }
  }
  return smallest;
}

std::size_t contact_count(const SceneEnv& env) {
  return static_cast<std::size_t>(std::count_if(env.system.cones.begin(), env.system.cones.end(),
                                                [](const auto& cone) { return cone.kind == ConeKind::friction; }));
}

/// Everything an environment holds, in one number.
std::uint64_t hash_of(const SceneEnv& env) {
  std::uint64_t hash = 0;
  const auto add = [&](std::span<const double> values) { hash = hash * 0x100000001b3ULL + hash_bits(values); };
  const auto add_integers = [&](const auto& values) {
    const std::vector<double> as_doubles(values.begin(), values.end());
    add(as_doubles);
  };
  const auto& s = env.system;
  for (const auto* values : {&s.A, &s.b, &s.R, &s.mu, &s.lo, &s.hi, &env.M.val, &env.J.val, &env.v_free}) add(*values);
  add(env.row_target);
  for (const auto* values : {&s.row_offsets, &s.column, &env.M.ptr, &env.M.col, &env.J.ptr, &env.J.col}) {
    add_integers(*values);
  }
  std::vector<double> cones;
  for (const auto& cone : s.cones) {
    cones.insert(cones.end(), {static_cast<double>(cone.kind), static_cast<double>(cone.row_count),
                               static_cast<double>(cone.group)});
  }
  add(cones);
  return hash;
}

constexpr std::uint64_t kSeed = 20240607;

}  // namespace

/// GoogleTest's way to print a parameter.
void PrintTo(const SceneInfo& info, std::ostream* out) {
  *out << info.name;
}

namespace {

class EveryScene : public testing::TestWithParam<SceneInfo> {
 protected:
  /// The environments the checks go over: more than one round of the adversarial kinds.
  static constexpr std::uint64_t kEnvs = 16;
  static SceneEnv env(std::uint64_t index, int size = 0) { return make(GetParam().name, kSeed, index, size); }
  /// Small enough for dense algebra: chains in `mixed` reach thousands of rows.
  static bool is_small(const SceneEnv& e) { return rows_of(e) <= 600; }
};

TEST_P(EveryScene, GivesABatchWithoutDefects) {
  ContactBatch<double> batch(GetParam().law);
  for (std::uint64_t i = 0; i < kEnvs; ++i) batch.add(env(i).system);
  for (const Defect& defect : validate(batch.view())) ADD_FAILURE() << defect.message;
  EXPECT_EQ(batch.env_count(), static_cast<Offset>(kEnvs));
}

TEST_P(EveryScene, ADelassusOperatorThatIsSymmetricToTheBit) {
  for (std::uint64_t i = 0; i < kEnvs; ++i) {
    const SceneEnv e = env(i);
    if (!is_small(e)) continue;
    const Dense a = dense_A(e);
    for (std::size_t r = 0; r < a.rows; ++r) {
      for (std::size_t c = 0; c < r; ++c) ASSERT_EQ(a(r, c), a(c, r)) << "environment " << i;
    }
  }
}

TEST_P(EveryScene, ADelassusOperatorThatIsJMinvJtByGaussianElimination) {
  for (std::uint64_t i = 0; i < 8; ++i) {
    const SceneEnv e = env(i);
    if (!is_small(e)) continue;
    const Dense j = dense_J(e), a = dense_A(e);
    Dense jt(j.cols, j.rows);
    for (std::size_t r = 0; r < j.rows; ++r) {
      for (std::size_t c = 0; c < j.cols; ++c) jt(c, r) = j(r, c);
    }
    const Dense x = gauss_solve(dense_M(e), jt);
    for (std::size_t r = 0; r < j.rows; ++r) {
      for (std::size_t c = 0; c < j.rows; ++c) {
        double expected = 0;
        for (std::size_t k = 0; k < j.cols; ++k) expected += j(r, k) * x(k, c);
        ASSERT_NEAR(a(r, c), expected, 1e-11 * std::sqrt(a(r, r) * a(c, c))) << "environment " << i;
      }
    }
  }
}

TEST_P(EveryScene, ADelassusOperatorThatIsPositiveSemidefinite) {
  for (std::uint64_t i = 0; i < kEnvs; ++i) {
    const SceneEnv e = env(i);
    if (is_small(e)) {
      EXPECT_GT(smallest_pivot(dense_A(e), 1e-9), 0) << "environment " << i;
    }
  }
}

TEST_P(EveryScene, AMassMatrixThatIsPositiveDefinite) {
  for (std::uint64_t i = 0; i < kEnvs; ++i) {
    const SceneEnv e = env(i);
    if (is_small(e)) {
      EXPECT_GT(smallest_pivot(dense_M(e), 0), 1e-6) << "environment " << i;
    }
  }
}

TEST_P(EveryScene, ARightHandSideThatIsJTimesVFreeMinusTheTarget) {
  for (std::uint64_t i = 0; i < kEnvs; ++i) {
    const SceneEnv e = env(i);
    if (!is_small(e)) continue;
    const Dense j = dense_J(e);
    for (std::size_t r = 0; r < j.rows; ++r) {
      double expected = -e.row_target[r], size = std::abs(e.row_target[r]);
      for (std::size_t k = 0; k < j.cols; ++k) {
        expected += j(r, k) * e.v_free[k];
        size += std::abs(j(r, k) * e.v_free[k]);
      }
      ASSERT_NEAR(e.system.b[r], expected, 1e-14 * size) << "environment " << i << " row " << r;
    }
  }
}

TEST_P(EveryScene, ComplianceThatFitsItsLaw) {
  for (std::uint64_t i = 0; i < kEnvs; ++i) {
    const SceneEnv e = env(i);
    if (!is_small(e)) continue;
    const Dense a = dense_A(e);
    for (std::size_t r = 0; r < a.rows; ++r) {
      // A torsional row's compliance follows the ratio of the friction coefficients, not its own diagonal.
      if (GetParam().law == Law::convex) {
        EXPECT_GT(e.system.R[r], 0);
      }
      if (GetParam().law == Law::coulomb && GetParam().name != "mixed") {
        EXPECT_EQ(e.system.R[r], 0);
      }
    }
    if (GetParam().law == Law::convex) {
      std::size_t row = 0;
      for (const auto& cone : e.system.cones) {
        EXPECT_GE(e.system.R[row], 0.999e-3 * a(row, row));
        EXPECT_LE(e.system.R[row], 1.001e-2 * a(row, row));
        row += static_cast<std::size_t>(cone.row_count);
      }
    }
  }
}

TEST_P(EveryScene, AnEnvironmentThatDependsOnItsIndexAlone) {
  const std::uint64_t alone = hash_of(env(5));
  std::set<std::uint64_t> hashes;
  for (std::uint64_t i = kEnvs; i-- > 0;) {
    const std::uint64_t hash = hash_of(env(i));
    hashes.insert(hash);
    if (i == 5) {
      EXPECT_EQ(hash, alone);
    }
  }
  EXPECT_EQ(hashes.size(), kEnvs) << "two indices gave the same environment";
  EXPECT_NE(hash_of(make(GetParam().name, kSeed + 1, 5)), alone) << "the seed has no effect";
}

TEST_P(EveryScene, TheBitsOfTheGoldenTable) {
  const std::map<std::string, std::uint64_t> golden{
      {"stack", 0xbaddebd7343b4b92ULL},       {"wall", 0x14b04c70c4ea1f32ULL},   {"pyramid", 0xdf6586bcb63f17b6ULL},
      {"pile", 0x5e8992d98b0eee56ULL},        {"chain", 0x502088e38836991cULL},  {"column", 0x4517f5a53d04a4c6ULL},
      {"grasp", 0x30e0a02e086a894eULL},       {"walker", 0x31199ff4122fe1b7ULL}, {"mixed", 0xc6e65cacd9225107ULL},
      {"adversarial", 0xfd8dcb428ea8ea52ULL},
  };
  std::uint64_t hash = 0;
  for (std::uint64_t i = 0; i < 8; ++i) hash = hash * 31 + hash_of(env(i));
  ASSERT_TRUE(golden.contains(GetParam().name));
  EXPECT_EQ(hash, golden.at(GetParam().name)) << std::hex << "0x" << hash << "ULL is what this build computes";
}

INSTANTIATE_TEST_SUITE_P(Scenes, EveryScene, testing::ValuesIn(list()),
                         [](const auto& test) { return test.param.name; });

TEST(Scenes, AnUnknownNameIsRefusedWithTheNamesThereAre) {
  try {
    make("tower", 1, 0);
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::invalid_argument);
    for (const SceneInfo& info : list()) EXPECT_NE(std::string(error.what()).find(info.name), std::string::npos);
  }
}

TEST(Scenes, ASizeOutOfRangeIsRefusedWithTheRange) {
  EXPECT_THROW(make("stack", 1, 0, -1), Error);
  EXPECT_THROW(make("pyramid", 1, 0, 31), Error);
  try {
    make("adversarial", 1, 0, 9);
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("1 to 8"), std::string::npos) << error.what();
  }
}

TEST(Scenes, SizeZeroIsTheDefaultSize) {
  EXPECT_EQ(hash_of(make("stack", 3, 4, 0)), hash_of(make("stack", 3, 4, 5)));
  EXPECT_NE(hash_of(make("stack", 3, 4, 0)), hash_of(make("stack", 3, 4, 6)));
}

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
  // ground: its eigenvalues are cos((2 k - 1) pi / (2 n)), those of Gauss-Seidel their squares. Some n^2 sweeps.
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

TEST(Scenes, MixedCoversEmptyAndLargeEnvironmentsAndKeepsItsLimit) {
  std::size_t empty = 0, large = 0;
  std::set<std::size_t> counts;
  for (std::uint64_t i = 0; i < 400; ++i) {
    const SceneEnv env = make("mixed", kSeed, i);
    const std::size_t contacts = contact_count(env);
    counts.insert(contacts);
    empty += rows_of(env) == 0 ? 1 : 0;
    large += contacts >= 250 ? 1 : 0;
    ASSERT_LE(contacts, 300U);
    EXPECT_LE(contact_count(make("mixed", kSeed, i, 16)), 16U);
  }
  EXPECT_GE(empty, 20U);
  EXPECT_GE(large, 1U);
  EXPECT_GE(counts.size(), 40U) << "sizes should be ragged";
}

TEST(Scenes, AdversarialReachesTheExtremesItPromises) {
  double heaviest = 0, lightest = 1e9, largest_mu = 0;
  std::size_t most_contacts = 0, frictionless_axes = 0, anisotropic = 0;
  for (std::uint64_t i = 0; i < 40; ++i) {
    const SceneEnv env = make("adversarial", kSeed, i);
    if (i % 8 == 0) {
      const Dense m = dense_M(env);
      heaviest = std::max(heaviest, m(m.rows - 6, m.rows - 6));
      lightest = std::min(lightest, m(0, 0));
    }
    most_contacts = std::max(most_contacts, contact_count(env));
    std::size_t row = 0;
    for (const auto& cone : env.system.cones) {
      frictionless_axes += env.system.mu[row + 1] == 0 ? 1 : 0;
      anisotropic += env.system.mu[row + 1] != env.system.mu[row + 2] ? 1 : 0;
      row += static_cast<std::size_t>(cone.row_count);
    }
    largest_mu = std::max(largest_mu, *std::max_element(env.system.mu.begin(), env.system.mu.end()));
  }
  EXPECT_EQ(heaviest / lightest, 1e6);
  EXPECT_EQ(most_contacts, 64U);
  EXPECT_EQ(largest_mu, 2.0);
  EXPECT_GT(frictionless_axes, 0U);
  EXPECT_GT(anisotropic, 0U);
}

TEST(Scenes, LayoutsHaveTheContactsOneCountsOnPaper) {
  EXPECT_EQ(contact_count(make("stack", 1, 0, 7)), 28U);
  EXPECT_EQ(contact_count(make("wall", 1, 0, 3)), 60U);           // ground 12, two beds of 24
  EXPECT_EQ(contact_count(make("pyramid", 1, 0, 3)), 36U + 80U);  // ground 9 boxes, then 5 boxes on 4 each
  EXPECT_EQ(rows_of(make("chain", 1, 0, 20)), 60U + 30U);
}

TEST(Scenes, ContactsOfOneBodyPairShareAGroup) {
  const SceneEnv env = make("stack", 1, 0, 3);
  for (std::size_t k = 0; k < env.system.cones.size(); ++k) {
    EXPECT_EQ(env.system.cones[k].group, static_cast<Index>(k / 4));
  }
}

TEST(Scenes, ALargeWallStaysSparse) {
  const SceneEnv env = make("wall", 1, 0, 20);
  EXPECT_EQ(contact_count(env), 8U * 400U - 80U);
  EXPECT_LT(env.system.A.size() / rows_of(env), 100U);
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
