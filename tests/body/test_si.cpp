#include <gtest/gtest.h>

#include <limits>

#include "bench/scenes/body_scenes.hpp"
#include "core/body/bodies/si_body.hpp"
#include "core/schedule/body_plan.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/body_systems.hpp"
#include "tests/support/jitter_block.hpp"
#include "tests/support/torture_block.hpp"

/// One body environment on blocks of every width, by threads that race unless the body syncs: each must give the bits
/// of the public solver.
namespace stiction::test {

namespace {

using Env = BodyEnvironment<double>;

template <class Real>
BodyEnvironment<Real> as(const Env& env) {
  if constexpr (std::is_same_v<Real, float>) {
    return scenes::rounded(env);
  } else {
    return env;
  }
}

template <Law kLaw, class Real>
class SiCase {
 public:
  SiCase(const Env& env, Index substeps, bool momentum, bool warm) {
    batch_.add(as<Real>(env));
    options_.law = kLaw;
    options_.iterations = 19;  // a chunk and a part of one
    options_.substeps = substeps;
    options_.momentum = momentum;
    options_.threads = 1;
    options_.invalid = InvalidPolicy::isolate;
    plan_ = make_body_plan(batch_.view(), 0);
    if (warm)
      for (std::size_t i = 0; i < contacts() * 3; ++i) warm_.push_back(static_cast<Real>(i % 5) * Real(0.125));
    expected_ = solve_bodies(batch_, {}, options_, Device::cpu(), std::span<const Real>(warm_));
  }

  [[nodiscard]] const BodySolution<Real>& expected() const { return expected_; }

  template <class Make>
  void expect_same(Index width, const Make& make) const {
    const Index bodies = static_cast<Index>(batch_.body_count());
    using System = BodySystem<Real, kLaw>;
    // What a body reads before it writes would show: no memory of a GPU is zero by itself.
    const Real nan = std::numeric_limits<Real>::quiet_NaN();
    std::vector<Real> memory(
        static_cast<std::size_t>(System::elements(static_cast<Offset>(contacts()), bodies, options_.momentum)), nan);
    std::vector<double> exact(static_cast<std::size_t>(System::exact_elements(bodies)),
                              std::numeric_limits<double>::quiet_NaN());
    BodySolution<Real> solution{std::vector<Real>(3 * contacts(), nan), std::vector<Real>(expected_.twist.size(), nan),
                                std::vector<Real>(3 * contacts(), nan), std::vector<EnvStatus>(1)};
    const BodyJob<Real> job{batch_.view(),
                            plan_.view(),
                            {solution.impulse.data(), solution.twist.data(), solution.w.data(), solution.status.data()},
                            warm_.empty() ? nullptr : warm_.data(),
                            TimeStepping{},
                            options_};
    const BodyEnv<Real> env = slice_bodies(job, 0);
    run_block(width, make, [&](auto& block) {
      System system(env.kept, env.bodies, options_.momentum, memory.data(), exact.data());
      solve_bodies(block, env, system, si_params(job.stepping, job.options));
    });
    const auto same = [](const std::vector<Real>& a, const std::vector<Real>& b) {
      return same_bits(std::span<const Real>(a), std::span<const Real>(b));
    };
    EXPECT_TRUE(same(expected_.impulse, solution.impulse)) << "width " << width;
    EXPECT_TRUE(same(expected_.twist, solution.twist)) << "width " << width;
    EXPECT_TRUE(same(expected_.w, solution.w)) << "width " << width;
    EXPECT_TRUE(same_bits(std::span<const EnvStatus>(expected_.status), std::span<const EnvStatus>(solution.status)))
        << "width " << width;
  }

  void expect_same_on_all_blocks() const {
    for (const Index width : {1, 2, 3, 8, 33})
      expect_same(width, [](TortureTeam& team, Index rank) { return TortureBlock<1>(team, rank); });
    for (const Index width : {2, 5})
      expect_same(width, [](TortureTeam& team, Index rank) {
        return JitterBlock<TortureBlock<4>>(TortureBlock<4>(team, rank), 7);
      });
  }

 private:
  [[nodiscard]] std::size_t contacts() const { return static_cast<std::size_t>(batch_.contact_count()); }

  BodyBatch<Real> batch_;
  BodySolverOptions options_;
  BodyPlanData plan_;
  std::vector<Real> warm_;
  BodySolution<Real> expected_;
};

}  // namespace

TEST(si, blocks_of_every_width_give_the_same_bits_for_a_random_cloud) {
  const Env cloud = random_bodies(5, 12, 45);
  SiCase<Law::coulomb, float>(cloud, 1, true, true).expect_same_on_all_blocks();
  SiCase<Law::convex, float>(cloud, 1, false, false).expect_same_on_all_blocks();
}

TEST(si, blocks_of_every_width_give_the_same_bits_in_sub_steps) {
  const Env pile = scenes::make_body_pile(9, 70);
  SiCase<Law::coulomb, double>(pile, 3, true, true).expect_same_on_all_blocks();
  SiCase<Law::convex, double>(pile, 2, false, true).expect_same_on_all_blocks();
}

TEST(si, a_poisoned_environment_is_refused_alike_and_safely) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto poison = [](auto&& change, std::uint32_t flag) {
    Env env = random_bodies(6, 8, 20);
    change(env);
    const SiCase<Law::coulomb, double> one(env, 1, true, false);
    EXPECT_EQ(one.expected().status[0].code, EnvCode::invalid_input);
    EXPECT_EQ(one.expected().status[0].flags, flag);
    for (const double v : one.expected().impulse) EXPECT_EQ(v, 0);
    for (const double v : one.expected().twist) EXPECT_EQ(v, 0);
    for (const double v : one.expected().w) EXPECT_EQ(v, 0);
    one.expect_same_on_all_blocks();
  };
  poison([&](Env& env) { env.contacts[3].arm_b[1] = nan; }, kFlagNonFiniteInput);
  poison([&](Env& env) { env.bodies[2].twist[4] = nan; }, kFlagNonFiniteInput);
  poison([&](Env& env) { env.contacts[5].mu = -1; }, kFlagNegativeFriction);
  poison([&](Env& env) { env.bodies[0].inv_mass = -1; }, kFlagBadMass);
  poison(
      [&](Env& env) {
        for (auto& body : env.bodies) body.inv_mass = 0, body.inv_inertia = {};
      },
      kFlagBadDiagonal);
}

TEST(si, an_iteration_that_overflows_is_answered_alike) {
  Env env = ball_on_floor(0.1, 2.0, 0.5);
  env.bodies[0].inv_mass = 3e38;
  env.contacts[0].arm_b = {1e19, 1e19, -1e19};
  env.bodies[0].twist[2] = -1;
  const SiCase<Law::coulomb, float> one(env, 2, true, false);
  EXPECT_EQ(one.expected().status[0].code, EnvCode::numerical);
  one.expect_same_on_all_blocks();
}

}  // namespace stiction::test
