#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <iterator>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "tests/support/golden/cases.hpp"
#include "tests/support/machines/scoped_isa.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

TEST(Golden, TheTableHasTheRowsThatThisBuildComputesInTheirOrder) {
  std::vector<std::string> computed, kept;
  for (const GoldenCase& row : golden_cases()) computed.push_back(row.name);
  for (const Golden& golden : kGoldens) kept.emplace_back(golden.name);
  EXPECT_EQ(kept, computed) << "tools/update_goldens.py writes the table anew";
  EXPECT_EQ(goldens().size(), kept.size()) << "two rows have one name";
}

/// The builds of the library, and the widths that tests add.
std::vector<const char*> every_isa() {
  std::vector<const char*> names(std::begin(kShippedIsas), std::end(kShippedIsas));
#if defined(STICTION_TEST_PACK_WIDTHS)
  names.insert(names.end(), std::begin(kTestedWidths), std::end(kTestedWidths));
#endif
  return names;
}

/// Returns true if a row has code of an instruction set's own. The widths that tests add have packs, and take all else
/// from the baseline or from AVX2 (tests/isa/pack_width.cpp).
bool is_computed_on(const std::string& row, std::string_view isa) {
  if (std::find(std::begin(kTestedWidths), std::end(kTestedWidths), isa) == std::end(kTestedWidths)) return true;
  for (const char* method : {"/admm", "/newton", "/lemke", "/ipm"})
    if (row.find(method) != std::string::npos) return false;
  return true;
}

class GoldenOn : public testing::TestWithParam<const char*> {};

TEST_P(GoldenOn, EveryAnswerHasTheBitsOfThisNumericsEpoch) {
  if (cpu::find_isa(GetParam()) == nullptr) GTEST_SKIP() << GetParam() << " not run here";
  const ScopedIsa isa(GetParam());
  ASSERT_STREQ(cpu::best_isa().name, GetParam());
  for (const GoldenCase& row : golden_cases()) {
    const auto then = goldens().find(row.name);
    if (then == goldens().end()) continue;  // the test of the names reports it
    if (!is_computed_on(row.name, GetParam())) continue;
    EXPECT_EQ(then->second, row.hash(Device::cpu()))
        << row.name << ": a change of bits raises kNumericsEpoch and is named in CHANGELOG.md";
  }
}

INSTANTIATE_TEST_SUITE_P(InstructionSets, GoldenOn, testing::ValuesIn(every_isa()),
                         [](const auto& isa) { return std::string(isa.param); });

/// The parts of a row's name.
std::vector<std::string> parts_of(std::string_view name) {
  std::vector<std::string> parts(1);
  for (const char c : name)
    if (c == '/') {
      parts.emplace_back();
    } else {
      parts.back() += c;
    }
  return parts;
}

/// Returns true if subspace never leaps and so has the bits of npgs (sliding contacts under Coulomb's law, more than
/// 40 rows). Or where none of its leaps makes the residual of any environment smaller (docs/math/subspace.md).
bool may_only_sweep(const std::vector<std::string>& row) {
  return row[0] == "matrix" && row[2] == "subspace" &&
         (row[4] == "coulomb" || row[1] == "pile" || row[1] == "grasp" || (row[1] == "stack" && row[3] == "f32"));
}

/// The name of the row whose bits this one may have, or its own: the only rows that may agree.
std::string may_agree_with(const std::string& name) {
  std::vector<std::string> row = parts_of(name);
  if (may_only_sweep(row)) row[2] = "npgs";
  // The stage of auto that answers takes the way that its solver takes alone.
  if (row[0] == "pyramid" && row[2] == "auto") row[2] = "ipm";
  // A factor without fill is whole, where few bodies touch or each the next.
  if (row[0] == "bodies" && (row[1] == "crowd" || row[1] == "stack") && row[2] == "newton incomplete_cholesky")
    row[2] = "newton factor";
  // A direct solve in double, rounded to single precision, does not show in which order it eliminated.
  if (row[0] == "bodies" && row[2] == "newton factor natural" && row[3] == "f32") row[2] = "newton factor";
  // Balls that bounce upright have no friction for a law to differ in.
  if (row[0] == "worlds" && row[1] == "bounce") row[4] = "either law";
  std::string result = row[0];
  for (std::size_t k = 1; k < row.size(); ++k) result += "/" + row[k];
  return result;
}

TEST(Golden, EveryOptionReachesTheBits) {
  std::map<std::uint64_t, std::string> first;
  for (const Golden& golden : kGoldens) {
    const auto [before, is_new] = first.emplace(golden.hash, golden.name);
    EXPECT_TRUE(is_new || may_agree_with(before->second) == may_agree_with(golden.name))
        << before->second << " and " << golden.name << " agree: one of their options does not reach the solver";
  }
}

TEST(Golden, SubspaceLeapsSomewhereUnderEitherLawAndInEitherPrecision) {
  std::set<std::uint64_t> swept;
  for (const Golden& golden : kGoldens)
    if (parts_of(golden.name)[2] != "subspace") swept.insert(golden.hash);
  std::set<std::string> leaps;
  std::size_t scenes = 0;
  for (const Golden& golden : kGoldens) {
    const std::vector<std::string> row = parts_of(golden.name);
    if (row[0] != "matrix" || row[2] != "subspace" || swept.count(golden.hash) != 0) continue;
    leaps.insert(row[3] + "/" + row[4]);
    ++scenes;
  }
  EXPECT_EQ(leaps.size(), 4U);
  EXPECT_GE(scenes, 8U);
}

TEST(Golden, EveryRowHasOneOfTheForms) {
  std::size_t rows = golden_cases_of(kGoldenDerivatives).size();
  EXPECT_EQ(rows, 32U);
  for (const char* form : kGoldenForms) {
    EXPECT_FALSE(golden_cases_of(form).empty()) << form;
    rows += golden_cases_of(form).size();
  }
  EXPECT_EQ(rows, std::size(kGoldens));
}

TEST(Golden, EverySolverPreconditionerAndWorldIsInTheTable) {
  std::set<std::string> methods;
  std::set<std::string> worlds;
  for (const Golden& golden : kGoldens) {
    const std::vector<std::string> parts = parts_of(golden.name);
    ASSERT_GE(parts.size(), 4U) << golden.name;
    methods.insert(parts[2]);
    if (parts[0] == "worlds") worlds.insert(parts[1]);
  }
  for (int k = 0; k < kSolverKindCount; ++k)
    EXPECT_EQ(methods.count(to_string(static_cast<SolverKind>(k))), 1U) << to_string(static_cast<SolverKind>(k));
  EXPECT_EQ(methods.count(to_string(SolverKind::automatic)), 1U);
  for (int k = 0; k < kBodyPreconditionerCount; ++k) {
    const std::string name = to_string(static_cast<BodyPreconditioner>(k));
    EXPECT_EQ(methods.count("newton " + name), 1U) << name;
  }
  const std::vector<std::string> names = scenes::world_names();
  EXPECT_EQ(worlds, std::set<std::string>(names.begin(), names.end()));
}

TEST(Golden, BothPathsAndEveryKindOfConeAreInTheTable) {
  std::set<ConeKind> kinds;
  std::size_t largest = 0;
  for (const GoldenScene& golden : kGoldenScenes) {
    const auto batch = golden_batch(golden);
    const auto& arrays = batch.arrays();
    kinds.insert(arrays.cone_kind.begin(), arrays.cone_kind.end());
    for (std::size_t e = 0; e + 1 < arrays.env_row_offsets.size(); ++e)
      largest = std::max(largest, static_cast<std::size_t>(arrays.env_row_offsets[e + 1] - arrays.env_row_offsets[e]));
  }
  EXPECT_EQ(kinds.size(), 4U);
  const auto boxed = with_box_friction(golden_batch(kGoldenScenes[0]));
  EXPECT_EQ(boxed.arrays().cone_kind.front(), ConeKind::box_friction) << "the fifth kind has rows of its own";
  EXPECT_GT(largest, 64U) << "up to 64 rows every environment is dense";
}

}  // namespace

/// `--print-goldens` writes the table that this build computes, for tools/update_goldens.py.
int main(int argc, char** argv) {
  if (argc == 2 && std::strcmp(argv[1], "--print-goldens") == 0) {
    for (const GoldenCase& row : golden_cases())
      std::printf("    {\"%s\", 0x%016llxULL},\n", row.name.c_str(),
                  static_cast<unsigned long long>(row.hash(Device::cpu())));
    return 0;
  }
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
