#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "core/algorithm/rigid/newton/newton_bodies.hpp"
#include "core/plan/newton_plan.hpp"
#include "scenes/body_scenes.hpp"
#include "scenes/box_scenes.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/machines/stress_team.hpp"
#include "tests/support/systems/body_systems.hpp"

/// Newton's method in body space on teams of every width, by threads that race unless the algorithm syncs. Their
/// memory may not be read before it is written.
namespace stiction::test {

namespace {

using scenes::box_bodies;
using scenes::box_tower;

template <Law kLaw>
class NewtonCase {
 public:
  NewtonCase(const BodyEnvironment<double>& env, BodyPreconditioner preconditioner, Index substeps)
      : options_(newton_options(kLaw, preconditioner)) {
    batch_.add(env);
    options_.iterations = 3;
    options_.substeps = substeps;
    plan_ = make_body_plan(batch_.view(), 0);
    add_newton_plan(plan_, options_.space);
    expected_ = solve_bodies(batch_, {}, options_);
  }

  /// With a seed the lanes disagree about speed. Each takes a row at once, as a GPU's; the emulated device's take four.
  void expect_same(Index width, std::uint64_t seed = 0) const {
    using System = BodySystem<double, kLaw>;
    std::vector<double> impulse = unwritten(3 * batch_.contact_count());
    std::vector<double> twist = unwritten(6 * batch_.body_count());
    std::vector<double> w = unwritten(3 * batch_.contact_count());
    EnvStatus status{};
    const BodyJob<double> job{batch_.view(), plan_.view(), {impulse.data(), twist.data(), w.data(), &status},
                              nullptr,       {},           options_};
    const BodyEnv<double> env = slice_bodies(job, 0);
    const SiParams params = si_params(job.stepping, job.options);
    std::vector<double> memory = unwritten(System::elements(env.kept, env.bodies, true));
    std::vector<double> exact = unwritten(System::exact_elements(env.bodies));
    std::vector<double> space = unwritten(newton_doubles(env.kept, env.newton_stream, options_.space));
    const auto solve_on = [&](auto& team) {
      const System system(env.kept, env.bodies, params, memory.data(), exact.data());
      const SpaceWorkspace workspace(kLaw, env.kept, env.bodies, env.newton_stream, space.data());
      solve_bodies_newton(team, env, system, params, options_.space, workspace);
    };
    run_stressed<1>(width, solve_on, seed);
    const auto same = [](const std::vector<double>& a, const std::vector<double>& b) {
      return same_bits(std::span<const double>(a), std::span<const double>(b));
    };
    const std::string where =
        std::string(to_string(options_.space.preconditioner)) + ", width " + std::to_string(width);
    EXPECT_TRUE(same(expected_.impulse, impulse)) << where;
    EXPECT_TRUE(same(expected_.twist, twist)) << where;
    EXPECT_TRUE(same(expected_.w, w)) << where;
    EXPECT_TRUE(same_bits(std::span<const EnvStatus>(expected_.status), std::span<const EnvStatus>(&status, 1)))
        << where;
  }

  void expect_same_on_all_blocks() const {
    for (const Index width : {1, 3, 33}) expect_same(width);
    expect_same(5, 7);
  }

 private:
  static std::vector<double> unwritten(Offset count) {
    return std::vector<double>(static_cast<std::size_t>(count), std::numeric_limits<double>::quiet_NaN());
  }

  BodyBatch<double> batch_;
  BodySolverOptions options_;
  BodyPlanData plan_;
  BodySolution<double> expected_;
};

}  // namespace

TEST(TortureBodyNewton, BlocksOfEveryWidthGiveTheSameBitsWithEveryPreconditioner) {
  const BodyEnvironment<double> cloud = random_bodies(5, 8, 25);
  for (int kind = 0; kind < kBodyPreconditionerCount; ++kind)
    NewtonCase<Law::coulomb>(cloud, static_cast<BodyPreconditioner>(kind), 1).expect_same_on_all_blocks();
}

TEST(TortureBodyNewton, BlocksOfEveryWidthGiveTheSameBitsInSubSteps) {
  const BodyEnvironment<double> stack = scenes::make_body_stack(9, 5);
  NewtonCase<Law::convex>(stack, BodyPreconditioner::block_diagonal, 2).expect_same_on_all_blocks();
  NewtonCase<Law::coulomb>(stack, BodyPreconditioner::factor, 2).expect_same_on_all_blocks();
}

TEST(TortureBodyNewton, AHierarchyOfTwoLevelsGivesTheSameBits) {
  const BodyEnvironment<double> tower = box_bodies(box_tower(70), 0.5);
  NewtonCase<Law::convex>(tower, BodyPreconditioner::multigrid, 1).expect_same(3);
}

}  // namespace stiction::test
