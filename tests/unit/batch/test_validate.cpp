#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "core/runtime/check/defects.hpp"
#include "stiction/batch.hpp"
#include "stiction/error.hpp"

namespace {

using namespace stiction;
using Arrays = ContactBatch<double>::Arrays;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
const std::string kRemedy = "; fix the value or solve with isolation (--isolate) to flag this environment and go on";

/// env 0: a unilateral row. env 1: empty. env 2: free, box, friction of 3 rows (rows 0, 1, 2..4 of the environment,
/// 1, 2, 3..5 of the batch).
ContactBatch<double> sound_batch() {
  ContactBatch<double> batch;
  Environment<double> one;
  one.cones = {{ConeKind::unilateral, 1, -1}};
  one.set_dense(std::vector<double>{2}, 1);
  one.b = {-1};
  batch.add(one);
  batch.add({});
  Environment<double> mixed;
  mixed.cones = {{ConeKind::free, 1, -1}, {ConeKind::box, 1, -1}, {ConeKind::friction, 3, -1}};
  std::vector<double> matrix(25, 0.0);
  for (std::size_t i = 0; i < 5; ++i) matrix[i * 6] = 4.0;
  matrix[1 * 5 + 2] = matrix[2 * 5 + 1] = 0.5;
  mixed.set_dense(matrix, 5);
  mixed.b = {1, 2, -3, 0.5, 0.25};
  mixed.R.assign(5, 0.125);
  mixed.mu = {0, 0, 0, 0.5, 0.75};
  mixed.lo = {0, -1, 0, 0, 0};
  mixed.hi = {0, 1, 0, 0, 0};
  batch.add(mixed);
  return batch;
}

template <class Spoil>
std::vector<Defect> defects_of(const Spoil& spoil, std::size_t limit = 64) {
  Arrays arrays = sound_batch().arrays();
  spoil(arrays);
  return validate(ContactBatch<double>::from_arrays(Law::convex, std::move(arrays)).view(), limit);
}

template <class Spoil>
void expect_one(const Spoil& spoil, Offset env, Index cone, Index row, bool structural, const std::string& message) {
  const auto defects = defects_of(spoil);
  ASSERT_EQ(defects.size(), 1U) << (defects.empty() ? "none" : defects[0].message + " / " + defects.back().message);
  EXPECT_EQ(defects[0].message, message);
  EXPECT_EQ(defects[0].env, env);
  EXPECT_EQ(defects[0].cone, cone);
  EXPECT_EQ(defects[0].row, row);
  EXPECT_EQ(defects[0].structural, structural);
}

TEST(Validate, ASoundBatchHasNoDefect) {
  EXPECT_TRUE(validate(sound_batch().view()).empty());
  EXPECT_TRUE(validate(convert<float>(sound_batch()).view()).empty());
}

TEST(Validate, ANegativeFrictionIsNamedWithItsPlaceValueAndRemedy) {
  expect_one([](Arrays& a) { a.mu[4] = -0.2; }, 2, 2, 3, false,
             "mu[env 2, cone 2, row 3] = -0.2: friction must be >= 0" + kRemedy);
}

TEST(Validate, SinglePrecisionValuesAreWrittenAsTheyAreStored) {
  Arrays arrays = sound_batch().arrays();
  arrays.mu[4] = -0.2;
  const auto narrow = convert<float>(ContactBatch<double>::from_arrays(Law::convex, arrays));
  EXPECT_EQ(validate(narrow.view()).at(0).message, "mu[env 2, cone 2, row 3] = -0.2: friction must be >= 0" + kRemedy);
}

TEST(Validate, NumbersThatAreNotFiniteAreFoundInEveryArray) {
  expect_one([](Arrays& a) { a.A[2] = kNan; }, 2, 1, 1, false,
             "A[env 2, cone 1, row 1, column 1] = nan: must be finite" + kRemedy);
  expect_one([](Arrays& a) { a.A[2] = -kNan; }, 2, 1, 1, false,
             "A[env 2, cone 1, row 1, column 1] = nan: must be finite" + kRemedy);
  expect_one([](Arrays& a) { a.b[5] = -kInfinity; }, 2, 2, 4, false,
             "b[env 2, cone 2, row 4] = -inf: must be finite" + kRemedy);
  expect_one([](Arrays& a) { a.R[0] = kInfinity; }, 0, 0, 0, false,
             "R[env 0, cone 0, row 0] = inf: must be finite" + kRemedy);
  expect_one([](Arrays& a) { a.mu[5] = kNan; }, 2, 2, 4, false,
             "mu[env 2, cone 2, row 4] = nan: friction must be finite" + kRemedy);
}

TEST(Validate, ANegativeComplianceIsFound) {
  expect_one([](Arrays& a) { a.R[1] = -0.5; }, 2, 0, 0, false,
             "R[env 2, cone 0, row 0] = -0.5: compliance must be >= 0" + kRemedy);
}

TEST(Validate, BoundsThatCrossOrAreNoNumbersAreFound) {
  expect_one([](Arrays& a) { a.lo[2] = 1.5; }, 2, 1, 1, false,
             "lo[env 2, cone 1, row 1] = 1.5: the lower bound must not be above the upper, hi = 1" + kRemedy);
  expect_one([](Arrays& a) { a.lo[2] = kNan; }, 2, 1, 1, false,
             "lo[env 2, cone 1, row 1] = nan: a bound must be a number (-inf: no bound)" + kRemedy);
  expect_one([](Arrays& a) { a.hi[2] = kNan; }, 2, 1, 1, false,
             "hi[env 2, cone 1, row 1] = nan: a bound must be a number (inf: no bound)" + kRemedy);
  expect_one([](Arrays& a) { a.lo[2] = a.hi[2] = kInfinity; }, 2, 1, 1, false,
             "lo[env 2, cone 1, row 1] = inf: no finite reaction reaches this lower bound" + kRemedy);
  expect_one([](Arrays& a) { a.lo[2] = a.hi[2] = -kInfinity; }, 2, 1, 1, false,
             "hi[env 2, cone 1, row 1] = -inf: no finite reaction stays below this upper bound" + kRemedy);
}

TEST(Validate, OpenAndEqualBoundsAreSound) {
  EXPECT_TRUE(defects_of([](Arrays& a) { a.lo[2] = -kInfinity, a.hi[2] = kInfinity; }).empty());
  EXPECT_TRUE(defects_of([](Arrays& a) { a.lo[2] = a.hi[2] = 0.5; }).empty());
}

TEST(Validate, NumbersThatAConeDoesNotUseAreNotLookedAt) {
  EXPECT_TRUE(defects_of([](Arrays& a) {
                a.mu[0] = kNan;               // unilateral
                a.mu[3] = -1;                 // normal row of a friction cone
                a.lo[3] = 5, a.hi[1] = kNan;  // not a box
              }).empty());
}

TEST(Validate, ADiagonalThatIsNotPositiveIsFoundOnRowsThatAreNotFree) {
  // Entries of env 2: (0,0) (1,1) (1,2) (2,1) (2,2) (3,3) (4,4), after the one of env 0.
  expect_one([](Arrays& a) { a.A[0] = -1; }, 0, 0, 0, false,
             "diagonal of A + R[env 0, cone 0, row 0] = -1: must be > 0 on every row that is not free" + kRemedy);
  expect_one([](Arrays& a) { a.A[6] = -0.625; }, 2, 2, 3, false,
             "diagonal of A + R[env 2, cone 2, row 3] = -0.5: must be > 0 on every row that is not free" + kRemedy);
  EXPECT_TRUE(defects_of([](Arrays& a) { a.A[0] = 0; }).empty()) << "a row that is zero as a whole cannot move";
  EXPECT_TRUE(defects_of([](Arrays& a) { a.A[1] = -4; }).empty()) << "a free row";
  EXPECT_TRUE(defects_of([](Arrays& a) { a.A[6] = 0; }).empty()) << "R makes the diagonal positive";
}

TEST(Validate, DuplicateDiagonalEntriesAddUp) {
  Environment<double> environment;
  environment.cones = {{ConeKind::unilateral, 1, -1}};
  environment.row_offsets = {0, 2};
  environment.column = {0, 0};
  environment.A = {-1, 3};
  environment.b = {1};
  ContactBatch<double> batch;
  batch.add(environment);
  EXPECT_TRUE(validate(batch.view()).empty());
  environment.A = {1, -3};
  batch.add(environment);
  EXPECT_EQ(validate(batch.view()).at(0).env, 1);
}

TEST(Validate, ColumnsOutOfTheEnvironmentAreFound) {
  expect_one(
      [](Arrays& a) { a.column[2] = 5; }, 2, -1, 1, true,
      "column[env 2, row 1] = 5 (entry 2 of the batch) is not in 0..4: columns count from the environment's first "
      "row; fix the column");
  expect_one(
      [](Arrays& a) { a.column[0] = -1; }, 0, -1, 0, true,
      "column[env 0, row 0] = -1 (entry 0 of the batch) is not in 0..0: columns count from the environment's first "
      "row; fix the column");
}

TEST(Validate, KindsAndTheirRowCountsAreChecked) {
  expect_one([](Arrays& a) { a.cone_kind[1] = static_cast<ConeKind>(9); }, 2, 0, -1, true,
             "cone_kind[env 2, cone 0] = 9: kinds are 0 free, 1 unilateral, 2 box, 3 friction, 4 box_friction, 5 "
             "semidefinite; fix the kind");
  expect_one([](Arrays& a) { a.cone_kind[1] = static_cast<ConeKind>(6); }, 2, 0, -1, true,
             "cone_kind[env 2, cone 0] = 6: kinds are 0 free, 1 unilateral, 2 box, 3 friction, 4 box_friction, 5 "
             "semidefinite; fix the kind");
  expect_one([](Arrays& a) { a.cone_kind[1] = ConeKind::semidefinite; }, 2, 0, -1, true,
             "the semidefinite cone[env 2, cone 0] has 1 row: matrices of order 2 and 3 have 3 and 6; fix cone_kind or "
             "cone_row_offsets");
  expect_one([](Arrays& a) { a.cone_kind[1] = ConeKind::box_friction; }, 2, 0, -1, true,
             "the box_friction cone[env 2, cone 0] has 1 row: friction has 2 to 6; fix cone_kind or cone_row_offsets");
  expect_one([](Arrays& a) { a.cone_kind[1] = ConeKind::friction; }, 2, 0, -1, true,
             "the friction cone[env 2, cone 0] has 1 row: friction has 2 to 6; fix cone_kind or cone_row_offsets");
  expect_one([](Arrays& a) { a.cone_kind[3] = ConeKind::box; }, 2, 2, -1, true,
             "the box cone[env 2, cone 2] has 3 rows: this kind has 1; fix cone_kind or cone_row_offsets");
  const auto defects = defects_of([](Arrays& a) { a.cone_row_offsets[2] = 1; });
  ASSERT_EQ(defects.size(), 2U);
  EXPECT_EQ(defects[0].message,
            "the free cone[env 2, cone 0] has 0 rows: this kind has 1; fix cone_kind or cone_row_offsets");
}

TEST(Validate, SevenRowsOfFrictionAreTooMany) {
  Environment<double> environment;
  environment.cones = {{ConeKind::friction, 7, -1}};
  environment.b.assign(7, 1.0);
  environment.row_offsets.assign(8, 0);
  ContactBatch<double> batch;
  batch.add(environment);
  EXPECT_EQ(validate(batch.view()).at(0).message,
            "the friction cone[env 0, cone 0] has 7 rows: friction has 2 to 6; fix cone_kind or cone_row_offsets");
}

TEST(Validate, ConesThatDoNotTileTheirEnvironmentAreFound) {
  // The unilateral cone of env 0 moves to env 1, which has no rows.
  const auto defects = defects_of([](Arrays& a) { a.env_cone_offsets[1] = 0; });
  ASSERT_EQ(defects.size(), 2U);
  EXPECT_EQ(defects[0].message,
            "the cones of env 0 cover rows 0..0 of the batch, but the environment has rows 0..1: cones must tile their "
            "environment; rebuild cone_row_offsets");
  EXPECT_EQ(defects[0].env, 0);
  EXPECT_EQ(defects[1].env, 1);
  EXPECT_TRUE(defects[0].structural && defects[1].structural);
}

TEST(Validate, OffsetsThatDecreaseOrBeginOrEndWronglyAreFound) {
  expect_one([](Arrays& a) { a.row_offsets[3] = 1; }, 2, -1, 1, true,
             "row_offsets[3] = 1 is less than row_offsets[2] = 2: offsets must not decrease; rebuild the offsets");
  expect_one([](Arrays& a) { a.row_offsets[0] = -1; }, 0, -1, 0, true,
             "row_offsets[0] = -1: offsets must begin at 0; rebuild the offsets");
  expect_one([](Arrays& a) { a.row_offsets[6] = 100; }, 2, -1, 4, true,
             "row_offsets[6] = 100: the last offset must be the number of stored entries, 8; rebuild the offsets");
  expect_one([](Arrays& a) { a.cone_row_offsets[2] = 7; }, 2, 1, -1, true,
             "cone_row_offsets[3] = 3 is less than cone_row_offsets[2] = 7: offsets must not decrease; rebuild the "
             "offsets");
  expect_one([](Arrays& a) { a.env_row_offsets[1] = 7; }, 1, -1, -1, true,
             "env_row_offsets[2] = 1 is less than env_row_offsets[1] = 7: offsets must not decrease; rebuild the "
             "offsets");
  expect_one([](Arrays& a) { a.env_cone_offsets[3] = 3; }, 2, -1, -1, true,
             "env_cone_offsets[3] = 3: the last offset must be the number of cones, 4; rebuild the offsets");
}

TEST(Validate, StructureComesFirstAndValuesOfSoundEnvironmentsAreStillChecked) {
  const auto defects = defects_of([](Arrays& a) {
    a.b[0] = kNan;     // env 0
    a.column[7] = 77;  // env 2: structural
    a.mu[4] = -1;      // env 2: not read, because the structure of env 2 is broken
  });
  ASSERT_EQ(defects.size(), 2U);
  EXPECT_TRUE(defects[0].structural);
  EXPECT_EQ(defects[0].env, 2);
  EXPECT_FALSE(defects[1].structural);
  EXPECT_EQ(defects[1].env, 0);
}

TEST(Validate, DefectsOfValuesComeInTheOrderOfTheArrays) {
  const auto defects = defects_of([](Arrays& a) {
    a.mu[4] = -1;
    a.A[4] = kNan;
    a.b[5] = kNan;
    a.b[0] = kNan;
  });
  ASSERT_EQ(defects.size(), 4U);
  EXPECT_EQ(defects[0].message.substr(0, 2), "A[");
  EXPECT_EQ(defects[1].message.substr(0, 8), "b[env 0,");
  EXPECT_EQ(defects[2].message.substr(0, 8), "b[env 2,");
  EXPECT_EQ(defects[3].message.substr(0, 3), "mu[");
}

TEST(Validate, NoMoreDefectsAreListedThanAskedFor) {
  const auto spoil = [](Arrays& a) { a.b.assign(6, kNan); };
  EXPECT_EQ(defects_of(spoil, 64).size(), 6U);
  EXPECT_EQ(defects_of(spoil, 4).size(), 4U);
  EXPECT_EQ(defects_of(spoil, 1).at(0).env, 0);
}

TEST(Validate, ViewsWithNegativeCountsOrMissingArraysAreRefusedUnread) {
  auto view = sound_batch().view();
  view.env_count = -1;
  EXPECT_EQ(validate(view).at(0).message, "env_count = -1: a count must be >= 0; fix the view");
  ContactBatchView<double> nothing;
  const auto defects = validate(nothing);
  ASSERT_EQ(defects.size(), 4U);
  EXPECT_EQ(defects[0].message, "env_row_offsets is null; point it to the batch's array");
  EXPECT_EQ(defects[0].env, -1);
  EXPECT_TRUE(defects[0].structural);
}

TEST(Validate, AStructureIsCheckedWithoutItsNumbers) {
  Arrays arrays = sound_batch().arrays();
  arrays.b[0] = kNan;
  arrays.column[2] = 5;
  const auto batch = ContactBatch<double>::from_arrays(Law::convex, std::move(arrays));
  auto view = batch.view();
  view.A = view.b = view.R = view.mu = view.lo = view.hi = nullptr;
  EXPECT_EQ(validate(view).at(0).message, "A is null; point it to the batch's array");
  const auto defects = validate_structure(view);
  ASSERT_EQ(defects.size(), 1U);
  EXPECT_EQ(defects[0].message.substr(0, 24), "column[env 2, row 1] = 5");
}

TEST(Validate, ABatchInDeviceMemoryIsMisuse) {
  const auto batch = sound_batch();
  auto view = batch.view();
  view.space = MemorySpace::cuda;
  EXPECT_THROW(validate(view), Error);
}

// Offsets, columns and kinds are overwritten by numbers of every size. Under the address sanitizer a read out of
// bounds ends the test, also one by gather() or asymmetry(), which index by sound data alone.
TEST(Validate, HostileStructuresAreNeverReadOutOfBounds) {
  std::mt19937_64 random(99);
  const auto hostile = [&]() -> Offset {
    switch (random() % 4) {
      case 0:
        return static_cast<Offset>(random());
      case 1:
        return -static_cast<Offset>(random() % 9);
      default:
        return static_cast<Offset>(random() % 9);
    }
  };
  const std::vector<Offset> everything{2, 1, 0};
  int found = 0;
  for (int round = 0; round < 20000; ++round) {
    Arrays arrays = sound_batch().arrays();
    std::vector<Offset>* const offsets[] = {&arrays.env_row_offsets, &arrays.env_cone_offsets, &arrays.cone_row_offsets,
                                            &arrays.row_offsets};
    for (std::uint64_t k = random() % 4; k > 0; --k) {
      auto& chosen = *offsets[random() % 4];
      chosen[random() % chosen.size()] = hostile();
    }
    if (random() % 4 == 0) arrays.column[random() % arrays.column.size()] = static_cast<Index>(hostile());
    if (random() % 4 == 0) arrays.cone_kind[random() % 4] = static_cast<ConeKind>(random() % 256);
    const auto batch = ContactBatch<double>::from_arrays(Law::convex, std::move(arrays));

    const auto defects = validate(batch.view(), 1 + random() % 3);
    for (const Defect& defect : defects) {
      EXPECT_FALSE(defect.message.empty());
      EXPECT_GE(defect.env, -1);
      EXPECT_LT(defect.env, 3);
    }
    if (defects.empty()) {
      const auto measured = asymmetry(batch.view());  // a column moved inside its row is sound, if not symmetric
      EXPECT_EQ(measured.size(), 3U);
      EXPECT_LE(measured.back(), 2.0);
      EXPECT_EQ(gather(batch, std::span(everything)).row_count(), 6);
      continue;
    }
    ++found;
    try {
      gather(batch, std::span(everything));
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::invalid_argument);
    }
  }
  EXPECT_GT(found, 10000);
  EXPECT_LT(found, 20000) << "some rounds leave the batch as it is";
}

std::vector<double> asymmetry_of(std::vector<double> matrix, Index n) {
  Environment<double> environment;
  environment.cones.assign(static_cast<std::size_t>(n), {ConeKind::unilateral, 1, -1});
  environment.set_dense(matrix, n);
  environment.b.assign(static_cast<std::size_t>(n), 1.0);
  ContactBatch<double> batch;
  batch.add(environment);
  batch.add({});
  return asymmetry(batch.view());
}

TEST(Asymmetry, IsTheLargestDifferenceOverTheLargestEntry) {
  EXPECT_EQ(asymmetry_of({4, 1, 1, 4}, 2), (std::vector<double>{0, 0})) << "the empty environment too";
  EXPECT_EQ(asymmetry_of({4, 1, 3, 4}, 2).at(0), 0.5);
  EXPECT_EQ(asymmetry_of({1, -8, 3, 1}, 2).at(0), 11.0 / 8.0);
}

TEST(Asymmetry, AnEntryWithoutAMirrorImageCountsInFull) {
  EXPECT_EQ(asymmetry_of({4, 0, 1, 0, 4, 0, 0, 0, 4}, 3).at(0), 0.25);
  EXPECT_EQ(asymmetry_of({4, 0, 0, 0, 4, 0, 1, 0, 4}, 3).at(0), 0.25);
}

TEST(Asymmetry, DuplicatesAddUpInAnyOrder) {
  Environment<double> environment;
  environment.cones.assign(2, {ConeKind::unilateral, 1, -1});
  environment.row_offsets = {0, 4, 6};
  environment.column = {1, 0, 1, 0, 1, 0};  // A = [[4, 1], [1, 2]]
  environment.A = {0.25, 1, 0.75, 3, 2, 1};
  environment.b = {1, 1};
  ContactBatch<double> batch;
  batch.add(environment);
  EXPECT_EQ(asymmetry(batch.view()).at(0), 0.0);
}

TEST(Asymmetry, CannotBeSaidOfANanAndIsRefusedOnABrokenStructure) {
  EXPECT_TRUE(std::isnan(asymmetry_of({4, kNan, 1, 4}, 2).at(0)));
  Arrays arrays = sound_batch().arrays();
  arrays.column[3] = 1 << 20;
  EXPECT_THROW(asymmetry(ContactBatch<double>::from_arrays(Law::convex, arrays).view()), Error);
}

}  // namespace
