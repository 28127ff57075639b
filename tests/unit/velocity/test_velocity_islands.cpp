#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "stiction/jacobian_solver.hpp"
#include "stiction/residual.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/roomy_jacobians.hpp"
#include "tests/support/systems/velocity_cases.hpp"

/// Environments of more degrees of freedom than a lane of Newton's method in velocities takes, whose parts nothing
/// couples: robots beside one another.
namespace {

using namespace stiction;
using namespace stiction::test;

enum class Entries { dense, stored };

/// Chains of every kind of cone, one of them without any: 91 degrees of freedom in all.
std::vector<JacobianEnvironment<double>> chains() {
  std::vector<JacobianEnvironment<double>> parts;
  for (std::uint64_t seed = 1; seed <= 7; ++seed) {
    const auto cones = seed == 4 ? std::vector<Cone>{} : cones_of_every_kind();
    parts.push_back(random_chain({seed, static_cast<Index>(5 + 2 * seed), cones, 0.0, 0.01}));
  }
  return parts;
}

template <class Real>
JacobianSolution<Real> solved(const JacobianEnvironment<double>& env, Law law, double tolerance,
                              MassForm form = MassForm::matrix) {
  JacobianBatch<Real> batch(law, form);
  batch.add(cast<Real>(in_form(env, form)));
  return solve(batch, options(SolverKind::automatic, tolerance, 2000));
}

template <class Real>
std::vector<Real> taken(const std::vector<Real>& from, const std::vector<std::size_t>& at) {
  std::vector<Real> out;
  for (const std::size_t i : at) out.push_back(from[i]);
  return out;
}
template <class Real>
testing::AssertionResult same(const std::vector<Real>& a, const std::vector<Real>& b) {
  return same_bits(std::span<const Real>(a), std::span<const Real>(b));
}

/// The whole has the bits of its parts alone, and a status that is true of all of them.
template <class Real>
void expect_the_bits_of_parts_alone(Law law, MassForm form, bool interleaved, Entries entries) {
  const auto parts = chains();
  Together all = together(parts, interleaved);
  if (entries == Entries::stored) store_nonzeros(all.env);
  const double tolerance = sizeof(Real) == sizeof(float) ? 1e-4 : 1e-8;
  const JacobianSolution<Real> whole = solved<Real>(all.env, law, tolerance, form);
  const EnvStatus& status = whole.contact.status[0];
  ASSERT_EQ(status.solver, SolverKind::velocity_newton);
  EXPECT_EQ(status.code, EnvCode::solved);
  double absolute = 0.0, relative = 0.0;
  Index iterations = 0;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    SCOPED_TRACE("part " + std::to_string(p));
    const JacobianSolution<Real> alone = solved<Real>(parts[p], law, tolerance, form);
    const EnvStatus& own = alone.contact.status[0];
    EXPECT_TRUE(same(alone.contact.lambda, taken(whole.contact.lambda, all.rows[p])));
    EXPECT_TRUE(same(alone.contact.w, taken(whole.contact.w, all.rows[p])));
    EXPECT_TRUE(same(alone.velocity, taken(whole.velocity, all.dofs[p])));
    absolute = std::max(absolute, own.residual_absolute);
    relative = std::max(relative, own.residual);
    iterations = std::max(iterations, own.iterations);
  }
  EXPECT_EQ(status.residual_absolute, absolute);
  EXPECT_NEAR(status.residual, relative, 1e-12 * relative) << "each part has a scale of its own";
  EXPECT_EQ(status.iterations, iterations);
}

TEST(VelocityIslands, PartsHaveTheBitsThatTheyHaveAlone) {
  for (const MassForm form : {MassForm::matrix, MassForm::factor})
    for (const Law law : {Law::convex, Law::coulomb})
      for (const bool interleaved : {false, true})
        for (const Entries entries : {Entries::dense, Entries::stored}) {
          SCOPED_TRACE(std::string(law == Law::convex ? "convex" : "coulomb") +
                       (form == MassForm::matrix ? ", M" : ", its factor") +
                       (interleaved ? ", interleaved" : ", consecutive") +
                       (entries == Entries::dense ? ", dense" : ", stored"));
          expect_the_bits_of_parts_alone<double>(law, form, interleaved, entries);
          expect_the_bits_of_parts_alone<float>(law, form, interleaved, entries);
        }
}

TEST(VelocityIslands, TheWholeIsSolvedByAJudgeThatKnowsNothingOfParts) {
  for (const Law law : {Law::convex, Law::coulomb}) {
    const Together all = together(chains(), true);
    const JacobianSolution<double> whole = solved<double>(all.env, law, 1e-9);
    ASSERT_EQ(whole.contact.status[0].solver, SolverKind::velocity_newton);
    const JacobianOracle oracle(all.env, 0);
    Environment<double> contact = system(all.env.cones, oracle.A, oracle.b);
    contact.R = all.env.R;
    contact.mu = all.env.mu;
    contact.lo = all.env.lo;
    contact.hi = all.env.hi;
    ContactBatch<double> expected(law);
    expected.add(contact);
    EXPECT_LE(verify(expected.view(), std::span<const double>(whole.contact.lambda))[0].relative, 1.01e-9);
  }
}

TEST(VelocityIslands, BlocksOfMassAreAsGoodAsOneMatrix) {
  std::vector<JacobianEnvironment<double>> parts;
  for (std::uint64_t seed = 1; seed <= 16; ++seed)
    parts.push_back(random_chain({seed, 6, std::vector<Cone>(3, friction(3)), 0.0, 0.01}));
  const Together all = together(parts, false);
  JacobianEnvironment<double> in_blocks = all.env;
  in_blocks.M.clear();
  for (const auto& part : parts) in_blocks.M.insert(in_blocks.M.end(), part.M.begin(), part.M.end());
  for (const MassForm form : {MassForm::matrix, MassForm::factor}) {
    JacobianBatch<double> batch(Law::convex, form, 6);
    batch.add(in_form(in_blocks, form, 6));
    const JacobianSolution<double> expected = solved<double>(all.env, Law::convex, 1e-9, form);
    const JacobianSolution<double> blocks = solve(batch, options(SolverKind::automatic, 1e-9, 2000));
    EXPECT_EQ(blocks.contact.status[0].solver, SolverKind::velocity_newton);
    EXPECT_TRUE(same(expected.contact.lambda, blocks.contact.lambda));
    EXPECT_TRUE(same(expected.velocity, blocks.velocity));
  }
}

TEST(VelocityIslands, ALargePartThatDoesNotPayLeavesTheEnvironmentToA) {
  auto parts = chains();
  parts.push_back(random_chain({9, 70, cones_of_every_kind(), 0.0, 0.01}));
  const JacobianSolution<double> whole = solved<double>(together(parts, false).env, Law::convex, 1e-6);
  EXPECT_NE(whole.contact.status[0].solver, SolverKind::velocity_newton);
  EXPECT_EQ(whole.contact.status[0].code, EnvCode::solved);
}

TEST(VelocityIslands, APartWithoutAnswerLeavesItsEnvironmentToAAndNobodyElse) {
  Together faulty = together(chains(), false);
  faulty.env.v_free[faulty.dofs[2][1]] = std::numeric_limits<double>::quiet_NaN();
  const Together sound = together(chains(), true);
  JacobianBatch<double> batch(Law::convex);
  batch.add(sound.env);
  batch.add(faulty.env);
  batch.add(chains()[0]);
  SolverOptions o = options(SolverKind::automatic, 1e-8, 2000);
  o.invalid = InvalidPolicy::isolate;
  const JacobianSolution<double> all = solve(batch, o);
  EXPECT_EQ(all.contact.status[1].code, EnvCode::invalid_input);
  EXPECT_EQ(all.contact.status[2].solver, SolverKind::velocity_newton);
  const JacobianSolution<double> alone = solved<double>(sound.env, Law::convex, 1e-8);
  const std::vector<double> first(
      all.contact.lambda.begin(),
      all.contact.lambda.begin() + static_cast<std::ptrdiff_t>(alone.contact.lambda.size()));
  EXPECT_TRUE(same(alone.contact.lambda, first));
  for (std::size_t i = first.size(); i < 2 * first.size(); ++i) EXPECT_EQ(all.contact.lambda[i], 0.0);
}

/// Two degrees of freedom, each with a limit that is pressed, the second a thousand times less, and one that is far
/// away.
JacobianEnvironment<double> two_islands() {
  JacobianEnvironment<double> env;
  env.cones = {unilateral(), unilateral(), unilateral()};
  env.J = {1, 0, 0, 1, 1, 0};
  env.M = diagonal({1, 1});
  env.v_free = {-1, -1e-3};
  env.target = {0, 0, -10};
  env.R = {0.1, 0.1, 0.1};
  return env;
}

TEST(VelocityIslands, OfALaneAreNotJoinedByLanesBesideIt) {
  JacobianEnvironment<double> joined = two_islands();
  joined.J = {1, 1, 1, -1, 1, 0};
  std::vector<JacobianEnvironment<double>> envs;
  std::vector<double> guess;
  for (int pair = 0; pair < 8; ++pair) {
    envs.push_back(two_islands());
    envs.push_back(joined);
    guess.insert(guess.end(), {1 / 1.1, 0, 0, 0, 0, 0});  // right for the first limit, and 1e-3 off in the second
  }
  JacobianBatch<double> batch(Law::convex);
  for (const auto& env : envs) batch.add(env);
  const auto solution =
      solve(batch, options(SolverKind::automatic, 1e-2, 100), Device::cpu(), std::span<const double>(guess));
  for (std::size_t e = 0; e < envs.size(); ++e) {
    EXPECT_EQ(solution.contact.status[e].solver, SolverKind::velocity_newton);
    EXPECT_EQ(solution.contact.status[e].code, EnvCode::solved);
    if (e % 2 == 0) {
      EXPECT_NEAR(solution.contact.lambda[3 * e + 1], 1e-3 / 1.1, 1e-5);
    }
  }
}

}  // namespace
