// Sweeps of bodies whose threads wait for no colour: their answers, by a judge of its own, whichever thread is late.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <string>
#include <thread>
#include <vector>

#include "core/algorithm/rigid/asynchronous_sweeps.hpp"
#include "core/plan/body_plan.hpp"
#include "cpu_fallback/threads/threaded_team.hpp"
#include "scenes/body_scenes.hpp"
#include "scenes/box_scenes.hpp"
#include "stiction/error.hpp"
#include "stiction/residual.hpp"
#include "stiction/world.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/body_systems.hpp"

namespace stiction::test {

namespace {

using Env = BodyEnvironment<double>;

/// Threads of which one takes longer over every item that is dealt to it.
class UnevenTeam : public ThreadedTeam {
 public:
  UnevenTeam(cpu::ThreadTeam& team, Index rank, int late_us) : ThreadedTeam(team, rank), late_us_(late_us) {}

  template <class F>
  void deal(Offset count, Offset window, F&& f) {
    ThreadedTeam::deal(count, window, [&](Offset item) {
      if (rank() == 0 && late_us_ > 0) std::this_thread::sleep_for(std::chrono::microseconds(late_us_));
      f(item);
    });
  }

 private:
  int late_us_;
};

/// A wall that is hit from the side, so that no half of it is at rest.
Env wall() {
  Env env = scenes::box_bodies(scenes::box_wall(3, 5), 0.5);
  env.bodies[3].twist = {0.7, 0.3, 0, 0, 1, 0};
  return env;
}

BodySolverOptions until(double tolerance, bool momentum) {
  BodySolverOptions options;
  options.law = Law::convex;
  options.asynchronous = true;
  options.iterations = 20000;
  options.tolerance = tolerance;
  options.momentum = momentum;
  return options;
}

TimeStepping yielding() {
  TimeStepping stepping;
  stepping.cfm = 1e-3;
  return stepping;
}

BodySolution<double> room_for(const BodyBatchView<double>& view) {
  BodySolution<double> solution;
  solution.impulse.resize(static_cast<std::size_t>(3 * view.contact_count), 777);
  solution.w = solution.impulse;
  solution.twist.resize(static_cast<std::size_t>(6 * view.body_count), 777);
  solution.status.resize(1);
  return solution;
}

BodySolution<double> solve_on_threads(const Env& env, const BodySolverOptions& options, int threads, int late_us) {
  const BodyBatch<double> batch = batch_of<double>({env});
  const BodyPlanData plan = make_body_plan(batch.view(), 0);
  BodySolution<double> solution = room_for(batch.view());
  const BodyJob<double> job{batch.view(),
                            plan.view(),
                            {solution.impulse.data(), solution.twist.data(), solution.w.data(), solution.status.data()},
                            nullptr,
                            yielding(),
                            options};
  using System = BodySystem<double, Law::convex>;
  std::vector<double> memory(static_cast<std::size_t>(System::elements(plan.kept[0], batch.body_count(), true)));
  std::vector<double> exact(static_cast<std::size_t>(System::exact_elements(batch.body_count())));
  cpu::run_team(threads, [&](cpu::ThreadTeam& shared, Index rank) {
    UnevenTeam team(shared, rank, late_us);
    DealtSweeps<Law::convex, double>::solve(team, job, slice_bodies(job, 0), memory.data(), exact.data());
  });
  return solution;
}

/// The residual by a judge that shares no code with the solver: of a matrix written out from definitions.
double verified(const Env& env, const BodySolution<double>& solution) {
  ContactBatch<double> batch(Law::convex);
  batch.add(scenes::delassus_form(env, yielding()));
  return verify(batch.view(), std::span<const double>(solution.impulse)).at(0).relative;
}

double largest_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double largest = 0;
  for (std::size_t k = 0; k < a.size(); ++k) largest = std::max(largest, std::abs(a[k] - b[k]));
  return largest;
}

}  // namespace

TEST(AsynchronousSweeps, AnIndependentJudgeFindsTheirResidualWhicheverThreadIsLate) {
  for (const bool momentum : {false, true})
    for (const int late_us : {0, 50}) {
      const Env env = late_us > 0 ? wall() : scenes::make_body_pile(5, 120);
      const BodySolution<double> solution = solve_on_threads(env, until(1e-3, momentum), 3, late_us);
      const EnvStatus& status = solution.status[0];
      SCOPED_TRACE(std::string(momentum ? "si" : "pgs") + ", late by " + std::to_string(late_us) + ", sweeps " +
                   std::to_string(status.iterations));
      EXPECT_EQ(status.code, EnvCode::solved);
      EXPECT_LE(status.residual, 1e-3);
      EXPECT_NEAR(verified(env, solution), status.residual, 1e-11);
    }
}

TEST(AsynchronousSweeps, TheirTwistsAreThoseOfNewtonsMethod) {
  const Env env = wall();
  BodySolverOptions newton = newton_options(Law::convex, BodyPreconditioner::block_diagonal);
  newton.tolerance = 1e-10;
  newton.iterations = 200;
  const BodySolution<double> expected = solve_bodies(batch_of<double>({env}), yielding(), newton);
  ASSERT_EQ(expected.status[0].code, EnvCode::solved);
  const BodySolution<double> solution = solve_on_threads(env, until(1e-7, true), 3, 30);
  ASSERT_EQ(solution.status[0].code, EnvCode::solved);
  // Twists of a convex problem are unique; b is of size 1, and R bounds the error that 1e-7 of it can hide.
  EXPECT_LT(largest_difference(solution.twist, expected.twist), 1e-5);
}

/// One thread is never behind itself: up to the last chunk it takes the steps of coloured sweeps.
TEST(AsynchronousSweeps, OnOneThreadTheyAreColouredSweeps) {
  const Env env = wall();
  BodySolverOptions options = until(0, false);
  options.iterations = 80;
  const BodySolution<double> alone = solve_on_threads(env, options, 1, 0);
  options.asynchronous = false;
  const BodySolution<double> coloured = solve_bodies(batch_of<double>({env}), yielding(), options);
  EXPECT_EQ(alone.status[0].iterations, 80);
  EXPECT_LT(largest_difference(alone.twist, coloured.twist), 1e-12);
}

TEST(AsynchronousSweeps, TheyEndWhereSweepsHaveRunOutAndKeepTheBest) {
  const Env env = wall();
  for (const Index iterations : {0, 31, 32, 100}) {
    BodySolverOptions options = until(1e-12, true);
    options.iterations = iterations;
    const BodySolution<double> solution = solve_on_threads(env, options, 3, 0);
    EXPECT_EQ(solution.status[0].code, EnvCode::max_iterations);
    EXPECT_EQ(solution.status[0].iterations, iterations);
    EXPECT_NEAR(verified(env, solution), solution.status[0].residual, 1e-11);
  }
}

TEST(AsynchronousSweeps, AnItemBeginsWhenThoseAWindowBeforeHaveEnded) {
  constexpr Offset kItems = 400, kWindow = 7;
  std::vector<int> seen(kItems, 0);  // not atomic: others see an item's writes after a window
  std::atomic<int> early{0};
  cpu::run_team(4, [&](cpu::ThreadTeam& shared, Index rank) {
    ThreadedTeam team(shared, rank);
    for (int round = 1; round <= 2; ++round)
      team.deal(kItems, kWindow, [&](Offset item) {
        // Others can go on meanwhile, whichever thread has it.
        if (item % 16 == 0) std::this_thread::sleep_for(std::chrono::microseconds(300));
        if (item >= kWindow && seen[static_cast<std::size_t>(item - kWindow)] != round) ++early;
        seen[static_cast<std::size_t>(item)] = round;
      });
  });
  EXPECT_EQ(early, 0);
  for (const int round : seen) EXPECT_EQ(round, 2);
}

TEST(AsynchronousSweeps, ABatchWithALargeEnvironmentIsSolvedAndSmallOnesKeepTheirBits) {
  const Env pile = scenes::make_body_pile(2, 5000);  // above 4096 contacts a team of threads sweeps it together
  ASSERT_GE(pile.contacts.size(), 4096U);
  const Env small = wall();
  BodySolverOptions options = until(1e-3, true);
  options.threads = 2;
  const BodySolution<double> both = solve_bodies(batch_of<double>({small, pile}), yielding(), options);
  for (const EnvStatus& status : both.status) EXPECT_EQ(status.code, EnvCode::solved);
  options.asynchronous = false;
  const BodySolution<double> alone = solve_bodies(batch_of<double>({small}), yielding(), options);
  EXPECT_TRUE(same_bits(std::span(both.impulse).first(alone.impulse.size()), std::span(alone.impulse)));
}

TEST(AsynchronousSweeps, TheyAreRefusedWhereTheyWouldPromiseTooMuch) {
  const auto expect_refused = [](const char* what, auto&& change, Device device = Device::cpu()) {
    BodySolverOptions options = until(1e-3, true);
    change(options);
    try {
      const BodySolver solver(device, {}, options);
      ADD_FAILURE() << what << " was taken";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::unsupported);
      for (const char* part : {"asynchronous = true with ", what, "choose ", "asynchronous = false"})
        EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  };
  expect_refused("a GPU", [](auto&) {}, Device::emulated());
  expect_refused("law = coulomb", [](auto& options) { options.law = Law::coulomb; });
  expect_refused("box_friction = true", [](auto& options) { options.box_friction = true; });
  expect_refused("method = newton", [](auto& options) { options.method = BodyMethod::newton; });
  expect_refused("substeps = 2", [](auto& options) { options.substeps = 2; });
  WorldOptions world;
  world.solver.asynchronous = true;
  EXPECT_THROW(World<double>(Device::cpu(), WorldDescription{}, 1, world), Error);
}

}  // namespace stiction::test
