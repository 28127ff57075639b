#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "stiction/batch.hpp"
#include "stiction/error.hpp"

namespace {

using namespace stiction;

template <class Action>
std::string error_of(const Action& action) {
  try {
    action();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::invalid_argument);
    return error.what();
  }
  return "no error";
}

/// A contact of three rows and a unilateral one; numbers differ in every place.
Environment<double> four_rows() {
  Environment<double> environment;
  environment.cones = {{ConeKind::friction, 3, -1}, {ConeKind::unilateral, 1, -1}};
  const std::vector<double> matrix{4, 1, 0, 0.5, 1, 5, 0, 0, 0, 0, 6, 0, 0.5, 0, 0, 7};
  environment.set_dense(matrix, 4);
  environment.b = {-1, 0.25, 0.5, -2};
  environment.R = {0.1, 0.2, 0.3, 0.4};
  environment.mu = {0, 0.7, 0.8, 0};
  return environment;
}

Environment<double> one_row(double diagonal, double b, Index group = -1) {
  Environment<double> environment;
  environment.cones = {{ConeKind::unilateral, 1, group}};
  environment.set_dense(std::vector<double>{diagonal}, 1);
  environment.b = {b};
  return environment;
}

template <class Real>
void expect_equal(const ContactBatch<Real>& left, const ContactBatch<Real>& right) {
  const auto& a = left.arrays();
  const auto& b = right.arrays();
  EXPECT_EQ(a.env_row_offsets, b.env_row_offsets);
  EXPECT_EQ(a.env_cone_offsets, b.env_cone_offsets);
  EXPECT_EQ(a.cone_kind, b.cone_kind);
  EXPECT_EQ(a.cone_row_offsets, b.cone_row_offsets);
  EXPECT_EQ(a.cone_group, b.cone_group);
  EXPECT_EQ(a.row_offsets, b.row_offsets);
  EXPECT_EQ(a.column, b.column);
  EXPECT_EQ(a.A, b.A);
  EXPECT_EQ(a.b, b.b);
  EXPECT_EQ(a.R, b.R);
  EXPECT_EQ(a.mu, b.mu);
  EXPECT_EQ(a.lo, b.lo);
  EXPECT_EQ(a.hi, b.hi);
  EXPECT_EQ(left.law(), right.law());
}

TEST(Environment, SetDenseStoresEveryEntryThatIsNotZeroRowByRow) {
  const Environment<double> environment = four_rows();
  EXPECT_EQ(environment.row_offsets, (std::vector<Index>{0, 3, 5, 6, 8}));
  EXPECT_EQ(environment.column, (std::vector<Index>{0, 1, 3, 0, 1, 2, 0, 3}));
  EXPECT_EQ(environment.A, (std::vector<double>{4, 1, 0.5, 1, 5, 6, 0.5, 7}));
}

TEST(Environment, SetDenseStoresNansAndReplacesWhatWasThere) {
  Environment<float> environment;
  environment.set_dense(std::vector<float>{1, 2, 3, 4}, 2);
  environment.set_dense(std::vector<float>{std::numeric_limits<float>::quiet_NaN()}, 1);
  ASSERT_EQ(environment.A.size(), 1U);
  EXPECT_TRUE(std::isnan(environment.A[0]));
  EXPECT_EQ(environment.row_offsets, (std::vector<Index>{0, 1}));
}

TEST(Environment, SetDenseRefusesAMatrixOfTheWrongSize) {
  Environment<double> environment;
  const std::vector<double> six(6, 1.0);
  EXPECT_EQ(error_of([&] { environment.set_dense(six, 2); }), "matrix has 6 entries, expected 4 (n * n, row by row)");
  EXPECT_EQ(error_of([&] { environment.set_dense(six, -1); }), "n = -1, expected a number of rows >= 0");
}

TEST(ContactBatch, ANewBatchIsEmptyAndItsViewReadsNothing) {
  const ContactBatch<float> batch(Law::coulomb);
  EXPECT_EQ(batch.env_count(), 0);
  EXPECT_EQ(batch.row_count(), 0);
  const auto view = batch.view();
  EXPECT_EQ(view.env_count, 0);
  EXPECT_EQ(view.nonzero_count, 0);
  EXPECT_EQ(view.law, Law::coulomb);
  EXPECT_EQ(view.space, MemorySpace::host);
  EXPECT_TRUE(validate(view).empty());
}

TEST(ContactBatch, EnvironmentsFollowOneAnotherEmptyOnesIncluded) {
  ContactBatch<double> batch(Law::convex);
  batch.add(four_rows());
  batch.add(Environment<double>{});
  batch.add(one_row(3, -1));
  const auto view = batch.view();
  EXPECT_EQ(view.env_count, 3);
  EXPECT_EQ(view.cone_count, 3);
  EXPECT_EQ(view.row_count, 5);
  EXPECT_EQ(view.nonzero_count, 9);
  const auto& arrays = batch.arrays();
  EXPECT_EQ(arrays.env_row_offsets, (std::vector<Offset>{0, 4, 4, 5}));
  EXPECT_EQ(arrays.env_cone_offsets, (std::vector<Offset>{0, 2, 2, 3}));
  EXPECT_EQ(arrays.cone_row_offsets, (std::vector<Offset>{0, 3, 4, 5}));
  EXPECT_EQ(arrays.row_offsets, (std::vector<Offset>{0, 3, 5, 6, 8, 9}));
  EXPECT_EQ(arrays.column.back(), 0) << "columns count from the environment's own first row";
  EXPECT_EQ(arrays.R, (std::vector<double>{0.1, 0.2, 0.3, 0.4, 0.0})) << "what is left out is zero";
  EXPECT_EQ(arrays.lo, std::vector<double>(5, 0.0));
  EXPECT_TRUE(validate(view).empty());
}

TEST(ContactBatch, GroupsAreStoredFromTheFirstEnvironmentThatHasOne) {
  ContactBatch<double> batch;
  batch.add(four_rows());
  EXPECT_EQ(batch.view().cone_group, nullptr);
  batch.add(one_row(3, -1, 5));
  batch.add(one_row(3, -1));
  EXPECT_EQ(batch.arrays().cone_group, (std::vector<Index>{-1, -1, 5, -1}));
  EXPECT_EQ(batch.view().cone_group, batch.arrays().cone_group.data());
}

TEST(ContactBatch, AddNamesTheArrayOfTheWrongLengthAndAppendsNothing) {
  using Env = Environment<double>;
  struct Case {
    void (*spoil)(Env&);
    const char* message;
  };
  const Case cases[] = {
      {[](Env& e) { e.row_offsets.pop_back(); }, "row_offsets has 4 entries, expected 5 (one per row of b, and one)"},
      {[](Env& e) { e.row_offsets[0] = 1; },
       "row_offsets[0] = 1, expected 0: an environment's offsets count from its own zero"},
      {[](Env& e) { e.row_offsets[4] = -8; }, "row_offsets[4] = -8, expected the number of stored entries"},
      {[](Env& e) { e.column.push_back(0); }, "column has 9 entries, expected 8 (the last entry of row_offsets)"},
      {[](Env& e) { e.A.pop_back(); }, "A has 7 entries, expected 8 (the last entry of row_offsets)"},
      {[](Env& e) { e.R.pop_back(); },
       "R has 3 entries, expected 4 (one per row, as b has; or leave it empty for zeros)"},
      {[](Env& e) { e.mu.push_back(0); },
       "mu has 5 entries, expected 4 (one per row, as b has; or leave it empty for zeros)"},
      {[](Env& e) { e.lo = {1}; }, "lo has 1 entries, expected 4 (one per row, as b has; or leave it empty for zeros)"},
      {[](Env& e) { e.hi = {1}; }, "hi has 1 entries, expected 4 (one per row, as b has; or leave it empty for zeros)"},
      {[](Env& e) { e.cones.pop_back(); }, "cones tile 3 rows, expected 4 (one per entry of b)"},
      {[](Env& e) { e.cones[1].row_count = 0; }, "cones[1].row_count = 0, expected at least 1"},
      {[](Env& e) { e.b.clear(); }, "row_offsets has 5 entries, expected 1 (one per row of b, and one)"},
      {[](Env& e) { e.row_offsets.clear(); }, "row_offsets has 0 entries, expected 5 (one per row of b, and one)"},
  };
  for (const Case& test : cases) {
    ContactBatch<double> batch;
    batch.add(one_row(3, -1));
    const ContactBatch<double> before = batch;
    Environment<double> environment = four_rows();
    test.spoil(environment);
    EXPECT_EQ(error_of([&] { batch.add(environment); }), test.message);
    expect_equal(batch, before);
  }
}

TEST(ContactBatch, FromArraysTakesWhatAddMade) {
  ContactBatch<double> batch(Law::coulomb);
  batch.add(four_rows());
  batch.add(one_row(3, -1, 2));
  expect_equal(ContactBatch<double>::from_arrays(Law::coulomb, batch.arrays()), batch);
}

TEST(ContactBatch, FromArraysNamesTheFirstArrayOfTheWrongLength) {
  using Arrays = ContactBatch<float>::Arrays;
  struct Case {
    void (*spoil)(Arrays&);
    const char* message;
  };
  const Case cases[] = {
      {[](Arrays& a) { a.env_row_offsets.clear(); },
       "env_row_offsets has 0 entries, expected one per environment, and one"},
      {[](Arrays& a) { a.env_cone_offsets.push_back(0); },
       "env_cone_offsets has 4 entries, expected 3 (as many as env_row_offsets)"},
      {[](Arrays& a) { a.cone_kind.pop_back(); },
       "cone_row_offsets has 4 entries, expected 3 (one per entry of cone_kind, and one)"},
      {[](Arrays& a) { a.cone_group.resize(2); },
       "cone_group has 2 entries, expected 3 (one per entry of cone_kind, or none at all)"},
      {[](Arrays& a) { a.row_offsets.clear(); }, "row_offsets has 0 entries, expected 6 (one per row of b, and one)"},
      {[](Arrays& a) { a.A.clear(); }, "A has 0 entries, expected 9 (as many as column)"},
      {[](Arrays& a) { a.R.resize(4); }, "R has 4 entries, expected 5 (one per row, as b has)"},
      {[](Arrays& a) { a.mu.resize(4); }, "mu has 4 entries, expected 5 (one per row, as b has)"},
      {[](Arrays& a) { a.lo.resize(4); }, "lo has 4 entries, expected 5 (one per row, as b has)"},
      {[](Arrays& a) { a.hi.resize(6); }, "hi has 6 entries, expected 5 (one per row, as b has)"},
  };
  ContactBatch<double> sound;
  sound.add(four_rows());
  sound.add(one_row(3, -1));
  for (const Case& test : cases) {
    Arrays arrays = convert<float>(sound).arrays();
    test.spoil(arrays);
    EXPECT_EQ(error_of([&] { ContactBatch<float>::from_arrays(Law::convex, arrays); }), test.message);
  }
}

TEST(ContactBatch, FromArraysLeavesValuesToValidation) {
  ContactBatch<double>::Arrays arrays;
  arrays.env_row_offsets = {0, 7};
  arrays.env_cone_offsets = {0, -3};
  arrays.cone_row_offsets = {0};
  arrays.row_offsets = {0};
  EXPECT_NO_THROW(ContactBatch<double>::from_arrays(Law::convex, arrays));
}

TEST(Convert, RoundsToNearestAndOverflowsToInfinity) {
  ContactBatch<double> batch(Law::coulomb);
  Environment<double> environment = one_row(0.1, -1e300, 4);
  environment.cones[0].kind = ConeKind::box;
  environment.lo = {-std::numeric_limits<double>::infinity()};
  environment.hi = {1.0 + 1e-12};
  batch.add(environment);
  const ContactBatch<float> narrow = convert<float>(batch);
  EXPECT_EQ(narrow.arrays().A[0], 0.1F);
  EXPECT_EQ(narrow.arrays().b[0], -std::numeric_limits<float>::infinity());
  EXPECT_EQ(narrow.arrays().lo[0], -std::numeric_limits<float>::infinity());
  EXPECT_EQ(narrow.arrays().hi[0], 1.0F);
  EXPECT_EQ(narrow.arrays().cone_group, (std::vector<Index>{4}));
  EXPECT_EQ(narrow.law(), Law::coulomb);
  EXPECT_EQ(convert<double>(narrow).arrays().A[0], static_cast<double>(0.1F));
  expect_equal(convert<double>(batch), batch);
}

TEST(Gather, EnvironmentsComeInTheOrderAskedForRepeatsAllowed) {
  ContactBatch<double> batch(Law::coulomb), expected(Law::coulomb);
  const Environment<double> parts[] = {four_rows(), {}, one_row(3, -1, 6)};
  for (const auto& part : parts) batch.add(part);
  const std::vector<Offset> order{2, 0, 1, 0};
  for (const Offset env : order) expected.add(parts[static_cast<std::size_t>(env)]);
  expect_equal(gather(batch, std::span<const Offset>(order)), expected);
}

TEST(Gather, NothingAskedForGivesAnEmptyBatch) {
  ContactBatch<double> batch;
  batch.add(four_rows());
  EXPECT_EQ(gather(batch, std::span<const Offset>()).env_count(), 0);
}

TEST(Gather, RefusesAnEnvironmentThatIsNotThere) {
  ContactBatch<double> batch;
  batch.add(four_rows());
  const std::vector<Offset> order{0, 1};
  EXPECT_EQ(error_of([&] { gather(batch, std::span<const Offset>(order)); }),
            "order[1] = 1, expected an environment in 0..0");
}

TEST(Gather, RefusesOffsetsThatLeadOutOfTheArrays) {
  ContactBatch<double> batch;
  batch.add(four_rows());
  batch.add(one_row(3, -1));
  const std::vector<Offset> order{1};
  const auto gather_of = [&](auto spoil) {
    auto arrays = batch.arrays();
    spoil(arrays);
    return error_of([&] { gather(ContactBatch<double>::from_arrays(Law::convex, arrays), std::span(order)); });
  };
  EXPECT_EQ(
      gather_of([](auto& a) { a.env_row_offsets[2] = 900; }),
      "env_row_offsets[1] = 4 to env_row_offsets[2] = 900 do not lead forward through an array of 5 entries; fix the "
      "offsets (validate() lists every defect)");
  EXPECT_NE(gather_of([](auto& a) { a.env_cone_offsets[1] = -1; }).find("env_cone_offsets[1] = -1"), std::string::npos);
  EXPECT_NE(gather_of([](auto& a) { a.row_offsets[5] = 10; }).find("row_offsets[5] = 10"), std::string::npos);
  EXPECT_EQ(gather_of([](auto& a) { a.cone_row_offsets[2] = 3; }),
            "the cones of env 1 tile rows 3..5, expected 4..5; fix cone_row_offsets (validate() lists every defect)");
}

}  // namespace
