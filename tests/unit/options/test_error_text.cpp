#include <gtest/gtest.h>

#include <iterator>
#include <set>
#include <string>

#include "stiction/error.hpp"
#include "stiction/status.hpp"

namespace {

using namespace stiction;

TEST(ErrorText, EveryCodeAndFlagHasANameOfItsOwn) {
  std::set<std::string> codes, flags;
  for (int code = 0; code < kEnvCodeCount; ++code) codes.insert(to_string(static_cast<EnvCode>(code)));
  for (int bit = 0; bit < kEnvFlagCount; ++bit) flags.insert(flag_name(static_cast<EnvFlag>(1U << bit)));
  EXPECT_EQ(codes, (std::set<std::string>{"solved", "max_iterations", "stalled", "numerical", "invalid_input",
                                          "unsupported", "rounding", "infeasible"}));
  EXPECT_EQ(flags,
            (std::set<std::string>{"non_finite_input", "negative_friction", "crossed_bounds", "negative_compliance",
                                   "bad_diagonal", "warm_start_rejected", "asymmetric", "contacts_dropped", "bad_mass",
                                   "over_capacity", "bad_structure", "unsupported_cone", "ray", "immovable"}));
}

TEST(ErrorText, LawsPrecisionsAndKindsAreNamedAsInFilesAndOnTheCommandLine) {
  EXPECT_STREQ(to_string(Law::convex), "convex");
  EXPECT_STREQ(to_string(Law::coulomb), "coulomb");
  EXPECT_STREQ(to_string(Precision::f32), "f32");
  EXPECT_STREQ(to_string(Precision::f64), "f64");
  EXPECT_STREQ(to_string(ConeKind::free), "free");
  EXPECT_STREQ(to_string(ConeKind::unilateral), "unilateral");
  EXPECT_STREQ(to_string(ConeKind::box), "box");
  EXPECT_STREQ(to_string(ConeKind::friction), "friction");
}

TEST(ErrorText, ValuesThatNoEnumeratorHasArePrintedAsUnknown) {
  EXPECT_STREQ(to_string(static_cast<EnvCode>(200)), "unknown");
  EXPECT_STREQ(to_string(static_cast<SolverKind>(200)), "unknown");
  EXPECT_STREQ(to_string(SolverKind::end), "unknown");
  EXPECT_STREQ(flag_name(static_cast<EnvFlag>(1U << 30)), "unknown");
}

TEST(ErrorText, SolversHaveTheNumbersThatFilesHold) {
  const char* const names[] = {"pgs", "npgs", "jacobi", "apgd", "nsgs", "admm", "newton", "lemke", "ipm", "subspace"};
  for (std::size_t k = 0; k < std::size(names); ++k) EXPECT_STREQ(to_string(static_cast<SolverKind>(k)), names[k]);
  EXPECT_STREQ(to_string(static_cast<SolverKind>(254)), "multigrid");
  EXPECT_STREQ(to_string(static_cast<SolverKind>(255)), "auto");
}

TEST(ErrorText, SolversAreFoundByTheNameTheyPrint) {
  for (int kind = 0; kind < kSolverKindCount; ++kind) {
    const auto solver = static_cast<SolverKind>(kind);
    EXPECT_EQ(solver_from_string(to_string(solver)), solver);
  }
}

TEST(ErrorText, AutoIsASolverToAskForAndNotOneThatAnswers) {
  EXPECT_EQ(solver_from_string("auto"), SolverKind::automatic);
  EXPECT_STREQ(to_string(SolverKind::automatic), "auto");
  EXPECT_GE(static_cast<int>(SolverKind::automatic), kSolverKindCount);
}

TEST(ErrorText, AnUnknownSolverIsRefusedWithTheNamesThereAre) {
  try {
    solver_from_string("magic");
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::invalid_argument);
    std::string expected = "solver 'magic' is not known; use one of: auto";
    for (int kind = 0; kind < kSolverKindCount; ++kind)
      expected += std::string(", ") + to_string(static_cast<SolverKind>(kind));
    EXPECT_EQ(error.what(), expected);
  }
}

}  // namespace
