#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <ostream>
#include <set>

#include "scenes/scenes.hpp"
#include "stiction/batch.hpp"
#include "stiction/error.hpp"
#include "stiction/hash.hpp"
#include "tests/support/systems/scene_algebra.hpp"

namespace stiction::scenes {
namespace {

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

}  // namespace
}  // namespace stiction::scenes
