#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "stiction/error.hpp"
#include "stiction/jacobian_solver.hpp"
#include "stiction/residual.hpp"
#include "stiction/trace.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/roomy_jacobians.hpp"
#include "tests/support/systems/velocity_cases.hpp"

/// Newton's method in velocities as callers meet it: solver auto, where J and M are given.
namespace {

using namespace stiction;
using namespace stiction::test;

constexpr MassForm kBothForms[] = {MassForm::matrix, MassForm::factor};

JacobianBatch<double> batch_of(const std::vector<JacobianEnvironment<double>>& envs, Law law = Law::convex,
                               MassForm form = MassForm::matrix) {
  JacobianBatch<double> batch(law, form);
  for (const auto& env : envs) batch.add(in_form(env, form));
  return batch;
}

/// One contact of mu = 1/2 under a body of mass 1 that would move with (-2, 3, 0), and a limit that is far away. It is
/// one row more than degrees of freedom.
JacobianEnvironment<double> pressed_and_sliding() {
  JacobianEnvironment<double> env;
  env.cones = {friction(3), unilateral()};
  env.J = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 0};
  env.target = {0, 0, 0, -10};
  env.M = diagonal({1, 1, 1});
  env.v_free = {-2, 3, 0};
  env.mu = {0, 0.5, 0.5, 0};
  return env;
}

void expect_near(const std::vector<double>& expected, const std::vector<double>& actual, double allowed) {
  EXPECT_LE(largest_difference(expected, actual), allowed);
}

TEST(VelocityNewton, SolvesTheContactOfTheResidualsPage) {
  // docs/math/residual.md, "Examples to check by hand"; R = 0, so the proximal loop is needed.
  const auto convex = solve(batch_of({pressed_and_sliding()}), options(SolverKind::automatic, 1e-10, 1000));
  EXPECT_EQ(convex.contact.status[0].solver, SolverKind::velocity_newton);
  expect_near({2.8, -1.4, 0, 0}, convex.contact.lambda, 1e-9);
  expect_near({0.8, 1.6, 0}, convex.velocity, 1e-9);
  const auto coulomb =
      solve(batch_of({pressed_and_sliding()}, Law::coulomb), options(SolverKind::automatic, 1e-10, 1000));
  EXPECT_EQ(coulomb.contact.status[0].solver, SolverKind::velocity_newton);
  expect_near({2, -1, 0, 0}, coulomb.contact.lambda, 1e-9);
  expect_near({0, 2, 0}, coulomb.velocity, 1e-9);
}

/// Chains with more rows than degrees of freedom; `further` lengthens them.
std::vector<JacobianEnvironment<double>> chains(double compliance, Index further = 0) {
  std::vector<JacobianEnvironment<double>> envs;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const bool every = seed % 2 == 0;
    const auto contacts = static_cast<Index>(2 + seed % 4);
    const Index dofs = every ? static_cast<Index>(8 + seed % 12) : 3 * contacts * 3 / 4;
    const auto cones =
        every ? cones_of_every_kind() : std::vector<Cone>(static_cast<std::size_t>(contacts), friction(3));
    envs.push_back(random_chain({seed, dofs + further, cones, 0.0, compliance}));
  }
  return envs;
}

/// A box that falls and slides on a plane, on its four corners: 12 rows for 6 degrees of freedom, without compliance.
JacobianEnvironment<double> box_on_corners(std::uint64_t seed) {
  scenes::Rng rng(seed);
  const double half[3] = {rng.uniform(0.2, 1.0), rng.uniform(0.2, 1.0), rng.uniform(0.2, 1.0)};
  JacobianEnvironment<double> env;
  const double mass = rng.uniform(0.5, 5.0);
  std::vector<double> M(6, mass);
  for (int k = 0; k < 3; ++k) {
    const double a = half[(k + 1) % 3], b = half[(k + 2) % 3];
    M[static_cast<std::size_t>(3 + k)] = mass / 3 * (a * a + b * b);
  }
  env.M = diagonal(M);
  env.v_free = {rng.symmetric(2.0), rng.symmetric(2.0), -rng.uniform(0.1, 1.0), 0, 0, 0};
  for (int k = 3; k < 6; ++k) env.v_free[static_cast<std::size_t>(k)] = rng.symmetric(0.5);
  for (int corner = 0; corner < 4; ++corner) {
    const double r[3] = {corner % 2 == 0 ? half[0] : -half[0], corner / 2 == 0 ? half[1] : -half[1], -half[2]};
    env.cones.push_back(friction(3));
    for (const int axis : {2, 0, 1}) {
      double d[3] = {0, 0, 0};
      d[axis] = 1;
      for (const double entry :
           {d[0], d[1], d[2], r[1] * d[2] - r[2] * d[1], r[2] * d[0] - r[0] * d[2], r[0] * d[1] - r[1] * d[0]})
        env.J.push_back(entry);
      env.mu.push_back(axis == 2 ? 0.0 : 0.6);
    }
  }
  env.R.assign(12, 0.0);
  env.target.assign(12, 0.0);
  env.lo = env.hi = env.R;
  return env;
}
std::vector<JacobianEnvironment<double>> boxes() {
  std::vector<JacobianEnvironment<double>> envs;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) envs.push_back(box_on_corners(seed));
  return envs;
}

/// Errors of the environments' answers in double, once these were rounded to Real.
template <class Real>
std::vector<double> errors_of_rounded_answers(const std::vector<JacobianEnvironment<double>>& envs, Law law,
                                              const ContactBatch<double>& judge) {
  std::vector<double> answer = solve(batch_of(envs, law), options(SolverKind::automatic, 1e-10, 2000)).contact.lambda;
  for (double& reaction : answer) reaction = static_cast<double>(static_cast<Real>(reaction));
  std::vector<double> errors;
  for (const Residual& error : verify(judge.view(), std::span<const double>(answer))) errors.push_back(error.relative);
  return errors;
}

/// The share of environments that the method itself has solved. Every claim is held against A, b by elimination and the
/// judge that shares no code with solvers; velocities against their definition.
template <class Real>
double share_solved(const std::vector<JacobianEnvironment<double>>& envs, Law law, double tolerance,
                    MassForm form = MassForm::matrix) {
  JacobianBatch<Real> batch(law, form);
  ContactBatch<double> expected(law);
  for (const auto& env : envs) {
    batch.add(cast<Real>(in_form(env, form)));
    const JacobianOracle oracle(env, 0);
    Environment<double> contact = system(env.cones, oracle.A, oracle.b);
    contact.R = env.R;
    contact.mu = env.mu;
    contact.lo = env.lo;
    contact.hi = env.hi;
    expected.add(contact);
  }
  const auto solution = solve(batch, options(SolverKind::automatic, tolerance, 2000));
  const std::vector<double> lambda(solution.contact.lambda.begin(), solution.contact.lambda.end());
  const auto judged = verify(expected.view(), std::span<const double>(lambda));
  // In single precision J and M are not quite those of the judge.
  const double rounding = sizeof(Real) == sizeof(float) ? 3e-5 : 1e-11;
  const std::vector<double> limits = errors_of_rounded_answers<Real>(envs, law, expected);
  int solved = 0;
  for (std::size_t e = 0; e < envs.size(); ++e) {
    const EnvStatus& status = solution.contact.status[e];
    SCOPED_TRACE("env " + std::to_string(e) + " by " + to_string(status.solver));
    if (status.code == EnvCode::rounding) {
      EXPECT_GT(limits[e], tolerance) << "the answer in double, rounded, is solved";
    } else {
      EXPECT_EQ(status.code, EnvCode::solved);
      EXPECT_LE(status.residual, tolerance);
      EXPECT_NEAR(judged[e].relative, status.residual, rounding);
    }
    solved += status.solver == SolverKind::velocity_newton ? 1 : 0;
  }
  std::size_t row = 0, dof = 0;
  for (const auto& env : envs) {
    const JacobianOracle oracle(env, 0);
    const std::size_t n = env.mu.size();
    for (std::size_t k = 0; k < env.v_free.size(); ++k) {
      double velocity = env.v_free[k], size = 1.0;
      for (std::size_t i = 0; i < n; ++i) {
        const double change = oracle.response[k * n + i] * lambda[row + i];
        velocity += change;
        size += std::abs(change);
      }
      EXPECT_NEAR(velocity, static_cast<double>(solution.velocity[dof + k]), 1e2 * rounding * size);
    }
    row += n;
    dof += env.v_free.size();
  }
  return static_cast<double>(solved) / static_cast<double>(envs.size());
}

TEST(VelocityNewton, SolvesChainsWithConesOfEveryKind) {
  for (const MassForm form : kBothForms) {
    SCOPED_TRACE(form == MassForm::matrix ? "M" : "its factor");
    EXPECT_EQ(share_solved<double>(chains(0.01), Law::convex, 1e-9, form), 1.0);
    EXPECT_GE(share_solved<double>(chains(0.01, 30), Law::convex, 1e-9, form), 0.95);
    EXPECT_GE(share_solved<double>(chains(0.01), Law::coulomb, 1e-9, form), 0.95);
    EXPECT_EQ(share_solved<float>(chains(0.01), Law::convex, 1e-4, form), 1.0);
    EXPECT_GE(share_solved<float>(chains(0.01), Law::coulomb, 1e-4, form), 0.9);
  }
}

std::vector<JacobianEnvironment<double>> reversed_all(std::vector<JacobianEnvironment<double>> envs) {
  for (auto& env : envs) env = reversed(env);
  return envs;
}

TEST(VelocityNewton, SolvesChainsWhoseFactorHasTheZerosOfTheirTree) {
  const auto envs = reversed_all(chains(0.01, 20));
  EXPECT_GE(share_solved<double>(envs, Law::convex, 1e-9, MassForm::factor), 0.95);
  EXPECT_GE(share_solved<float>(envs, Law::convex, 1e-4, MassForm::factor), 0.95);
}

TEST(VelocityNewton, AFactorThatIsNoneIsFlaggedAsItIsByA) {
  const double infinite = std::numeric_limits<double>::infinity();
  SolverOptions o = options(SolverKind::automatic, 1e-8, 1000);
  o.invalid = InvalidPolicy::isolate;
  for (const Index dofs : {7, 20})
    for (const double broken : {0.0, -1.0, infinite, std::numeric_limits<double>::quiet_NaN()})
      for (const bool on_diagonal : {true, false}) {
        if (!on_diagonal && broken <= 0.0) continue;
        auto envs = std::vector<JacobianEnvironment<double>>(9, with_factor(random_chain({3, dofs})));
        const auto at = static_cast<std::size_t>(dofs) * 5 + (on_diagonal ? 5 : 2);
        envs[4].M[at] = broken;
        JacobianBatch<double> batch(Law::convex, MassForm::factor);
        for (const auto& env : envs) batch.add(env);
        const auto solution = solve(batch, o);
        for (std::size_t e = 0; e < envs.size(); ++e) {
          const EnvStatus& status = solution.contact.status[e];
          EXPECT_EQ(status.code, e == 4 ? EnvCode::invalid_input : EnvCode::solved);
          EXPECT_EQ(status.flags, e == 4 ? static_cast<std::uint32_t>(kFlagBadMass) : 0U) << broken << " at " << at;
          EXPECT_EQ(status.solver == SolverKind::velocity_newton, e != 4);
        }
      }
}

TEST(VelocityNewton, SolvesRigidRowsByAProximalTerm) {
  EXPECT_GE(share_solved<double>(boxes(), Law::convex, 1e-8), 0.9);
  EXPECT_GE(share_solved<double>(boxes(), Law::coulomb, 1e-6), 0.9);
}

TEST(VelocityNewton, ReachesTheOnlySolutionOfACompliantProblem) {
  // With R > 0 the convex problem has one solution, which interior points reach from elsewhere.
  const auto points = solve(batch_of(chains(0.05)), options(SolverKind::ipm, 1e-11, 1000));
  for (const MassForm form : kBothForms) {
    const auto newton = solve(batch_of(chains(0.05), Law::convex, form), options(SolverKind::automatic, 1e-11, 1000));
    ASSERT_EQ(newton.contact.status[0].solver, SolverKind::velocity_newton);
    for (std::size_t i = 0; i < newton.contact.lambda.size(); ++i)
      EXPECT_NEAR(newton.contact.lambda[i], points.contact.lambda[i], 1e-8 * (1 + std::abs(points.contact.lambda[i])));
  }
}

TEST(VelocityNewton, CompliancesThatDifferAlongAConeAreMadeEqualByTheProximalTerm) {
  auto envs = chains(0.02);
  for (auto& env : envs)
    for (std::size_t i = 0; i < env.R.size(); ++i) env.R[i] *= 1.0 + 0.7 * static_cast<double>(i % 3);
  EXPECT_GE(share_solved<double>(envs, Law::convex, 1e-9), 0.95);
}

TEST(VelocityNewton, AxesWithoutFrictionCarryNone) {
  auto envs = chains(0.01);
  for (auto& env : envs)
    for (std::size_t i = 0; i < env.mu.size(); i += 3) env.mu[i] = 0.0;
  EXPECT_GE(share_solved<double>(envs, Law::convex, 1e-9), 0.95);
}

TEST(VelocityNewton, AWarmStartFromTheSolutionTakesAlmostNoStep) {
  for (const Law law : {Law::convex, Law::coulomb}) {
    const auto batch = batch_of(chains(0.01), law);
    const SolverOptions o = options(SolverKind::automatic, 1e-8, 1000);
    const auto cold = solve(batch, o);
    const auto warm = solve(batch, o, Device::cpu(), std::span<const double>(cold.contact.lambda));
    Index before = 0, after = 0;
    for (std::size_t e = 0; e < cold.contact.status.size(); ++e) {
      if (cold.contact.status[e].solver != SolverKind::velocity_newton) continue;
      EXPECT_EQ(warm.contact.status[e].code, EnvCode::solved);
      before += cold.contact.status[e].iterations;
      after += warm.contact.status[e].iterations;
    }
    EXPECT_LE(4 * after, before) << to_string(law);
  }
}

TEST(VelocityNewton, AWarmStartWithoutFiniteSquaresIsFlaggedAndForgotten) {
  const auto batch = batch_of(chains(0.01));
  const SolverOptions o = options(SolverKind::automatic, 1e-8, 1000);
  const auto cold = solve(batch, o);
  for (const double none : {std::numeric_limits<double>::infinity(), -1e300}) {
    std::vector<double> guess(cold.contact.lambda.size(), 0.0);
    guess[2] = none;
    const auto warm = solve(batch, o, Device::cpu(), std::span<const double>(guess));
    EXPECT_EQ(warm.contact.status[0].flags, static_cast<std::uint32_t>(kFlagWarmStartRejected));
    EXPECT_EQ(warm.contact.status[0].code, EnvCode::solved);
    EXPECT_EQ(warm.contact.status[1].flags, 0U);
  }
}

TEST(VelocityNewton, WhatItDoesNotTakeIsSolvedByTheOthers) {
  const auto solver_of = [](const JacobianBatch<double>& batch, const SolverOptions& o) {
    const auto status = solve(batch, o).contact.status[0];
    EXPECT_EQ(status.code, EnvCode::solved);
    return status.solver;
  };
  const SolverOptions o = options(SolverKind::automatic, 1e-6, 5000);
  const auto env = random_chain({3, 12});
  EXPECT_EQ(solver_of(batch_of({env}), o), SolverKind::velocity_newton);
  EXPECT_NE(solver_of(batch_of({random_jacobian({3, 3, 2, 200})}), o), SolverKind::velocity_newton) << "too many";
  EXPECT_NE(solver_of(batch_of({env}, Law::coulomb), o), SolverKind::velocity_newton) << "fewer rows than it pays for";
  EXPECT_EQ(solver_of(batch_of({random_chain({3, 6})}, Law::coulomb), o), SolverKind::velocity_newton);
  SolverOptions apart = o;
  apart.islands = IslandMode::apart;
  EXPECT_NE(solver_of(batch_of({env}), apart), SolverKind::velocity_newton);
  EXPECT_THROW((void)solve(batch_of({env}), options(SolverKind::velocity_newton, 1e-6, 100)), Error);
}

TEST(VelocityNewton, EndsWhereItsIterationsDo) {
  auto env = random_chain({5, 20, cones_of_every_kind(), 0.0, 0.001});
  SolverOptions o = options(SolverKind::automatic, 1e-8, 0);
  const auto none = solve(batch_of({env}), o);
  EXPECT_NE(none.contact.status[0].code, EnvCode::solved);
  EXPECT_NE(none.contact.status[0].solver, SolverKind::velocity_newton);
  // Nor is a step taken to a warm start; an answer already needs none.
  env = random_chain({3, 12});
  const auto answer = solve(batch_of({env}), options(SolverKind::automatic, 1e-8, 1000)).contact.lambda;
  auto near = answer;
  for (double& reaction : near) reaction *= 0.99;
  const auto warm = solve(batch_of({env}), o, Device::cpu(), std::span<const double>(near));
  EXPECT_NE(warm.contact.status[0].code, EnvCode::solved);
  const auto at_once = solve(batch_of({env}), o, Device::cpu(), std::span<const double>(answer));
  EXPECT_EQ(at_once.contact.status[0].code, EnvCode::solved);
  EXPECT_EQ(at_once.contact.status[0].iterations, 0);
}

TEST(VelocityNewton, ARowThatMovesNothingIsFlaggedAsItIsByEveryOtherSolver) {
  auto env = random_chain({3, 4, cones_of_every_kind()});
  for (std::size_t k = 0; k < 4; ++k) env.J[k] = 0.0;
  env.R[0] = 0.0;
  const auto solution = solve(batch_of({env}), options(SolverKind::automatic, 1e-6, 1000)).contact;
  EXPECT_EQ(solution.lambda[0], 0.0);
  EXPECT_EQ(solution.status[0].flags & static_cast<std::uint32_t>(kFlagBadDiagonal), 0U);
  EXPECT_TRUE(solution.status[0].code == EnvCode::solved || solution.status[0].code == EnvCode::infeasible);
  EXPECT_EQ((solution.status[0].flags & static_cast<std::uint32_t>(kFlagImmovable)) != 0,
            solution.status[0].code == EnvCode::infeasible);
}

TEST(VelocityNewton, ATracerSeesIt) {
  Tracer tracer;
  SolverOptions o = options(SolverKind::automatic, 1e-6, 1000);
  o.tracer = &tracer;
  (void)solve(batch_of(chains(0.01)), o);
  const auto spans = tracer.spans();
  EXPECT_TRUE(std::any_of(spans.begin(), spans.end(), [](const Span& span) {
    return std::string(span.name) == "velocity_newton" && span.environments == 40;
  }));
}

TEST(VelocityNewton, RefusalsWriteNothing) {
  auto envs = chains(0.01);
  envs[7].J[0] = std::numeric_limits<double>::quiet_NaN();
  const auto batch = batch_of(envs);
  const auto view = batch.view();
  JacobianSolver<double> solver(Device::cpu(), options(SolverKind::automatic, 1e-6, 1000), {});
  std::vector<double> lambda(static_cast<std::size_t>(view.row_count), -7.0), w = lambda;
  std::vector<double> velocity(static_cast<std::size_t>(view.dof_count), -7.0);
  std::vector<EnvStatus> status(envs.size());
  EXPECT_THROW(solver.solve(view, {lambda.data(), w.data(), velocity.data(), status.data()}), Error);
  for (const auto* array : {&lambda, &w, &velocity})
    EXPECT_TRUE(std::all_of(array->begin(), array->end(), [](double x) { return x == -7.0; }));
}

TEST(VelocityNewton, ThreadsAndNeighboursReachNoBit) {
  const auto envs = chains(0.01);
  SolverOptions o = options(SolverKind::automatic, 1e-8, 1000);
  const auto one = solve(batch_of(envs, Law::coulomb), o);
  o.threads = 3;
  const auto three = solve(batch_of(envs, Law::coulomb), o);
  EXPECT_TRUE(same_bits(one.contact, three.contact));
  EXPECT_TRUE(same_bits(std::span<const double>(one.velocity), std::span<const double>(three.velocity)));
  std::size_t row = 0;
  for (std::size_t e = 0; e < envs.size(); ++e) {
    const auto alone = solve(batch_of({envs[e]}, Law::coulomb), o);
    const auto own = std::span<const double>(one.contact.lambda).subspan(row, envs[e].mu.size());
    EXPECT_TRUE(same_bits(std::span<const double>(alone.contact.lambda), own)) << "env " << e;
    row += envs[e].mu.size();
  }
}

}  // namespace
