// Operators whose answers can be worked out by hand; larger ones are in test_analysis_spectra.cpp.
#include "stiction/analysis.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "stiction/error.hpp"
#include "stiction/padded.hpp"
#include "tests/support/systems/jacobian_systems.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

Environment<double> rows_of(const std::vector<double>& matrix, Index n) {
  return system(std::vector<Cone>(static_cast<std::size_t>(n), unilateral()), matrix,
                std::vector<double>(static_cast<std::size_t>(n), 1.0));
}

/// With so many steps that the error is the tolerance at which iterations end: an error of the Rayleigh quotient far
/// below 1e-8.
OperatorAnalysis settled(const Environment<double>& environment, AnalysisOptions options = {}) {
  options.max_steps = 1000;
  return analyse(batch_of({environment}).view(), options).at(0);
}

OperatorAnalysis settled(const std::vector<double>& matrix, Index n) {
  return settled(rows_of(matrix, n));
}

constexpr double kSettled = 1e-8;

TEST(Analysis, TheSecondDifferenceHasItsEigenvalues) {
  const double pi = std::acos(-1.0);
  for (const Index n : {1, 2, 7}) {
    std::vector<double> matrix(static_cast<std::size_t>(n * n), 0.0);
    for (Index i = 0; i < n; ++i)
      for (const Index j : {i - 1, i, i + 1})
        if (j >= 0 && j < n) matrix[static_cast<std::size_t>(i * n + j)] = i == j ? 2 : -1;
    const OperatorAnalysis seen = settled(matrix, n);
    EXPECT_NEAR(seen.smallest, 2 - 2 * std::cos(pi / (n + 1)), kSettled) << n;
    EXPECT_NEAR(seen.largest, 2 + 2 * std::cos(pi / (n + 1)), kSettled) << n;
    EXPECT_EQ(seen.definiteness, Definiteness::positive_definite);
  }
}

TEST(Analysis, ADiagonalIsItsOwnAnswer) {
  const OperatorAnalysis seen = settled(diagonal({2, 8, 1}), 3);
  EXPECT_EQ(seen.rows, 3);
  EXPECT_EQ(seen.nonzeros, 3);
  EXPECT_EQ(seen.density, 1.0 / 3);
  EXPECT_TRUE(seen.is_finite);
  EXPECT_EQ(seen.asymmetry, 0);
  EXPECT_EQ(seen.normal_spread, 8);
  EXPECT_EQ(seen.rank, 3);
  EXPECT_EQ(seen.definiteness, Definiteness::positive_definite);
  EXPECT_NEAR(seen.largest, 8, 8 * kSettled);
  EXPECT_NEAR(seen.smallest, 1, kSettled);
  EXPECT_NEAR(seen.condition(), 8, 16 * kSettled);
  EXPECT_EQ(seen.condition(), seen.range_condition());
  EXPECT_NEAR(seen.rank_tolerance, 3 * 0x1p-52 * 8, 3 * 0x1p-52 * 8 * kSettled);
}

TEST(Analysis, OneRowIsExactInOneStep) {
  const OperatorAnalysis seen = settled({0.3}, 1);
  EXPECT_DOUBLE_EQ(seen.largest, 0.3);
  EXPECT_DOUBLE_EQ(seen.smallest, 0.3);
  EXPECT_EQ(seen.largest_steps, 1);
  EXPECT_EQ(seen.smallest_steps, 1);
  EXPECT_EQ(seen.rank, 1);
  EXPECT_EQ(seen.definiteness, Definiteness::positive_definite);
}

TEST(Analysis, NoRowsAreNotDetermined) {
  const OperatorAnalysis seen = settled(Environment<double>{});
  EXPECT_EQ(seen.rows, 0);
  EXPECT_TRUE(seen.is_finite);
  EXPECT_EQ(seen.rank, -1);
  EXPECT_TRUE(std::isnan(seen.largest));
  EXPECT_TRUE(std::isnan(seen.density));
  EXPECT_TRUE(std::isnan(seen.condition()));
  EXPECT_EQ(seen.definiteness, Definiteness::unknown);
}

TEST(Analysis, ZeroHasNoRankAndNoRange) {
  const OperatorAnalysis seen = settled(diagonal({0, 0}), 2);
  EXPECT_EQ(seen.largest, 0);
  EXPECT_EQ(seen.rank, 0);
  EXPECT_TRUE(std::isinf(seen.condition()));
  EXPECT_TRUE(std::isnan(seen.range_condition()));
  EXPECT_TRUE(std::isnan(seen.normal_spread));
  EXPECT_EQ(seen.definiteness, Definiteness::positive_semidefinite);
}

TEST(Analysis, RedundantContactsAreSemidefiniteAndConditionedOnTheirRange) {
  // Four equal contacts on one degree of freedom of inverse mass 3: A = 3 1 1'.
  const OperatorAnalysis seen = settled(std::vector<double>(16, 3.0), 4);
  EXPECT_EQ(seen.rank, 1);
  EXPECT_EQ(seen.definiteness, Definiteness::positive_semidefinite);
  EXPECT_NEAR(seen.largest, 12, 12 * kSettled);
  EXPECT_NEAR(seen.smallest, 12, 12 * kSettled);
  EXPECT_TRUE(std::isinf(seen.condition()));
  EXPECT_NEAR(seen.range_condition(), 1, 2 * kSettled);
}

TEST(Analysis, ComplianceIsPartOfTheOperatorUnlessItIsLeftOut) {
  Environment<double> environment = rows_of(std::vector<double>(4, 1.0), 2);
  environment.R = {0.5, 0.5};
  const OperatorAnalysis with = settled(environment);
  EXPECT_EQ(with.rank, 2);
  EXPECT_EQ(with.definiteness, Definiteness::positive_definite);
  EXPECT_NEAR(with.condition(), 5, 10 * kSettled) << "2.5 over 0.5";
  AnalysisOptions options;
  options.with_compliance = false;
  const OperatorAnalysis without = settled(environment, options);
  EXPECT_EQ(without.rank, 1);
  EXPECT_EQ(without.definiteness, Definiteness::positive_semidefinite);
}

TEST(Analysis, OneNegativeEigenvalueMakesItIndefinite) {
  const OperatorAnalysis seen = settled({1, 2, 2, 1}, 2);  // 3 and -1
  EXPECT_EQ(seen.definiteness, Definiteness::indefinite);
  EXPECT_EQ(seen.rank, 2);
  EXPECT_NEAR(seen.largest, 3, 3 * kSettled);
  EXPECT_NEAR(seen.smallest, 1, kSettled);
  EXPECT_EQ(settled({0, 1, 1, 0}, 2).definiteness, Definiteness::indefinite) << "nothing on the diagonal";
  EXPECT_EQ(settled(diagonal({-1, -2}), 2).definiteness, Definiteness::indefinite);
  EXPECT_EQ(settled({1, 1, 0, 1, 1, 0, 0, 0, -1}, 3).definiteness, Definiteness::indefinite)
      << "found beside a redundant pair";
}

TEST(Analysis, EigenvaluesOfEqualSizeAndOppositeSignDoNotKeepItFromSettling) {
  const OperatorAnalysis seen = settled({0, 2, 2, 0}, 2);
  EXPECT_DOUBLE_EQ(seen.largest, 2);
  EXPECT_EQ(seen.largest_steps, 1);
}

TEST(Analysis, WithoutSymmetrySizesAreSingularValues) {
  const OperatorAnalysis turn = settled({0, -1, 1, 0}, 2);  // a rotation: x'Ax = 0
  EXPECT_EQ(turn.asymmetry, 2);
  EXPECT_DOUBLE_EQ(turn.condition(), 1);
  EXPECT_EQ(turn.definiteness, Definiteness::positive_semidefinite);

  const OperatorAnalysis nilpotent = settled({0, 2, 0, 0}, 2);  // spectral radius 0, norm 2
  EXPECT_NEAR(nilpotent.largest, 2, 2 * kSettled);
  EXPECT_EQ(nilpotent.rank, 1);
  EXPECT_EQ(nilpotent.definiteness, Definiteness::indefinite);

  const OperatorAnalysis shear = settled({1, 1.5, 0, 1}, 2);  // 2 and 1/2: product 1, sum of squares 4.25
  EXPECT_NEAR(shear.largest, 2, 2 * kSettled);
  EXPECT_NEAR(shear.smallest, 0.5, 0.5 * kSettled);
  EXPECT_EQ(shear.definiteness, Definiteness::positive_definite) << "1.5 is less than 2";
  EXPECT_EQ(settled({1, 2.5, 0, 1}, 2).definiteness, Definiteness::indefinite);
}

TEST(Analysis, NumbersThatAreNotFiniteAreFoundAndLeftAlone) {
  for (const double bad : {kNan, std::numeric_limits<double>::infinity()}) {
    Environment<double> in_A = rows_of({1, 0.5, 0.5, 1}, 2), in_R = in_A;
    in_A.A[1] = bad;
    in_R.R = {0, bad};
    for (const auto& environment : {in_A, in_R}) {
      const OperatorAnalysis seen = settled(environment);
      EXPECT_FALSE(seen.is_finite);
      EXPECT_EQ(seen.nonzeros, 4);
      EXPECT_EQ(seen.rank, -1);
      EXPECT_TRUE(std::isnan(seen.largest));
      EXPECT_TRUE(std::isnan(seen.condition()));
      EXPECT_EQ(seen.definiteness, Definiteness::unknown);
    }
    AnalysisOptions options;
    options.with_compliance = false;
    EXPECT_TRUE(settled(in_R, options).is_finite) << "R is not looked at";
  }
}

TEST(Analysis, EntriesStoredTwiceAddUp) {
  Environment<double> environment = rows_of({1}, 1);
  environment.row_offsets = {0, 2};
  environment.column = {0, 0};
  environment.A = {1, 2};
  const OperatorAnalysis seen = settled(environment);
  EXPECT_EQ(seen.nonzeros, 2);
  EXPECT_DOUBLE_EQ(seen.largest, 3);
  EXPECT_DOUBLE_EQ(seen.smallest, 3);
}

TEST(Analysis, ScaleIsAFactorAndNothingElse) {
  const std::vector<double> matrix{4, 1, 0, 1, 3, 1, 0, 1, 2};
  const OperatorAnalysis plain = settled(matrix, 3);
  for (const int exponent : {-1000, -1, 1000}) {
    std::vector<double> scaled = matrix;
    for (double& entry : scaled) entry = std::ldexp(entry, exponent);
    const OperatorAnalysis seen = settled(scaled, 3);
    EXPECT_EQ(seen.largest, std::ldexp(plain.largest, exponent));
    EXPECT_EQ(seen.smallest, std::ldexp(plain.smallest, exponent));
    EXPECT_EQ(seen.condition(), plain.condition());
    EXPECT_EQ(seen.largest_steps, plain.largest_steps);
    EXPECT_EQ(seen.definiteness, plain.definiteness);
  }
}

TEST(Analysis, WhatCountsAsZeroFollowsTheTypeOrTheCaller) {
  const auto batch = batch_of({rows_of(diagonal({1, 1e-9}), 2)});
  EXPECT_EQ(analyse(batch.view()).at(0).rank, 2);
  EXPECT_EQ(analyse(convert<float>(batch).view()).at(0).rank, 1);
  AnalysisOptions options;
  options.rank_tolerance = 1e-6;
  const OperatorAnalysis coarse = analyse(batch.view(), options).at(0);
  EXPECT_EQ(coarse.rank, 1);
  EXPECT_EQ(coarse.definiteness, Definiteness::positive_semidefinite);
}

TEST(Analysis, LargeEnvironmentsAreNotFactorised) {
  AnalysisOptions options;
  options.max_dense_rows = 2;
  const OperatorAnalysis seen = settled(rows_of(diagonal({4, 2, 1}), 3), options);
  EXPECT_NEAR(seen.largest, 4, 4 * kSettled);
  EXPECT_EQ(seen.rank, -1);
  EXPECT_TRUE(std::isnan(seen.smallest));
  EXPECT_TRUE(std::isnan(seen.condition()));
  EXPECT_EQ(seen.definiteness, Definiteness::unknown);
}

TEST(Analysis, AFactorIsTheMatrixThatItIsTheFactorOf) {
  JacobianBatch<double> jacobian(Law::convex);
  jacobian.add(random_jacobian({1, 2, 2, 6, 0, 0.01}));
  jacobian.add(random_jacobian({2, 5, 3, 7, 0, 0.01}));
  const auto factor = assemble(jacobian.view(), FactorUse::always),
             matrix = assemble(jacobian.view(), FactorUse::never);
  for (const bool with_compliance : {true, false}) {
    AnalysisOptions options;
    options.max_steps = 1000;
    options.with_compliance = with_compliance;
    options.rank_tolerance = 1e-12;
    const auto ours = analyse(factor.view(), options), theirs = analyse(matrix.view(), options);
    for (std::size_t env = 0; env < 2; ++env) {
      // Two roundings of one matrix, 1e-13 apart; the smallest value is at most the condition more sensitive.
      EXPECT_EQ(ours[env].rank, theirs[env].rank);
      EXPECT_EQ(ours[env].definiteness, theirs[env].definiteness);
      EXPECT_NEAR(ours[env].largest, theirs[env].largest, 1e-8 * theirs[env].largest);
      EXPECT_NEAR(ours[env].smallest, theirs[env].smallest,
                  theirs[env].smallest * (1e-8 + 1e-13 * theirs[env].range_condition()));
      EXPECT_NEAR(ours[env].normal_spread, theirs[env].normal_spread, 1e-12 * theirs[env].normal_spread);
      EXPECT_EQ(ours[env].asymmetry, 0);
    }
    EXPECT_EQ(ours[1].rank < ours[1].rows, !with_compliance) << "more rows than degrees of freedom";
  }
}

TEST(Analysis, WhatLiesBehindThePaddingIsNotRead) {
  PaddedLayout<double> layout(MatrixRows::by_room);
  const std::vector<Cone> two{unilateral(), unilateral()};
  layout.add(3, two);
  std::vector<double> A{4, 1, kNan, 1, 3, kNan, kNan, kNan, kNan}, b(3, -1.0), R{0, 0, kNan}, none(3, 0.0);
  const PaddedNumbers<double> numbers{A.data(), b.data(), R.data(), none.data(), none.data(), none.data()};
  AnalysisOptions options;
  options.max_steps = 1000;
  const OperatorAnalysis padded = analyse(layout.view(numbers, Law::convex), options).at(0);
  const OperatorAnalysis packed = settled({4, 1, 1, 3}, 2);
  EXPECT_EQ(padded.rows, 2);
  EXPECT_EQ(padded.largest, packed.largest);
  EXPECT_EQ(padded.smallest, packed.smallest);
  EXPECT_EQ(padded.normal_spread, packed.normal_spread);
}

TEST(Analysis, AnEnvironmentsAnswerIsItsOwn) {
  const auto batch = ragged_batch(1, 7);
  AnalysisOptions options;
  options.max_dense_rows = 60;
  const auto all = analyse(batch.view(), options);
  ASSERT_EQ(all.size(), static_cast<std::size_t>(batch.env_count()));
  const auto same = [](double x, double y) { return std::memcmp(&x, &y, sizeof x) == 0; };
  for (Offset env = batch.env_count(); env-- > 0;) {
    const std::vector<Offset> only{env};
    const auto alone = analyse(gather(batch, std::span<const Offset>(only)).view(), options).at(0);
    const auto listed = analyse(batch.view(), std::span<const Offset>(only), options).at(0);
    for (const OperatorAnalysis& other : {alone, listed}) {
      const OperatorAnalysis& seen = all[static_cast<std::size_t>(env)];
      EXPECT_TRUE(same(seen.largest, other.largest) && same(seen.smallest, other.smallest)) << "environment " << env;
      EXPECT_TRUE(same(seen.asymmetry, other.asymmetry) && same(seen.normal_spread, other.normal_spread));
      EXPECT_EQ(seen.rank, other.rank);
      EXPECT_EQ(seen.nonzeros, other.nonzeros);
    }
  }
}

TEST(Analysis, MisuseIsRefusedWithItsName) {
  const auto batch = batch_of({rows_of({1}, 1)});
  const auto expect_refused = [&](const AnalysisOptions& options, const char* name) {
    try {
      analyse(batch.view(), options);
      ADD_FAILURE() << name << " was accepted";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::invalid_argument);
      EXPECT_EQ(std::string(error.what()).rfind(name, 0), 0U) << error.what();
    }
  };
  AnalysisOptions options;
  options.max_steps = 0;
  expect_refused(options, "max_steps = 0");
  options = {};
  options.step_tolerance = kNan;
  expect_refused(options, "step_tolerance = nan");
  options = {};
  options.rank_tolerance = 1;
  expect_refused(options, "rank_tolerance = 1");
  for (const Offset env : {-1, 1}) {
    const std::vector<Offset> missing{env};
    EXPECT_THROW(analyse(batch.view(), std::span<const Offset>(missing)), Error);
  }
  auto arrays = batch.arrays();
  arrays.column[0] = 5;
  EXPECT_THROW(analyse(ContactBatch<double>::from_arrays(Law::convex, arrays).view()), Error);
}

}  // namespace
