#include <gtest/gtest.h>

#include <cstdint>
#include <utility>

#include "stiction/articulated.hpp"
#include "tests/support/error_message.hpp"
#include "tests/support/machines/same_on_all_kernels.hpp"
#include "tests/support/systems/heap.hpp"
#include "tests/support/systems/walker_states.hpp"

/// Boxes, capsules and spheres on each other: points that are found lane by lane.
namespace {

using namespace stiction;
using namespace stiction::test;

template <class Real>
std::uint64_t hash_after(int threads) {
  ArticulatedBatch<Real> robots(heap(), kEnvs, {1e-5, 100, threads});
  for (std::size_t k = 0; k < robots.qvel().size(); ++k) robots.qvel()[k] = static_cast<Real>(number(k));
  robots.step(60);
  return robots.hash();
}

TEST(ArticulatedBoxes, InstructionSetsAndThreadsChangeNoBit) {
  expect_same_on_all_kernels([](auto real, int threads) { return hash_after<decltype(real)>(threads); });
}

TEST(ArticulatedBoxes, EveryPairTouchesSomewhere) {
  ArticulatedBatch<double> robots(heap(), kEnvs, {1e-5, 100, 1});
  for (std::size_t k = 0; k < robots.qvel().size(); ++k) robots.qvel()[k] = number(k);
  EXPECT_EQ(touching_kinds(robots, heap()).size(), 5U);  // one sphere, two of the others
}

TEST(ArticulatedBoxes, ARobotThatIsNotFiniteStaysAlone) {
  ArticulatedBatch<double> robots(heap(), 5, {1e-5, 100, 1}), alone(heap(), 1, {1e-5, 100, 1});
  const auto nv = static_cast<std::size_t>(robots.dof_count()), nq = static_cast<std::size_t>(robots.q_count());
  for (std::size_t k = 0; k < 5 * nv; ++k) robots.qvel()[k] = number(k);
  for (std::size_t k = 0; k < nv; ++k) alone.qvel()[k] = number(3 * nv + k);
  robots.qpos()[2 * nq + 9] = __builtin_nan("");
  robots.step(40);
  alone.step(40);
  EXPECT_EQ(robots.status()[2].code, EnvCode::invalid_input);
  for (std::size_t k = 0; k < nq; ++k) EXPECT_EQ(robots.qpos()[3 * nq + k], alone.qpos()[k]) << k;
}

TEST(ArticulatedBoxes, KindsOfAPairAscend) {
  ArticulatedDescription model = heap();
  std::swap(model.pairs[1].geom_a, model.pairs[1].geom_b);
  EXPECT_NE(error_message([&] { ArticulatedBatch<double>(model, 1); }).find("swap geom_a and geom_b"),
            std::string::npos);
}

}  // namespace
