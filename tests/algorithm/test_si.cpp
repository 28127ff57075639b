#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "core/algorithm/rigid/sequential_impulses.hpp"
#include "core/plan/body_plan.hpp"
#include "scenes/body_scenes.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/machines/stress_team.hpp"
#include "tests/support/systems/body_systems.hpp"

/// One body environment on teams of every width, by threads that race unless the body syncs: each must give the bits
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
  SiCase(const Env& env, Index substeps, bool momentum, bool warm, BlockMode blocks = BlockMode::cones) {
    batch_.add(as<Real>(env));
    options_.box_friction = kLaw == kBoxFriction;
    if (kLaw != kBoxFriction) options_.law = kLaw;
    options_.iterations = 19;  // a chunk and a part of one
    options_.substeps = substeps;
    options_.momentum = momentum;
    options_.blocks = blocks;
    options_.threads = 1;
    options_.invalid = InvalidPolicy::isolate;
    plan_ = make_body_plan(batch_.view(), 0);
    if (warm)
      for (std::size_t i = 0; i < contacts() * 3; ++i) warm_.push_back(static_cast<Real>(i % 5) * Real(0.125));
    expected_ = solve_bodies(batch_, {}, options_, Device::cpu(), std::span<const Real>(warm_));
  }

  [[nodiscard]] const BodySolution<Real>& expected() const { return expected_; }

  /// With a seed the lanes disagree about speed. Each takes a row at once, as a GPU's; the emulated device's take four.
  void expect_same(Index width, std::uint64_t seed = 0) const {
    using System = BodySystem<Real, kLaw>;
    std::vector<Real> memory = unwritten<Real>(System::elements(kept(), bodies(), options_.momentum));
    std::vector<double> exact = unwritten<double>(System::exact_elements(bodies()));
    Answer answer(*this);
    const auto solve_on = [&](auto& team) {
      const System system(answer.env.kept, answer.env.bodies, answer.params, memory.data(), exact.data());
      solve_bodies(team, answer.env, system, answer.params);
    };
    run_stressed<1>(width, solve_on, seed);
    answer.expect_same("width " + std::to_string(width));
  }

  /// As the middle one of three systems that interleave their numbers, on one lane: the others' stay as they were.
  void expect_same_with_a_stride() const {
    constexpr int kStride = 3;
    using System = BodySystem<Real, kLaw, kStride>;
    std::vector<Real> memory = unwritten<Real>(kStride * System::elements(kept(), bodies(), options_.momentum));
    std::vector<double> exact = unwritten<double>(kStride * System::exact_elements(bodies()));
    Answer answer(*this);
    SerialTeam team;
    const System system(answer.env.kept, answer.env.bodies, answer.params, memory.data() + 1, exact.data() + 1);
    solve_bodies(team, answer.env, system, answer.params);
    answer.expect_same("stride 3");
    EXPECT_TRUE(others_are_unwritten(memory, kStride, 1) && others_are_unwritten(exact, kStride, 1));
  }

  void expect_same_on_all_blocks() const {
    for (const Index width : {1, 2, 3, 8, 33}) expect_same(width);
    for (const Index width : {2, 5}) expect_same(width, 7);
    // A stride is a matter of where numbers lie, whatever their precision.
    if constexpr (std::is_same_v<Real, float>) expect_same_with_a_stride();
  }

 private:
  /// Memory of which nothing may be read before it is written: it would show, as no memory of a GPU is zero without
  /// being written.
  template <class T>
  static std::vector<T> unwritten(Offset count) {
    return std::vector<T>(static_cast<std::size_t>(count), std::numeric_limits<T>::quiet_NaN());
  }

  template <class T>
  static bool others_are_unwritten(const std::vector<T>& memory, int stride, int own) {
    for (std::size_t i = 0; i < memory.size(); ++i)
      if (static_cast<int>(i) % stride != own && !std::isnan(memory[i])) return false;
    return true;
  }

  /// Outputs of one solve, and its inputs.
  struct Answer {
    explicit Answer(const SiCase& owner)
        : expected(owner.expected_),
          impulse(unwritten<Real>(3 * owner.batch_.contact_count())),
          twist(unwritten<Real>(6 * owner.batch_.body_count())),
          w(unwritten<Real>(3 * owner.batch_.contact_count())),
          job{owner.batch_.view(),
              owner.plan_.view(),
              {impulse.data(), twist.data(), w.data(), &status},
              owner.warm_.empty() ? nullptr : owner.warm_.data(),
              TimeStepping{},
              owner.options_},
          env(slice_bodies(job, 0)),
          params(si_params(job.stepping, job.options)) {}

    void expect_same(const std::string& where) const {
      const auto same = [](const std::vector<Real>& a, const std::vector<Real>& b) {
        return same_bits(std::span<const Real>(a), std::span<const Real>(b));
      };
      EXPECT_TRUE(same(expected.impulse, impulse)) << where;
      EXPECT_TRUE(same(expected.twist, twist)) << where;
      EXPECT_TRUE(same(expected.w, w)) << where;
      EXPECT_TRUE(same_bits(std::span<const EnvStatus>(expected.status), std::span<const EnvStatus>(&status, 1)))
          << where;
    }

    const BodySolution<Real>& expected;
    std::vector<Real> impulse, twist, w;
    EnvStatus status;
    BodyJob<Real> job;
    BodyEnv<Real> env;
    SiParams params;
  };

  [[nodiscard]] std::size_t contacts() const { return static_cast<std::size_t>(batch_.contact_count()); }
  [[nodiscard]] Offset kept() const { return plan_.kept[0]; }
  [[nodiscard]] Offset bodies() const { return batch_.body_count(); }

  BodyBatch<Real> batch_;
  BodySolverOptions options_;
  BodyPlanData plan_;
  std::vector<Real> warm_;
  BodySolution<Real> expected_;
};

}  // namespace

TEST(SequentialImpulses, BlocksOfEveryWidthGiveTheSameBitsForARandomCloud) {
  const Env cloud = random_bodies(5, 12, 45);
  SiCase<Law::coulomb, float>(cloud, 1, true, true).expect_same_on_all_blocks();
  SiCase<Law::convex, float>(cloud, 1, false, false).expect_same_on_all_blocks();
}

TEST(SequentialImpulses, BlocksOfEveryWidthGiveTheSameBitsInSubSteps) {
  const Env pile = scenes::make_body_pile(9, 70);
  SiCase<Law::coulomb, double>(pile, 3, true, true).expect_same_on_all_blocks();
  SiCase<Law::convex, double>(pile, 2, false, true).expect_same_on_all_blocks();
}

TEST(SequentialImpulses, BlocksOfEveryWidthGiveTheSameBitsUnderBoxedFriction) {
  SiCase<kBoxFriction, float>(random_bodies(5, 8, 20), 2, true, true).expect_same_on_all_blocks();
}

TEST(SequentialImpulses, BlocksOfEveryWidthGiveTheSameBitsForContactsInPairs) {
  const Env cloud = random_bodies(5, 12, 45);
  SiCase<Law::coulomb, float>(cloud, 1, true, true, BlockMode::pairs).expect_same_on_all_blocks();
  SiCase<Law::convex, float>(cloud, 2, false, false, BlockMode::pairs).expect_same_on_all_blocks();
  SiCase<kBoxFriction, float>(cloud, 1, true, false, BlockMode::pairs).expect_same_on_all_blocks();
}

TEST(SequentialImpulses, APoisonedEnvironmentIsRefusedAlikeAndSafely) {
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
}

TEST(SequentialImpulses, ContactsBetweenBodiesThatStandCarryNothing) {
  Env env = random_bodies(6, 8, 20);
  for (auto& body : env.bodies) body.inv_mass = 0, body.inv_inertia = {};
  const SiCase<Law::coulomb, double> one(env, 1, true, false);
  EXPECT_EQ(one.expected().status[0].code, EnvCode::infeasible);
  EXPECT_EQ(one.expected().status[0].flags, static_cast<std::uint32_t>(kFlagImmovable));
  EXPECT_GT(one.expected().status[0].residual, 1e-3);
  for (const double v : one.expected().impulse) EXPECT_EQ(v, 0);
  one.expect_same_on_all_blocks();
}

TEST(SequentialImpulses, AnIterationThatOverflowsIsAnsweredAlike) {
  Env env = ball_on_floor(0.1, 2.0, 0.5);
  env.bodies[0].inv_mass = 3e38;
  env.contacts[0].arm_b = {1e19, 1e19, -1e19};
  env.bodies[0].twist[2] = -1;
  const SiCase<Law::coulomb, float> one(env, 2, true, false);
  EXPECT_EQ(one.expected().status[0].code, EnvCode::numerical);
  one.expect_same_on_all_blocks();
}

}  // namespace stiction::test
