#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "core/algorithm/solver/ipm/ipm.hpp"
#include "scenes/scenes.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/machines/matrixless.hpp"
#include "tests/support/machines/solve_alone.hpp"
#include "tests/support/machines/solve_on_lanes.hpp"
#include "tests/support/oracles/certificate.hpp"
#include "tests/support/systems/factor_systems.hpp"
#include "tests/support/systems/random_systems.hpp"

/// Interior points whose steps are found by conjugate gradients, as in environments that have no room for a matrix.
namespace {

using namespace stiction;
using namespace stiction::test;

template <class Real = double>
Solution<Real> solved(const Environment<double>& env, double tolerance, Index iterations, Law law = Law::convex) {
  return solved_alone<Real>(env, options(SolverKind::ipm, tolerance, iterations), law, kSparseWithoutMatrices);
}
/// With matrices of its own where it has room for them.
Solution<double> solved_sparse(const Environment<double>& env, double tolerance, Index iterations,
                               Law law = Law::convex) {
  return solved_alone(env, options(SolverKind::ipm, tolerance, iterations), law, kSparse);
}

/// A scene with that compliance on every row, relative to A's mean diagonal.
Environment<double> compliant(const std::string& scene, int size, double compliance) {
  Environment<double> env = scenes::make(scene, 5, 0, size).system;
  const std::size_t n = env.b.size();
  double trace = 0;
  for (std::size_t i = 0; i < n; ++i)
    for (auto k = static_cast<std::size_t>(env.row_offsets[i]); k < static_cast<std::size_t>(env.row_offsets[i + 1]);
         ++k)
      if (static_cast<std::size_t>(env.column[k]) == i) trace += env.A[k];
  env.R.assign(n, compliance * trace / static_cast<double>(n));
  return env;
}

double largest(const std::vector<double>& v) {
  double most = 0;
  for (const double x : v) most = std::max(most, std::abs(x));
  return most;
}

void expect_near(const std::vector<double>& found, const std::vector<double>& expected, double part) {
  const double bound = part * largest(expected);
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(found[i], expected[i], bound) << "row " << i;
}

TEST(IpmGradients, GoWhereTheFactorisationGoes) {
  for (const double compliance : {1e-1, 1e-3}) {
    SCOPED_TRACE(compliance);
    const Environment<double> env = compliant("stack", 10, compliance);
    const Solution<double> by_matrix = solved_sparse(env, 1e-12, 100);
    const Solution<double> found = solved(env, 1e-10, 100);
    EXPECT_EQ(found.status[0].code, EnvCode::solved) << found.status[0].residual;
    EXPECT_LE(found.status[0].iterations, by_matrix.status[0].iterations + 30);
    // With a residual r of the strictly convex problem reactions are off by at most r / R, here 1e-10 / 1e-3.
    expect_near(found.lambda, by_matrix.lambda, 1e-6);
    expect_near(found.w, by_matrix.w, 1e-6);
  }
}

TEST(IpmGradients, RandomConvexProblemsAreCertified) {
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Recipe recipe;
    recipe.seed = seed;
    recipe.contacts = static_cast<int>(seed % 5);
    recipe.others = 3;
    recipe.mass_ratio = seed % 3 == 0 ? 100.0 : 10.0;
    const Environment<double> env = random_contacts(recipe);
    const Solution<double> solution = solved(env, 1e-9, 100);
    const Certificate found = certify(env, Law::convex, solution.lambda);
    EXPECT_LE(found.worst(), 1e-8L) << "primal " << found.primal << ", dual " << found.dual << ", complementarity "
                                    << found.complementarity << " at " << solution.status[0].residual;
  }
}

TEST(IpmGradients, AHundredBoxesAreCertifiedWithAndWithoutCompliance) {
  for (const double compliance : {0.0, 1e-3}) {
    SCOPED_TRACE(compliance);
    const Environment<double> env = compliant("stack", 100, compliance);
    ASSERT_GT(env.b.size(), static_cast<std::size_t>(kDirectRows));
    const Solution<double> solution = solved_sparse(env, 1e-7, 100);
    EXPECT_EQ(solution.status[0].code, EnvCode::solved) << solution.status[0].residual;
    EXPECT_EQ(solution.status[0].flags, 0U);
    const Certificate found = certify(env, Law::convex, solution.lambda);
    EXPECT_LE(found.worst(), 1e-6L) << "primal " << found.primal << ", dual " << found.dual << ", complementarity "
                                    << found.complementarity;
  }
}

TEST(IpmGradients, FactorsAreCertifiedBelowAndAboveTheLimitOfRows) {
  for (const bool is_large : {false, true}) {
    JacobianRecipe recipe;
    recipe.contacts = is_large ? 340 : 20;
    recipe.others = 10;
    recipe.dofs = is_large ? 40 : 12;
    const JacobianEnvironment<double> contacts = random_jacobian(recipe);
    const Environment<double> env = as_matrix(contacts);
    const ContactBatch<double> batch = as_factor(contacts, Law::convex);
    ASSERT_EQ(make_plan(batch.view()).path[0], EnvPath::factor);
    ASSERT_EQ(env.b.size() > static_cast<std::size_t>(kDirectRows), is_large);
    const SolverOptions o = options(SolverKind::ipm, 1e-8, 100);
    const Solution<double> solution = is_large ? solve(batch, o) : solve_alone(batch, o, 0, kWithoutMatrices);
    EXPECT_EQ(solution.status[0].code, EnvCode::solved) << solution.status[0].residual;
    EXPECT_EQ(solution.status[0].flags, 0U);
    const Certificate found = certify(env, Law::convex, solution.lambda);
    EXPECT_LE(found.worst(), 1e-6L) << "primal " << found.primal << ", dual " << found.dual << ", complementarity "
                                    << found.complementarity;
  }
}

TEST(IpmGradients, CoulombsLawAndSinglePrecision) {
  const Environment<double> env = scenes::make("stack", 5, 0, 10).system;
  const Solution<double> coulomb = solved(env, 1e-7, 200, Law::coulomb);
  EXPECT_EQ(coulomb.status[0].code, EnvCode::solved) << coulomb.status[0].residual;
  EXPECT_LE(certify(env, Law::coulomb, coulomb.lambda).worst(), 1e-6L);
  // Without compliance rounding in f32 ends it at 1e-5 of b (docs/math/ipm.md).
  const Solution<float> single = solved<float>(compliant("stack", 10, 1e-2), 1e-5, 100);
  EXPECT_EQ(single.status[0].code, EnvCode::solved) << single.status[0].residual;
  const Solution<float> rigid = solved<float>(compliant("stack", 10, 0.0), 3e-5, 100);
  EXPECT_EQ(rigid.status[0].code, EnvCode::solved) << rigid.status[0].residual;
}

TEST(IpmGradients, BoundsOfEveryKind) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const double bounds[][2] = {{-1, 1},      {-1, kInfinity}, {-kInfinity, 1}, {-kInfinity, kInfinity}, {0.5, 0.5},
                              {0.25, 0.75}, {-3, -2},        {0, kInfinity},  {2, kInfinity},          {0, 0}};
  for (const double push : {-4.0, 0.0, 4.0}) {
    SCOPED_TRACE(push);
    const Environment<double> env = chain_of_boxes(bounds, push);
    const Solution<double> solution = solved(env, 1e-10, 100);
    EXPECT_EQ(solution.status[0].code, EnvCode::solved) << solution.status[0].residual;
    const Certificate found = certify(env, Law::convex, solution.lambda);
    EXPECT_LE(found.primal, 0.0L);
    EXPECT_LE(std::max(found.dual, found.complementarity), 1e-8L);
  }
}

TEST(IpmGradients, AProblemWithoutAnAnswerEndsWithFiniteNumbers) {
  // Nothing resists and the contact is pulled in: unbounded below.
  const Environment<double> env = system({unilateral(), unilateral()}, diagonal({1, 0}), {-1, -1});
  const Solution<double> solution = solved(env, 1e-8, 500);
  EXPECT_NE(solution.status[0].code, EnvCode::solved);
  for (const double x : solution.lambda) EXPECT_TRUE(std::isfinite(x)) << x;
}

TEST(IpmGradients, AnAsymmetricMatrixIsRefusedUnderBothLaws) {
  Environment<double> env = scenes::make("stack", 5, 0, 100).system;
  ASSERT_GT(env.b.size(), static_cast<std::size_t>(kDirectRows));
  const auto entry = static_cast<std::size_t>(env.row_offsets[0]);
  ASSERT_NE(env.column[entry + 1], 0);
  env.A[entry + 1] += 0.5 * env.A[entry];
  const auto convex = solved_sparse(env, 1e-3, 5).status[0];
  const auto coulomb = solved_sparse(env, 1e-3, 5, Law::coulomb).status[0];
  for (const EnvStatus& status : {convex, coulomb}) {
    EXPECT_EQ(status.code, EnvCode::unsupported);
    EXPECT_EQ(status.flags, static_cast<std::uint32_t>(kFlagAsymmetric));
  }
}

template <Law kLaw, class Real>
void expect_same_on_every_team() {
  const ContactBatch<Real> batch = convert<Real>(batch_of({scenes::make("stack", 5, 0, 2).system}, kLaw));
  const SolverOptions o = options(SolverKind::ipm, 1e-9, 2);
  const Solution<Real> alone = solve_alone(batch, o, 0, kSparseWithoutMatrices);
  EXPECT_EQ(alone.status[0].iterations, 2);
  for (const Index width : {1, 2, 3, 8, 33})
    EXPECT_TRUE(same_bits(alone, solve_on_lanes<Matrixless<Ipm>, kLaw, SparseSystem<Real>>(batch, o, width, 42)))
        << "width " << width;
}

TEST(Torture, IpmWithoutMatricesHasTheSameBitsOnBlocksOfEveryWidth) {
  expect_same_on_every_team<Law::convex, float>();
  expect_same_on_every_team<Law::coulomb, double>();
}

}  // namespace
