// Extremes of spectra against eigenvalues that are known, and the classes that rules make of them.
#include "stiction/spectrum.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "stiction/error.hpp"
#include "stiction/jacobian.hpp"
#include "tests/support/error_message.hpp"
#include "tests/support/systems/jacobian_systems.hpp"
#include "tests/support/systems/small_systems.hpp"
#if defined(STICTION_TEST_HAS_EIGEN)
#include <Eigen/Eigenvalues>

#include "tests/support/oracles/dense_operator.hpp"
#endif

namespace {

using namespace stiction;
using namespace stiction::test;
using ::testing::HasSubstr;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

ContactBatch<double> rows_of(const std::vector<double>& matrix, Index n) {
  return batch_of({system(std::vector<Cone>(static_cast<std::size_t>(n), unilateral()), matrix,
                          std::vector<double>(static_cast<std::size_t>(n), 1.0))});
}

std::vector<double> second_difference(Index n) {
  std::vector<double> matrix(static_cast<std::size_t>(n * n), 0.0);
  for (Index i = 0; i < n; ++i)
    for (const Index j : {i - 1, i, i + 1})
      if (j >= 0 && j < n) matrix[static_cast<std::size_t>(i * n + j)] = i == j ? 2 : -1;
  return matrix;
}

TEST(Spectrum, AsManyStepsAsRowsGiveTheEigenvalues) {
  const double pi = std::acos(-1.0);
  for (const Index n : {1, 2, 7, 20}) {
    const ContactBatch<double> batch = rows_of(second_difference(n), n);
    const SpectrumEstimate seen = estimate_spectrum(batch.view(), 0, 40);
    EXPECT_NEAR(seen.smallest, 2 - 2 * std::cos(pi / (n + 1)), 1e-12) << n;
    EXPECT_NEAR(seen.largest, 2 + 2 * std::cos(pi / (n + 1)), 1e-12) << n;
    EXPECT_LE(seen.steps, n + 1);
  }
}

TEST(Spectrum, FewStepsStayInsideAndComeNear) {
  constexpr Index kRows = 400;
  const ContactBatch<double> batch = rows_of(second_difference(kRows), kRows);
  double last = 0;
  for (const Index steps : {2, 5, 10, 20, 40}) {
    const double condition = estimate_spectrum(batch.view(), 0, steps).condition();
    EXPECT_GT(condition, last);
    EXPECT_LT(condition, 4.0 * kRows * kRows);
    last = condition;
  }
  EXPECT_GT(last, 100) << "40 steps tell a bad condition from a good one";
}

TEST(Spectrum, WhatIsRedundantDoesNotCount) {
  const ContactBatch<double> batch = rows_of(std::vector<double>(16, 1.0), 4);
  const SpectrumEstimate seen = estimate_spectrum(batch.view(), 0);
  EXPECT_NEAR(seen.largest, 4, 1e-14);
  EXPECT_NEAR(seen.condition(), 1, 1e-14);
  EXPECT_EQ(seen.density, 1);
  EXPECT_EQ(seen.rows, 4);
}

TEST(Spectrum, ComplianceAndUnitsCount) {
  for (const double unit : {1e-300, 1.0, 1e300}) {
    Environment<double> env = system({unilateral(), unilateral()}, diagonal({unit, 4 * unit}), {1, 1});
    env.R = {unit, 0};
    const SpectrumEstimate seen = estimate_spectrum(batch_of({env}).view(), 0);
    EXPECT_NEAR(seen.largest / unit, 4, 1e-12);
    EXPECT_NEAR(seen.smallest / unit, 2, 1e-12);
    EXPECT_EQ(seen.density, 0.5);
  }
}

TEST(Spectrum, AFactorIsTheMatrixThatItIsOf) {
  JacobianBatch<double> batch;
  batch.add(random_jacobian(JacobianRecipe{}));
  const ContactBatch<double> matrix = assemble(batch.view(), FactorUse::never);
  const ContactBatch<double> factor = assemble(batch.view(), FactorUse::always);
  ASSERT_GT(factor.view().env_dofs(0), 0);
  const SpectrumEstimate a = estimate_spectrum(matrix.view(), 0), y = estimate_spectrum(factor.view(), 0);
  EXPECT_NEAR(a.largest, y.largest, 1e-12 * a.largest);
  EXPECT_NEAR(a.smallest, y.smallest, 1e-10 * a.largest);
  EXPECT_EQ(y.density, 1);
}

TEST(Spectrum, BrokenNumbersAndNoRowsAreNotJudged) {
  const SpectrumEstimate broken = estimate_spectrum(rows_of({1, kNan, kNan, 1}, 2).view(), 0);
  EXPECT_TRUE(std::isnan(broken.condition()));
  EXPECT_EQ(classify(broken), SpectrumClass::otherwise);
  const SpectrumEstimate none = estimate_spectrum(batch_of({Environment<double>{}}).view(), 0);
  EXPECT_TRUE(std::isnan(none.condition()));
  EXPECT_EQ(none.rows, 0);
  const SpectrumEstimate zero = estimate_spectrum(rows_of(std::vector<double>(4, 0.0), 2).view(), 0);
  EXPECT_TRUE(std::isnan(zero.condition()));
  EXPECT_EQ(estimate_spectrum(rows_of({1, 0, 0, -1}, 2).view(), 0).condition(), kInfinity) << "indefinite";
}

TEST(Spectrum, RulesAreTheChapters) {
  const auto found = [](double condition, Index rows, double density) {
    SpectrumEstimate seen;
    seen.largest = condition;
    seen.smallest = 1;
    seen.rows = rows;
    seen.density = density;
    return classify(seen);
  };
  EXPECT_EQ(found(99, 999, 1), SpectrumClass::direct);
  EXPECT_EQ(found(99, 1000, 1), SpectrumClass::preconditioned);
  EXPECT_EQ(found(100, 10, 1), SpectrumClass::preconditioned);
  EXPECT_EQ(found(999, 10, 0.01), SpectrumClass::preconditioned);
  EXPECT_EQ(found(1000, 10, 0.09), SpectrumClass::decomposed);
  EXPECT_EQ(found(1000, 10, 0.1), SpectrumClass::otherwise);
  EXPECT_EQ(found(kInfinity, 10, 0.01), SpectrumClass::decomposed);
}

TEST(Spectrum, MisuseIsRefused) {
  const ContactBatch<double> batch = rows_of({1}, 1);
  EXPECT_THAT(error_message([&] { (void)estimate_spectrum(batch.view(), 0, 1); }), HasSubstr("steps = 1"));
  EXPECT_THAT(error_message([&] { (void)estimate_spectrum(batch.view(), 1); }), HasSubstr("environment 1"));
  EXPECT_THAT(error_message([] { (void)solver_choice_from_string("best"); }), HasSubstr("named, spectrum"));
  const auto refused = [](auto&& change) {
    SolverOptions options;
    change(options);
    return error_message([&] { const Solver solver(Device::cpu(), options); });
  };
  EXPECT_THAT(refused([](SolverOptions& o) { o.spectrum.steps = 1; }), HasSubstr("spectrum.steps = 1"));
  EXPECT_THAT(refused([](SolverOptions& o) { o.spectrum.direct_rows = -1; }), HasSubstr("spectrum.direct_rows = -1"));
  EXPECT_THAT(refused([](SolverOptions& o) { o.spectrum.sparse_density = kNan; }), HasSubstr("sparse_density"));
  EXPECT_THAT(refused([](SolverOptions& o) { o.spectrum.otherwise = SolverKind::multigrid; }), HasSubstr("multigrid"));
  EXPECT_THAT(refused([](SolverOptions& o) {
                o.choose = SolverChoice::spectrum;
                o.direct_rows = 5000;
              }),
              HasSubstr("direct_rows = 5000"));
  EXPECT_THAT(refused([](SolverOptions& o) { o.choose = static_cast<SolverChoice>(7); }), HasSubstr("choose = 7"));
}

#if defined(STICTION_TEST_HAS_EIGEN)
TEST(Spectrum, ScenesLieInsideTheirEigenvalues) {
  const int seen = for_each_small_scene([](const ContactBatchView<double>& batch, Offset env) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(dense(batch, env), Eigen::EigenvaluesOnly);
    const auto& values = solver.eigenvalues();
    const double largest = values[values.size() - 1], slack = 1e-11 * largest;
    double smallest = largest;
    for (const double value : values)
      if (value > 1e-9 * largest && value < smallest) smallest = value;
    const SpectrumEstimate few = estimate_spectrum(batch, env), many = estimate_spectrum(batch, env, 400);
    EXPECT_LE(few.largest, largest + slack);
    EXPECT_GE(few.smallest, smallest - slack);
    EXPECT_NEAR(few.largest, largest, 0.01 * largest);
    EXPECT_NEAR(many.largest, largest, slack);
    EXPECT_LE(few.condition(), many.condition() * (1 + 1e-6));
  });
  EXPECT_GT(seen, 10);
}
#endif

}  // namespace
