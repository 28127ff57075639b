#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "scenes/body_scenes.hpp"
#include "scenes/box_scenes.hpp"
#include "stiction/residual.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/error_message.hpp"
#include "tests/support/systems/body_systems.hpp"

/// Newton's method in body space through the public interface, against the assembled contact system, whose judge shares
/// nothing with it.
namespace stiction::test {

namespace {

using scenes::box_bodies;
using scenes::box_pyramid;
using scenes::box_tower;
using scenes::box_wall;

using Env = BodyEnvironment<double>;

constexpr BodyPreconditioner kPreconditioners[] = {
    BodyPreconditioner::diagonal,       BodyPreconditioner::block_diagonal, BodyPreconditioner::incomplete_cholesky,
    BodyPreconditioner::sparse_inverse, BodyPreconditioner::factor,         BodyPreconditioner::multigrid};

BodySolverOptions newton(Law law, double tolerance, BodyPreconditioner preconditioner = BodyPreconditioner::factor) {
  BodySolverOptions options = newton_options(law, preconditioner);
  options.iterations = 200;
  options.tolerance = tolerance;
  return options;
}

TimeStepping compliant(double R) {
  TimeStepping stepping;
  stepping.cfm = R * stepping.dt;
  return stepping;
}

BodySolution<double> solve_one(const Env& env, const BodySolverOptions& options, const TimeStepping& stepping = {}) {
  return solve_bodies(batch_of<double>({env}), stepping, options);
}

/// Solves and lets the assembled system judge. Rounding of the judge's own is 1e-16 of entries of A lambda, which are
/// some hundred times b.
void expect_solved(const Env& env, const BodySolverOptions& options, const TimeStepping& stepping,
                   const std::string& where) {
  const auto solution = solve_one(env, options, stepping);
  EXPECT_EQ(solution.status[0].code, EnvCode::solved)
      << where << ": residual " << solution.status[0].residual << " after " << solution.status[0].iterations;
  ContactBatch<double> batch(options.law);
  batch.add(scenes::delassus_form(env, stepping));
  const Residual judged = verify(batch.view(), std::span<const double>(solution.impulse)).at(0);
  EXPECT_LE(judged.relative, options.tolerance + 1e-12) << where;
}

Env pushed(Env env, double mu) {
  for (auto& body : env.bodies) body.twist = {1, 0.3, 0, 0, 0, 0.2};
  for (auto& contact : env.contacts) contact.mu = mu;
  return env;
}

/// One box on the floor with 8 x 8 contacts below it.
Env carpet() {
  Env env = box_bodies(box_tower(1), 0.5);
  const auto corner = env.contacts.front();
  env.contacts.clear();
  for (int x = 0; x < 8; ++x)
    for (int y = 0; y < 8; ++y) {
      auto contact = corner;
      contact.arm_b = {x / 7.0 - 0.5, y / 7.0 - 0.5, -0.5};
      env.contacts.push_back(contact);
    }
  return env;
}

}  // namespace

TEST(BodyNewton, SolvesTheConvexLawWithEveryPreconditioner) {
  for (const BodyPreconditioner preconditioner : kPreconditioners)
    for (const double R : {1e-2, 1e-4}) {
      const std::string where = std::string(to_string(preconditioner)) + ", R " + std::to_string(R);
      const BodySolverOptions options = newton(Law::convex, 1e-10, preconditioner);
      expect_solved(scenes::make_body_pile(3, 60), options, compliant(R), where + ", pile");
      expect_solved(box_bodies(box_wall(4, 4), 0.5), options, compliant(R), where + ", wall");
    }
}

TEST(BodyNewton, SolvesCoulombsLawWithEveryPreconditioner) {
  for (const BodyPreconditioner preconditioner : kPreconditioners) {
    const BodySolverOptions options = newton(Law::coulomb, 1e-8, preconditioner);
    expect_solved(scenes::make_body_stack(3, 6), options, {}, std::string(to_string(preconditioner)) + ", stack");
    expect_solved(pushed(box_bodies(box_tower(5), 0.5), 0.5), options, compliant(1e-3),
                  std::string(to_string(preconditioner)) + ", pushed tower");
  }
}

TEST(BodyNewton, NeedsNoCompliance) {
  for (const Law law : {Law::convex, Law::coulomb}) {
    const BodySolverOptions options = newton(law, law == Law::convex ? 1e-10 : 1e-8);
    const std::string where = to_string(law);
    expect_solved(box_bodies(box_tower(20), 0.5), options, {}, where + ", tower");
    expect_solved(box_bodies(box_wall(5, 5), 0.5), options, {}, where + ", wall");
    expect_solved(box_bodies(box_pyramid(4), 0.5), options, {}, where + ", pyramid");
    expect_solved(pushed(box_bodies(box_tower(6), 0.5), 0.5), options, {}, where + ", pushed tower");
    expect_solved(carpet(), options, {}, where + ", 64 contacts on one face");
    expect_solved(pushed(carpet(), 0.3), options, {}, where + ", 64 contacts that slide");
  }
}

TEST(BodyNewton, TakesNoAndMuchFriction) {
  for (const double mu : {0.0, 2.0})
    for (const Law law : {Law::convex, Law::coulomb})
      for (const double R : {0.0, 1e-3})
        expect_solved(pushed(box_bodies(box_tower(4), mu), mu), newton(law, law == Law::convex ? 1e-10 : 1e-8),
                      compliant(R),
                      std::string(to_string(law)) + ", mu " + std::to_string(mu) + ", R " + std::to_string(R));
}

TEST(BodyNewton, CarriesAThousandTimesItsWeight) {
  Env env = box_bodies(box_tower(5), 0.5);
  env.bodies.back().inv_mass /= 1000;
  for (double& v : env.bodies.back().inv_inertia) v /= 1000;
  for (const Law law : {Law::convex, Law::coulomb})
    for (const double R : {0.0, 1e-3})
      expect_solved(env, newton(law, 1e-8), compliant(R), std::string(to_string(law)) + ", R " + std::to_string(R));
}

/// If the answer is unique in velocities (convex law with compliance), another method finds the same ones.
TEST(BodyNewton, VelocitiesAgreeWithSequentialImpulses) {
  const Env env = scenes::make_body_pile(11, 40);
  const TimeStepping stepping = compliant(0.02);
  const auto solution = solve_one(env, newton(Law::convex, 1e-11), stepping);
  ASSERT_EQ(solution.status[0].code, EnvCode::solved);
  BodySolverOptions impulses;
  impulses.law = Law::convex;
  impulses.iterations = 50000;
  impulses.tolerance = 1e-11;
  const auto expected = solve_one(env, impulses, stepping);
  ASSERT_EQ(expected.status[0].code, EnvCode::solved);
  // Residuals of 1e-11 of b, which is below 1 here. Compliance makes impulses of them at most 50 times as large, and
  // the balls' inverse masses velocities.
  for (std::size_t i = 0; i < expected.twist.size(); ++i) EXPECT_NEAR(solution.twist[i], expected.twist[i], 1e-8);
}

/// By hand: friction mu m g dt against the motion; a torque about y spins the ball up.
TEST(BodyNewton, ASlidingBallIsBrakedByMuAndSetSpinning) {
  const double mu = 0.3, mass = 2, radius = 0.1;
  Env env = ball_on_floor(radius, mass, mu);
  env.bodies[0].twist = {1, 0, 0, 0, 0, 0};
  env.bodies[0].twist_change[2] = -kFall;
  const auto solution = solve_one(env, newton(Law::coulomb, 1e-12));
  const double friction = mu * mass * kFall;
  EXPECT_NEAR(solution.impulse[0], mass * kFall, 1e-9);
  EXPECT_NEAR(solution.twist[0], 1 - friction / mass, 1e-9);
  EXPECT_NEAR(solution.twist[4], radius * friction / (0.4 * mass * radius * radius), 1e-9);
}

TEST(BodyNewton, ATowerOfFiftyTakesTensOfStepsWhereImpulsesTakeThousandsOfSweeps) {
  const Env env = box_bodies(box_tower(50), 0.5);
  for (const BodyPreconditioner preconditioner :
       {BodyPreconditioner::block_diagonal, BodyPreconditioner::factor, BodyPreconditioner::multigrid}) {
    const auto solution = solve_one(env, newton(Law::convex, 1e-6, preconditioner), compliant(1e-3));
    EXPECT_EQ(solution.status[0].code, EnvCode::solved);
    EXPECT_LE(solution.status[0].iterations, 50) << to_string(preconditioner);
  }
  BodySolverOptions impulses;
  impulses.law = Law::convex;
  impulses.iterations = 1000;
  impulses.tolerance = 1e-6;
  EXPECT_EQ(solve_one(env, impulses, compliant(1e-3)).status[0].code, EnvCode::max_iterations);
}

/// Enough bodies for three levels, below which a W-cycle is a V-cycle; the assembled system of so many would take a
/// minute.
TEST(BodyNewton, MultigridHasCyclesAndProlongationsToChooseFrom) {
  const Env env = box_bodies(box_tower(250), 0.5);
  std::vector<std::vector<double>> impulses;
  for (const Prolongation prolongation : {Prolongation::plain, Prolongation::smoothed})
    for (const Cycle cycle : {Cycle::v, Cycle::w}) {
      BodySolverOptions options = newton(Law::convex, 1e-8, BodyPreconditioner::multigrid);
      options.space.multigrid = {prolongation, cycle};
      const auto solution = solve_one(env, options, compliant(1e-3));
      EXPECT_EQ(solution.status[0].code, EnvCode::solved) << solution.status[0].residual;
      EXPECT_EQ(solution.status[0].solver, SolverKind::multigrid);
      EXPECT_THAT(impulses, ::testing::Not(::testing::Contains(solution.impulse))) << "each is a method of its own";
      impulses.push_back(solution.impulse);
    }
}

TEST(BodyNewton, BodiesThatNothingTouchesFlyAndKinematicOnesAreNotPushed) {
  Env env = pushed(box_bodies(box_tower(3), 0.4), 0.4);
  Env::Body belt;
  belt.kinematic = true;
  belt.twist = {3, 0, 0, 0, 0, 0};
  env.bodies.push_back(belt);
  for (auto& contact : env.contacts)
    if (contact.body_a < 0) contact.body_a = 3;
  Env::Body free;
  free.twist = {1, 2, 3, 4, 5, 6};
  free.twist_change = {0, 0, -1, 0, 0, 0};
  env.bodies.push_back(free);
  for (const BodyPreconditioner preconditioner : kPreconditioners) {
    const auto solution = solve_one(env, newton(Law::coulomb, 1e-8, preconditioner));
    EXPECT_EQ(solution.status[0].code, EnvCode::solved) << to_string(preconditioner);
    EXPECT_EQ(std::vector<double>(solution.twist.begin() + 18, solution.twist.begin() + 24),
              (std::vector<double>{3, 0, 0, 0, 0, 0}));
    EXPECT_EQ(std::vector<double>(solution.twist.begin() + 24, solution.twist.end()),
              (std::vector<double>{1, 2, 2, 4, 5, 6}));
  }
}

TEST(BodyNewton, BodiesThatCannotTurnOrMoveAreNotTurnedOrMoved) {
  Env env = pushed(box_bodies(box_tower(3), 0.4), 0.4);
  env.bodies[1].inv_inertia = {};
  env.bodies[2].inv_mass = 0;
  env.bodies[2].inv_inertia = {0, 0, 0, 0, 0, 2};
  env.bodies[2].twist_change = {};
  expect_solved(env, newton(Law::convex, 1e-8), compliant(1e-3), "convex");
  expect_solved(env, newton(Law::coulomb, 1e-8), compliant(1e-3), "coulomb");
}

/// By hand: u + R lambda = 0, inside the cone for a slow slide.
TEST(BodyNewton, WhereNothingCanBeMovedComplianceAloneAnswers) {
  Env env = ball_on_floor(0.1, 2.0, 0.5);
  env.bodies[0].inv_mass = 0;
  env.bodies[0].inv_inertia = {};
  env.bodies[0].twist = {0.2, 0, -1, 0, 0, 0};
  for (const Law law : {Law::convex, Law::coulomb})
    for (const BodyPreconditioner preconditioner : kPreconditioners) {
      const auto solution = solve_one(env, newton(law, 1e-12, preconditioner), compliant(1e-2));
      EXPECT_EQ(solution.status[0].code, EnvCode::solved) << to_string(preconditioner);
      EXPECT_NEAR(solution.impulse[0], 100, 1e-9);
      EXPECT_NEAR(std::hypot(solution.impulse[1], solution.impulse[2]), 20, 1e-9);
      EXPECT_EQ(solution.twist, (std::vector<double>{0.2, 0, -1, 0, 0, 0}));
    }
}

TEST(BodyNewton, ContactsThatAllOpenLoseWhatAWarmStartGaveThem) {
  Env env = box_bodies(box_tower(3), 0.5);
  for (std::size_t k = 0; k < env.bodies.size(); ++k) env.bodies[k].twist[2] = 1.0 + static_cast<double>(k);
  const std::vector<double> pushes(3 * env.contacts.size(), 0.01);
  for (const Law law : {Law::convex, Law::coulomb})
    for (const BodyPreconditioner preconditioner : kPreconditioners) {
      const auto solution = solve_bodies(batch_of<double>({env}), {}, newton(law, 1e-12, preconditioner), Device::cpu(),
                                         std::span<const double>(pushes));
      EXPECT_EQ(solution.status[0].code, EnvCode::solved) << to_string(preconditioner);
      EXPECT_EQ(solution.impulse, std::vector<double>(pushes.size(), 0.0)) << to_string(preconditioner);
    }
}

TEST(BodyNewton, NothingToSolveIsSolved) {
  Env flight;
  flight.bodies.resize(1);
  flight.bodies[0].twist_change = {0, 0, -1, 0, 0, 0};
  Env still = box_bodies(box_tower(2), 0.5);
  for (auto& body : still.bodies) body.twist_change = {};
  for (const BodyPreconditioner preconditioner : kPreconditioners) {
    const auto solution =
        solve_bodies(batch_of<double>({Env{}, flight, still}), {}, newton(Law::coulomb, 0, preconditioner));
    for (const EnvStatus& status : solution.status) {
      EXPECT_EQ(status.code, EnvCode::solved);
      EXPECT_EQ(status.residual, 0);
    }
    EXPECT_EQ(solution.twist[2], -1);
  }
}

TEST(BodyNewton, AWarmStartAtTheAnswerNeedsNoStep) {
  const Env env = box_bodies(box_tower(10), 0.5);
  BodySolverOptions options = newton(Law::coulomb, 1e-8);
  const auto batch = batch_of<double>({env});
  const auto cold = solve_bodies(batch, {}, options);
  ASSERT_EQ(cold.status[0].code, EnvCode::solved);
  ASSERT_GT(cold.status[0].iterations, 0);
  options.tolerance = 1.01 * cold.status[0].residual;
  const auto warm = solve_bodies(batch, {}, options, Device::cpu(), std::span<const double>(cold.impulse));
  EXPECT_EQ(warm.status[0].code, EnvCode::solved);
  EXPECT_EQ(warm.status[0].iterations, 0);
}

TEST(BodyNewton, SubStepsFollowEachOtherAsThoseOfImpulsesDo) {
  Env env = ball_on_floor(0.1, 2.0, 0.0);
  env.contacts[0].restitution = 0.5;
  env.bodies[0].twist[2] = -2;
  env.bodies[0].twist_change[2] = -kFall;
  BodySolverOptions options = newton(Law::coulomb, 1e-10);
  options.substeps = 4;
  // It bounces in the first one, and flies under its weight in the other three.
  EXPECT_NEAR(solve_one(env, options).twist[2], 1 - 0.75 * kFall, 1e-9);
}

TEST(BodyNewton, CapacityAndPoisonAreAnsweredAsByImpulses) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Env deep = carpet();
  for (std::size_t c = 0; c < deep.contacts.size(); ++c) deep.contacts[c].depth = 1e-4 * static_cast<double>(c % 7);
  Env bad = box_bodies(box_tower(2), 0.5);
  bad.contacts[1].arm_b[0] = nan;
  BodySolverOptions options = newton(Law::coulomb, 1e-8, BodyPreconditioner::multigrid);
  options.max_contacts_per_env = 12;
  options.invalid = InvalidPolicy::isolate;
  const auto solution = solve_bodies(batch_of<double>({deep, bad, deep}), {}, options);
  EXPECT_EQ(solution.status[0].code, EnvCode::solved);
  EXPECT_EQ(solution.status[0].flags, static_cast<std::uint32_t>(kFlagContactsDropped));
  EXPECT_EQ(solution.status[0].solver, SolverKind::multigrid);
  EXPECT_EQ(solution.status[1].code, EnvCode::invalid_input);
  EXPECT_EQ(solution.status[1].flags, static_cast<std::uint32_t>(kFlagNonFiniteInput));
  EXPECT_TRUE(same_bits(std::span<const double>(solution.impulse).first(192),
                        std::span<const double>(solution.impulse).last(192)));
}

TEST(BodyNewton, WithoutASolutionItSaysThatItStalledOrRanOutAndStaysFinite) {
  // Two kinematic walls that close in on a ball.
  Env env = ball_on_floor(0.1, 2.0, 0.5);
  env.bodies.resize(3);
  for (const int k : {1, 2}) {
    auto& wall = env.bodies[static_cast<std::size_t>(k)];
    wall.kinematic = true;
    wall.twist = {k == 1 ? 1.0 : -1.0, 0, 0, 0, 0, 0};
    auto& contact = k == 1 ? env.contacts.front() : env.contacts.emplace_back(env.contacts.front());
    contact.body_a = k;
    contact.normal = {k == 1 ? 1.0 : -1.0, 0, 0};
    contact.arm_b = {k == 1 ? -0.1 : 0.1, 0, 0};
  }
  for (const Law law : {Law::convex, Law::coulomb}) {
    const auto solution = solve_one(env, newton(law, 1e-8));
    EXPECT_THAT(solution.status[0].code, ::testing::AnyOf(EnvCode::stalled, EnvCode::max_iterations));
    EXPECT_LE(solution.status[0].iterations, 200);
    EXPECT_GT(solution.status[0].residual, 0.1);
    for (const double v : solution.twist) EXPECT_TRUE(std::isfinite(v));
  }
}

TEST(BodyNewton, MassesBeyondSinglePrecisionEndInAFiniteAnswer) {
  const auto solution = solve_bodies(batch_of<float>({beyond_single_precision()}), {}, newton(Law::coulomb, 1e-6));
  for (const float v : solution.twist) EXPECT_TRUE(std::isfinite(v));
  for (const float v : solution.impulse) EXPECT_TRUE(std::isfinite(v));
}

TEST(BodyNewton, SinglePrecisionEndsWhereItsImpulsesDo) {
  const auto env = scenes::rounded(box_bodies(box_tower(20), 0.5));
  const auto solution = solve_bodies(batch_of<float>({env}), compliant(1e-3), newton(Law::coulomb, 1e-5));
  EXPECT_EQ(solution.status[0].code, EnvCode::solved);
  // Impulses that are rounded to 2^-24 are off by that times A lambda, which is some hundred times b. No method gets
  // below, and this one reports it and returns its best.
  const auto best = solve_bodies(batch_of<float>({env}), compliant(1e-3), newton(Law::coulomb, 0));
  EXPECT_NE(best.status[0].code, EnvCode::solved);
  EXPECT_LE(best.status[0].residual, solution.status[0].residual);
}

TEST(BodyNewton, MisuseIsNamed) {
  using ::testing::HasSubstr;
  const auto batch = batch_of<double>({box_bodies(box_tower(2), 0.5)});
  std::vector<double> impulse(100), twist(100);
  std::vector<EnvStatus> status(1);
  const BodySolutionView<double> out{impulse.data(), twist.data(), nullptr, status.data()};
  const BodySolver impulses(Device::cpu(), {}, {});
  const BodySolver factor(Device::cpu(), {}, newton(Law::convex, 1e-8));
  const BodySolver multigrid(Device::cpu(), {}, newton(Law::convex, 1e-8, BodyPreconditioner::multigrid));
  EXPECT_THAT(error_message([&] { factor.solve(impulses.plan(batch.view()), batch.view(), out); }),
              HasSubstr("make it by a solver that has them"));
  EXPECT_THAT(error_message([&] { factor.solve(multigrid.plan(batch.view()), batch.view(), out); }),
              HasSubstr("make it by a solver that has them"));
  EXPECT_EQ(error_message([&] { impulses.solve(factor.plan(batch.view()), batch.view(), out); }), "");
  BodySolverOptions unknown = newton(Law::convex, 1e-8);
  unknown.space.preconditioner = static_cast<BodyPreconditioner>(77);
  EXPECT_THAT(error_message([&] { const BodySolver solver(Device::cpu(), {}, unknown); }),
              HasSubstr("preconditioner = 77"));
  const auto refusal_of = [](auto&& change) {
    BodySolverOptions wrong = newton(Law::convex, 1e-8);
    change(wrong.space);
    return error_message([&] { const BodySolver solver(Device::cpu(), {}, wrong); });
  };
  EXPECT_THAT(refusal_of([](BodySpaceOptions& space) { space.ordering = static_cast<Ordering>(77); }),
              HasSubstr("ordering = 77"));
  EXPECT_THAT(refusal_of([](BodySpaceOptions& space) { space.multigrid.cycle = static_cast<Cycle>(3); }),
              HasSubstr("cycle = 3"));
  EXPECT_THAT(refusal_of([](BodySpaceOptions& space) { space.multigrid.prolongation = static_cast<Prolongation>(9); }),
              HasSubstr("prolongation = 9"));
  EXPECT_THAT(error_message([&] { body_preconditioner_from_string("ilu"); }),
              HasSubstr("sparse_inverse, factor, multigrid"));
  EXPECT_THAT(error_message([&] { solver_from_string("multigrid"); }), HasSubstr("BodySolver"));
  SolverOptions contact;
  contact.solver = SolverKind::multigrid;
  EXPECT_THAT(error_message([&] { const Solver solver(Device::cpu(), contact); }), HasSubstr("BodySolver"));
}

}  // namespace stiction::test
