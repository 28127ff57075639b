#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <set>
#include <string_view>
#include <utility>

#include "tests/support/golden.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

void print(const Golden& golden) {
  std::printf("    {\"%s\", SolverKind::%s, Precision::%s, Law::%s, 0x%016llxULL},\n", golden.scene,
              to_string(golden.solver), to_string(golden.precision), to_string(golden.law),
              static_cast<unsigned long long>(golden.hash));
}

TEST(Golden, TheAnswersOfEverySceneSolverPrecisionAndLawHaveTheBitsOfThisNumericsEpoch) {
  const std::vector<Golden> now = compute_goldens();
  ASSERT_EQ(goldens().size(), now.size()) << "tools/update_goldens.py writes the table anew";
  for (std::size_t i = 0; i < now.size(); ++i) {
    SCOPED_TRACE(std::string(now[i].scene) + ", " + to_string(now[i].solver) + ", " + to_string(now[i].precision) +
                 ", " + to_string(now[i].law));
    const Golden& then = goldens()[i];
    EXPECT_STREQ(then.scene, now[i].scene);
    EXPECT_EQ(then.solver, now[i].solver);
    EXPECT_EQ(then.precision, now[i].precision);
    EXPECT_EQ(then.law, now[i].law);
    EXPECT_EQ(then.hash, now[i].hash) << "a change of bits raises kNumericsEpoch and is named in CHANGELOG.md";
  }
}

/// Where subspace never leaps and so has the bits of npgs (sliding contacts under Coulomb's law, more than 40 rows), or
/// where none of its leaps makes the residual of any environment smaller (docs/math/subspace.md).
bool may_only_sweep(const Golden& golden) {
  const std::string_view scene = golden.scene;
  return golden.solver == SolverKind::subspace && (golden.law == Law::coulomb || scene == "pile" || scene == "grasp" ||
                                                   (scene == "stack" && golden.precision == Precision::f32));
}

TEST(Golden, EverySceneOfTheTableIsSolvedDifferentlyByEverySolverPrecisionAndLaw) {
  std::set<std::uint64_t> hashes;
  std::size_t rows = 0;
  for (const Golden& golden : goldens()) {
    if (may_only_sweep(golden)) continue;
    hashes.insert(golden.hash);
    ++rows;
  }
  EXPECT_EQ(hashes.size(), rows) << "two rows agree: one of the options does not reach the solver";
}

TEST(Golden, SubspaceLeapsSomewhereUnderEitherLawAndInEitherPrecision) {
  std::set<std::uint64_t> swept;
  for (const Golden& golden : goldens())
    if (golden.solver != SolverKind::subspace) swept.insert(golden.hash);
  std::set<std::pair<Law, Precision>> leaps;
  std::size_t scenes = 0;
  for (const Golden& golden : goldens())
    if (golden.solver == SolverKind::subspace && swept.count(golden.hash) == 0) {
      leaps.insert({golden.law, golden.precision});
      ++scenes;
    }
  EXPECT_EQ(leaps.size(), 4U);
  EXPECT_GE(scenes, 8U);
}

TEST(Golden, BothPathsAndEveryKindOfConeAreInTheTable) {
  std::set<ConeKind> kinds;
  std::size_t largest = 0;
  for (const GoldenScene& golden : kGoldenScenes) {
    const auto batch = scene_batch(golden.scene, golden.envs, kGoldenSeed, golden.size);
    const auto& arrays = batch.arrays();
    kinds.insert(arrays.cone_kind.begin(), arrays.cone_kind.end());
    for (std::size_t e = 0; e + 1 < arrays.env_row_offsets.size(); ++e)
      largest = std::max(largest, static_cast<std::size_t>(arrays.env_row_offsets[e + 1] - arrays.env_row_offsets[e]));
  }
  EXPECT_EQ(kinds.size(), 4U);
  EXPECT_GT(largest, 64U) << "up to 64 rows every environment is dense";
}

}  // namespace

/// `--print-goldens` writes the table that this build computes, for tools/update_goldens.py.
int main(int argc, char** argv) {
  if (argc == 2 && std::strcmp(argv[1], "--print-goldens") == 0) {
    for (const Golden& golden : compute_goldens()) print(golden);
    return 0;
  }
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
