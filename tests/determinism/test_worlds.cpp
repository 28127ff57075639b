// An environment of a world has the same bits whoever is beside it, whatever computes it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "tests/support/worlds.hpp"

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

TEST_P(Scenes, bits_do_not_depend_on_threads) {
  const std::uint64_t one = hash_after<double>(GetParam(), 18, kSteps, 1);
  for (const int threads : {2, 5}) EXPECT_EQ(hash_after<double>(GetParam(), 18, kSteps, threads), one);
  const std::uint64_t single = hash_after<float>(GetParam(), 18, kSteps, 1);
  EXPECT_EQ(hash_after<float>(GetParam(), 18, kSteps, 2), single);
}

TEST_P(Scenes, bits_do_not_depend_on_neighbours) {
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

TEST_P(Scenes, bits_do_not_depend_on_the_instruction_set) {
  const std::uint64_t wide = hash_after<double>(GetParam(), 5, kSteps, 1);
  ASSERT_EQ(setenv("STICTION_ISA", "baseline", 1), 0);
  const std::uint64_t narrow = hash_after<double>(GetParam(), 5, kSteps, 1);
  unsetenv("STICTION_ISA");
  EXPECT_EQ(narrow, wide);
}

TEST_P(Scenes, environments_differ_by_seed_and_index) {
  World<double> world = started<double>(GetParam(), 2);
  EXPECT_NE(state_of(world, 0), state_of(world, 1));
  EXPECT_NE(state_of(world, 0), state_of(started<double>(GetParam(), 1, {}, Device::cpu(), 1), 0));
}

INSTANTIATE_TEST_SUITE_P(worlds, Scenes, testing::Values("pile", "walker", "stack", "bounce", "slide"),
                         [](const auto& scene) { return std::string(scene.param); });

TEST(worlds, the_emulated_device_has_the_cpus_bits) {
  for (const char* scene : {"pile", "walker"}) {
    EXPECT_EQ(hash_after<double>(scene, 6, 60, 1, Device::emulated()), hash_after<double>(scene, 6, 60, 1)) << scene;
    EXPECT_EQ(hash_after<float>(scene, 6, 60, 1, Device::emulated()), hash_after<float>(scene, 6, 60, 1)) << scene;
  }
}

}  // namespace stiction::test
