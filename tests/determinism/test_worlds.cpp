// An environment of a world has the same bits whatever is beside it and whatever computes it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <optional>

#include "tests/support/bits.hpp"
#include "tests/support/machines/scoped_isa.hpp"
#include "tests/support/systems/worlds.hpp"

namespace stiction::test {

namespace {

/// Long enough for all scenes to be in contact.
constexpr int kSteps = 90;

template <class Real>
std::uint64_t hash_after(const std::string& scene, Offset envs, int steps, int threads, Device device = Device::cpu()) {
  WorldOptions options;
  options.solver.threads = threads;
  World<Real> world = started<Real>(scene, envs, options, device);
  run(world, steps);
  return world.hash();
}

/// Everything about one environment's state.
template <class Real>
std::vector<Real> state_of(const World<Real>& world, Offset env) {
  std::vector<Real> all;
  const auto bodies = static_cast<std::size_t>(world.body_count()), e = static_cast<std::size_t>(env);
  const WorldState<Real> state = world.state();
  for (const auto& [values, width] :
       {std::pair{state.position, 3}, std::pair{state.orientation, 4}, std::pair{state.twist, 6}}) {
    const std::size_t length = static_cast<std::size_t>(width) * bodies;
    const auto own = values.subspan(e * length, length);
    all.insert(all.end(), own.begin(), own.end());
  }
  return all;
}

class Scenes : public testing::TestWithParam<const char*> {};

}  // namespace

TEST_P(Scenes, BitsDoNotDependOnThreads) {
  const std::uint64_t one = hash_after<double>(GetParam(), 18, kSteps, 1);
  for (const int threads : {2, 5}) EXPECT_EQ(hash_after<double>(GetParam(), 18, kSteps, threads), one);
  const std::uint64_t single = hash_after<float>(GetParam(), 18, kSteps, 1);
  EXPECT_EQ(hash_after<float>(GetParam(), 18, kSteps, 2), single);
}

TEST_P(Scenes, BitsDoNotDependOnNeighbours) {
  World<double> many = started<double>(GetParam(), 32);
  run(many, kSteps);
  for (const Offset env : {0, 17, 31}) {
    const scenes::WorldStart start = scenes::start_world(GetParam(), 0, static_cast<std::uint64_t>(env));
    World<double> alone = started<double>(GetParam(), 1);
    alone.reset(std::vector<std::uint8_t>{1}, {start.position, start.orientation, start.twist});
    run(alone, kSteps);
    EXPECT_EQ(state_of(alone, 0), state_of(many, env)) << "environment " << env;
  }
}

template <class Real>
void expect_the_same_of_every_instruction_set(const char* scene) {
  std::optional<std::uint64_t> expected;
  for (const char* name : usable_isas()) {
    SCOPED_TRACE(name);
    const ScopedIsa isa(name);
    const std::uint64_t hash = hash_after<Real>(scene, 5, kSteps, 1);
    EXPECT_EQ(hash, expected.value_or(hash));
    expected = hash;
  }
}

TEST_P(Scenes, BitsDoNotDependOnTheInstructionSet) {
  expect_the_same_of_every_instruction_set<double>(GetParam());
  expect_the_same_of_every_instruction_set<float>(GetParam());
}

TEST_P(Scenes, EnvironmentsDifferBySeedAndIndex) {
  World<double> world = started<double>(GetParam(), 2);
  EXPECT_NE(state_of(world, 0), state_of(world, 1));
  EXPECT_NE(state_of(world, 0), state_of(started<double>(GetParam(), 1, {}, Device::cpu(), 1), 0));
}

/// Compares two worlds' last steps, bit for bit.
template <class Real>
void expect_same(const World<Real>& one, const World<Real>& other) {
  for (Offset env = 0; env < one.env_count(); ++env)
    EXPECT_TRUE(same_bits<Real>(state_of(one, env), state_of(other, env))) << "environment " << env;
  EXPECT_TRUE(same_bits(one.status(), other.status()));
  EXPECT_TRUE(same_bits(one.contact_offsets(), other.contact_offsets()));
  EXPECT_TRUE(same_bits(one.impulses(), other.impulses()));
  const BodyBatchView<Real> a = one.contacts(), b = other.contacts();
  const auto same = [&](const auto* here, const auto* there, Offset count) {
    return same_bits(std::span(here, static_cast<std::size_t>(count)),
                     std::span(there, static_cast<std::size_t>(count)));
  };
  EXPECT_TRUE(same(a.contact_id, b.contact_id, a.contact_count));
  EXPECT_TRUE(same(a.body_a, b.body_a, a.contact_count));
  EXPECT_TRUE(same(a.arm_b, b.arm_b, 3 * a.contact_count));
  EXPECT_TRUE(same(a.normal, b.normal, 3 * a.contact_count));
  EXPECT_TRUE(same(a.depth, b.depth, a.contact_count));
  EXPECT_TRUE(same(a.inv_inertia, b.inv_inertia, 6 * a.body_count));
  const std::vector<WorldMotion> moves = one.motion(), others = other.motion();
  EXPECT_EQ(std::memcmp(moves.data(), others.data(), moves.size() * sizeof(WorldMotion)), 0);
}

template <class Real>
void expect_the_same_on_a_device(const char* scene, Offset envs, int steps) {
  World<Real> here = started<Real>(scene, envs);
  World<Real> there = started<Real>(scene, envs, {}, Device::emulated());
  run(here, steps);
  run(there, steps);
  expect_same(here, there);
}

TEST_P(Scenes, BitsDoNotDependOnTheDevice) {
  expect_the_same_on_a_device<double>(GetParam(), 5, 60);
  expect_the_same_on_a_device<float>(GetParam(), 3, 60);
  expect_the_same_on_a_device<double>(GetParam(), 1, 5);
}

INSTANTIATE_TEST_SUITE_P(Worlds, Scenes, testing::Values("pile", "walker", "stack", "bounce", "slide"),
                         [](const auto& scene) { return std::string(scene.param); });

}  // namespace stiction::test
