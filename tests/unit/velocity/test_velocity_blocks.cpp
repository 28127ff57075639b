#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "stiction/jacobian_solver.hpp"
#include "stiction/residual.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/box_jacobians.hpp"
#include "tests/support/systems/roomy_jacobians.hpp"
#include "tests/support/systems/velocity_cases.hpp"

/// Newton's method in velocities on environments in blocks: many degrees of freedom, or coupled ones whose factor does
/// not pay.
namespace {

using namespace stiction;
using namespace stiction::test;

using Env = JacobianEnvironment<double>;

struct Given {
  MassForm form = MassForm::matrix;
  Index mass_block = 6;
  bool dense = false;  ///< J has every entry
};

/// J with every entry, zeros too.
void fill_rows(Env& env) {
  const std::size_t dofs = env.v_free.size(), rows = env.mu.size();
  std::vector<double> J(rows * dofs, 0.0);
  for (std::size_t row = 0; row < rows; ++row)
    for (auto k = static_cast<std::size_t>(env.row_offsets[row]);
         k < static_cast<std::size_t>(env.row_offsets[row + 1]); ++k)
      J[row * dofs + static_cast<std::size_t>(env.column[k])] += env.J[k];
  env.J = J;
  env.row_offsets.clear();
  env.column.clear();
}
Env given_as(Env env, const Given& given) {
  if (given.mass_block == 0) env.M = full_mass(env, 6);
  if (given.dense) fill_rows(env);
  return in_form(env, given.form, given.mass_block);
}
template <class Real>
JacobianBatch<Real> batch_of(const std::vector<Env>& envs, Law law, const Given& given = {}) {
  JacobianBatch<Real> batch(law, given.form, given.mass_block);
  for (const Env& env : envs) batch.add(cast<Real>(given_as(env, given)));
  return batch;
}

/// The judge that shares no code with solvers, on A.
double judged(const Env& env, Law law, const std::vector<double>& lambda) {
  return verify(assemble(batch_of<double>({env}, law).view()).view(), std::span<const double>(lambda))[0].relative;
}

template <class Real>
JacobianSolution<Real> expect_solved(const Env& env, Law law, double tolerance, const Given& given = {}) {
  const auto solution = solve(batch_of<Real>({env}, law, given), options(SolverKind::automatic, tolerance, 1000));
  EXPECT_EQ(solution.contact.status[0].solver, SolverKind::velocity_newton);
  EXPECT_EQ(solution.contact.status[0].code, EnvCode::solved);
  EXPECT_LE(solution.contact.status[0].residual, tolerance);
  const std::vector<double> lambda(solution.contact.lambda.begin(), solution.contact.lambda.end());
  // In single precision J and M are not quite those of the judge.
  const double rounding = sizeof(Real) == sizeof(float) ? 3e-5 : 1e-12;
  EXPECT_NEAR(judged(env, law, lambda), solution.contact.status[0].residual, rounding);
  const auto moved = velocities(batch_of<double>({env}, law).view(), std::span<const double>(lambda));
  for (std::size_t k = 0; k < moved.size(); ++k)
    EXPECT_NEAR(static_cast<double>(solution.velocity[k]), moved[k], 10 * rounding);
  return solution;
}

// 1224 degrees of freedom and 7488 rows: beyond a lane's limits, in either count.
TEST(VelocityBlocks, SolvesAPyramidOfAThousandDegreesOfFreedom) {
  const Env env = boxes_as_jacobian(scenes::box_pyramid(8), {.compliance = 1e-3, .push = 1.0});
  ASSERT_GT(env.v_free.size(), 1000U);
  ASSERT_GT(env.mu.size(), 7000U);
  expect_solved<double>(env, Law::convex, 1e-8);
  expect_solved<float>(env, Law::convex, 1e-4);
}

TEST(VelocityBlocks, SolvesRigidBoxesUnderBothLaws) {
  for (const Law law : {Law::convex, Law::coulomb})
    for (const auto& scene : {scenes::box_wall(9, 9), scenes::box_pyramid(5)}) {
      SCOPED_TRACE(std::to_string(scene.bodies()) + (law == Law::convex ? " convex" : " coulomb"));
      const Env env = boxes_as_jacobian(scene, {.push = 1.0});
      expect_solved<double>(env, law, 1e-6);
      expect_solved<float>(env, law, 1e-4);
    }
}

/// M in blocks, as one matrix, as its factor; J stored or dense: the same numbers in every form.
TEST(VelocityBlocks, EveryFormIsTheSameProblem) {
  const Env env = boxes_as_jacobian(scenes::box_pyramid(5), {.compliance = 1e-3, .push = 1.0});
  const auto expected = expect_solved<double>(env, Law::convex, 1e-9);
  for (const Given& given :
       {Given{MassForm::matrix, 6, true}, Given{MassForm::matrix, 0, false}, Given{MassForm::matrix, 0, true},
        Given{MassForm::factor, 6, false}, Given{MassForm::factor, 0, true}}) {
    const auto other = expect_solved<double>(env, Law::convex, 1e-9, given);
    for (std::size_t i = 0; i < expected.contact.lambda.size(); ++i)
      EXPECT_NEAR(other.contact.lambda[i], expected.contact.lambda[i], 1e-6);
    if (given.form == MassForm::matrix) {
      EXPECT_TRUE(
          same_bits(std::span<const double>(expected.contact.lambda), std::span<const double>(other.contact.lambda)));
    }
  }
}

/// The interior point on A knows nothing of velocities. With compliance the reactions are unique.
TEST(VelocityBlocks, ReachesTheOnlySolutionOfACompliantProblem) {
  const Env env = boxes_as_jacobian(scenes::box_pyramid(4), {.compliance = 1e-2, .push = 1.0});
  const auto by_points = solve(batch_of<double>({env}, Law::convex), options(SolverKind::ipm, 1e-11, 1000));
  const auto by_blocks = expect_solved<double>(env, Law::convex, 1e-10);
  for (std::size_t i = 0; i < by_blocks.contact.lambda.size(); ++i)
    EXPECT_NEAR(by_blocks.contact.lambda[i], by_points.contact.lambda[i], 1e-6);
}

/// Cones of every kind on chains of links, M dense in each chain, joined where cones touch two of them.
Env linked_chains() {
  std::vector<Env> parts;
  std::vector<Cone> cones;
  for (int k = 0; k < 4; ++k)
    for (const Cone& cone : cones_of_every_kind()) cones.push_back(cone);
  for (std::uint64_t seed = 1; seed <= 4; ++seed)
    parts.push_back(random_chain({seed, static_cast<Index>(17 + 3 * seed), cones, 0.0, 0.01}));
  Together all = together(parts, false);
  const std::size_t dofs = all.env.v_free.size();
  for (std::size_t p = 1; p < parts.size(); ++p)
    for (std::size_t k = 0; k < 3; ++k)  // the first cone of each, of three rows
      all.env.J[all.rows[p][k] * dofs + all.dofs[p - 1][k]] = 0.5;
  return all.env;
}

TEST(VelocityBlocks, SolvesEveryKindOfConeOnCoupledChains) {
  const Env env = linked_chains();
  ASSERT_GT(env.v_free.size(), 64U);
  for (const Law law : {Law::convex, Law::coulomb}) {
    JacobianBatch<double> batch(law);
    batch.add(env);
    const auto solution = solve(batch, options(SolverKind::automatic, 1e-8, 1000));
    EXPECT_EQ(solution.contact.status[0].solver, SolverKind::velocity_newton);
    const JacobianOracle oracle(env, 0);
    Environment<double> contact = system(env.cones, oracle.A, oracle.b);
    contact.R = env.R;
    contact.mu = env.mu;
    contact.lo = env.lo;
    contact.hi = env.hi;
    ContactBatch<double> exact(law);
    exact.add(contact);
    EXPECT_LE(verify(exact.view(), std::span<const double>(solution.contact.lambda))[0].relative, 1.01e-8);
  }
}

TEST(VelocityBlocks, ThreadsAndNeighboursReachNoBit) {
  std::vector<Env> envs;
  for (Index k = 0; k < 4; ++k) {
    envs.push_back(boxes_as_jacobian(scenes::box_pyramid(3 + k % 2), {.compliance = 1e-3 * k, .push = 1.0 + k}));
    envs.push_back(boxes_as_jacobian(scenes::box_tower(2), {.compliance = 0.01, .push = 1.0}));
  }
  for (const Law law : {Law::convex, Law::coulomb}) {
    SolverOptions o = options(SolverKind::automatic, 1e-4, 1000);
    const auto one = solve(batch_of<double>(envs, law), o);
    o.threads = 3;
    const auto three = solve(batch_of<double>(envs, law), o);
    EXPECT_TRUE(same_bits(one.contact, three.contact));
    EXPECT_TRUE(same_bits(std::span<const double>(one.velocity), std::span<const double>(three.velocity)));
    auto turned = envs;
    std::reverse(turned.begin(), turned.end());
    const auto back = solve(batch_of<double>(turned, law), o);
    std::size_t row = 0, end = one.contact.lambda.size();
    for (const Env& env : envs) {
      const std::size_t rows = env.mu.size();
      const auto own = std::span<const double>(one.contact.lambda).subspan(row, rows);
      EXPECT_TRUE(same_bits(own, std::span<const double>(back.contact.lambda).subspan(end - rows, rows)));
      row += rows;
      end -= rows;
    }
  }
}

TEST(VelocityBlocks, StartsFromWhatIsGiven) {
  const Env env = boxes_as_jacobian(scenes::box_pyramid(5), {.compliance = 1e-3, .push = 1.0});
  for (const Law law : {Law::convex, Law::coulomb}) {
    const double tolerance = law == Law::convex ? 1e-6 : 1e-4;
    const auto batch = batch_of<double>({env}, law);
    const auto options_of = options(SolverKind::automatic, tolerance, 1000);
    const auto cold = solve(batch, options_of);
    const auto warm = solve(batch.view(), options_of, Device::cpu(), std::span<const double>(cold.contact.lambda));
    EXPECT_EQ(warm.contact.status[0].solver, SolverKind::velocity_newton);
    EXPECT_LE(warm.contact.status[0].iterations, cold.contact.status[0].iterations / 2);
    std::vector<double> broken = cold.contact.lambda;
    broken[7] = law == Law::convex ? std::numeric_limits<double>::infinity() : 1e300;
    const auto rejected = solve(batch.view(), options_of, Device::cpu(), std::span<const double>(broken));
    EXPECT_NE(rejected.contact.status[0].flags & kFlagWarmStartRejected, 0U);
    EXPECT_TRUE(
        same_bits(std::span<const double>(rejected.contact.lambda), std::span<const double>(cold.contact.lambda)));
  }
}

}  // namespace
