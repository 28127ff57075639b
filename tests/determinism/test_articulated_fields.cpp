#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <set>
#include <utility>
#include <vector>

#include "stiction/articulated.hpp"
#include "tests/support/error_message.hpp"
#include "tests/support/machines/same_on_all_kernels.hpp"
#include "tests/support/systems/rough_ground.hpp"

/// Robots on height fields: each lane's is over other cells.
namespace {

using namespace stiction;
using namespace stiction::test;

template <class Real>
std::uint64_t hash_after(int threads) {
  ArticulatedBatch<Real> robots(rough_walk(true), kEnvs, {1e-5, 100, threads});
  put_states(robots, all_envs());
  robots.step(40);
  return robots.hash();
}

TEST(ArticulatedFields, InstructionSetsAndThreadsChangeNoBit) {
  expect_same_on_all_kernels([](auto real, int threads) { return hash_after<decltype(real)>(threads); });
}

TEST(ArticulatedFields, ARobotHasTheBitsOfOneThatIsAloneAndAllKindsTouch) {
  ArticulatedBatch<double> robots(rough_walk(false), 9, {1e-5, 100, 1}), alone(rough_walk(false), 1, {1e-5, 100, 1});
  put_states(robots, {0, 1, 2, 3, 4, 5, 6, 7, 8});
  put_states(alone, {5});
  const auto nq = static_cast<std::size_t>(robots.q_count());
  const ArticulatedDescription model = rough_walk(false);
  std::set<GeomKind> touched;
  for (int round = 0; round < 6; ++round) {
    robots.step(25);
    alone.step(25);
    for (std::size_t k = 0; k < nq; ++k) ASSERT_EQ(robots.qpos()[5 * nq + k], alone.qpos()[k]) << k;
    const ArticulatedProbe probe = robots.probe();
    for (std::size_t env = 0; env < 9; ++env)
      for (Index k = 0; k < probe.contacts[env]; ++k) {
        const auto at = env * static_cast<std::size_t>(probe.most_contacts) + static_cast<std::size_t>(k);
        const ArticulatedPair& pair = model.pairs[static_cast<std::size_t>(probe.pair[at])];
        if (pair.geom_a == 0) touched.insert(model.geoms[static_cast<std::size_t>(pair.geom_b)].kind);
      }
  }
  EXPECT_EQ(touched, (std::set<GeomKind>{GeomKind::sphere, GeomKind::capsule, GeomKind::box}));
}

/// A field and a free shape over it, without gravity.
ArticulatedDescription shape_over(const ArticulatedHeightField& field, GeomKind kind, std::array<double, 3> size,
                                  double height) {
  ArticulatedDescription model;
  model.bodies.push_back({});
  model.fields.push_back(field);
  model.geoms.push_back({0, GeomKind::height_field, {}, {}, {1, 0, 0, 0}, 0});
  add_free_body(model, kind, size, {0, 0, height});
  model.pairs[0].margin = model.pairs[0].reach = 0;
  return model;
}

TEST(ArticulatedFields, ARobotWithMorePointsThanPlacesSaysSo) {
  const ArticulatedDescription model = shape_over(rough_field(.05), GeomKind::sphere, {.5}, .47);
  ArticulatedBatch<double> robots(model, 3);
  robots.qpos()[2] = 2;  // the first one is high above
  robots.qpos()[9] = .51;
  robots.step();
  EXPECT_EQ(robots.status()[0].flags, 0U);
  EXPECT_EQ(robots.status()[1].flags, 0U) << robots.probe().contacts[1];
  EXPECT_EQ(robots.status()[2].flags, std::uint32_t{kFlagContactsDropped});
  const ArticulatedProbe probe = robots.probe();
  EXPECT_EQ(probe.contacts[0], 0);
  EXPECT_GT(probe.contacts[1], 0);
  EXPECT_EQ(probe.contacts[2], 8);
}

TEST(ArticulatedFields, BeyondTheEdgeAndBelowTheBottomNothingHolds) {
  for (const GeomKind kind : {GeomKind::sphere, GeomKind::capsule, GeomKind::box}) {
    ArticulatedBatch<double> robots(shape_over(rough_field(.05), kind, {.05, .05, .05}, .1), 3);
    robots.qpos()[0] = .75;  // past the edge
    robots.qpos()[9] = -.5;  // below
    robots.qpos()[14] = 1e30;
    robots.forward();
    const ArticulatedProbe probe = robots.probe();
    for (std::size_t env = 0; env < 3; ++env) {
      EXPECT_EQ(probe.contacts[env], 0) << env;
      EXPECT_EQ(robots.status()[env].code, EnvCode::solved) << env;
    }
  }
}

TEST(ArticulatedFields, ReasonsNameWhatIsNoField) {
  const auto says = [](const char* text, auto&& change) {
    ArticulatedDescription model = rough_walk(true);
    change(model);
    const std::string found = error_message([&] { ArticulatedBatch<double>(model, 1); });
    EXPECT_NE(found.find(text), std::string::npos) << found;
  };
  says("fields[0].heights = nan", [](auto& m) { m.fields[0].heights[7] = std::nan(""); });
  says("fields[0].heights = -0.1: must be finite and above -base", [](auto& m) { m.fields[0].heights[7] = -.1; });
  says("fields[0].heights has 62 entries, expected 63", [](auto& m) { m.fields[0].heights.pop_back(); });
  says("fields[0].rows = 1", [](auto& m) { m.fields[0].rows = 1; });
  says("fields[0].columns = -7", [](auto& m) { m.fields[0].columns = -7; });
  says("fields[0].half = 0", [](auto& m) { m.fields[0].half[1] = 0; });
  says("fields[0].base = -1", [](auto& m) { m.fields[0].base = -1; });
  says("geoms[0].field = -1", [](auto& m) { m.geoms[0].field = -1; });
  const char* const touch = "]: height fields touch spheres, capsules and boxes in lanes, and stand still";
  says(touch, [](auto& m) { m.geoms[0].body = 1; });
  says(touch, [](auto& m) { m.geoms[1].kind = GeomKind::cylinder; });
  says(touch, [](auto& m) { std::swap(m.pairs[1].geom_a, m.pairs[1].geom_b); });
  says(touch, [](auto& m) { m.geoms[1] = {0, GeomKind::plane, {}, {}, {1, 0, 0, 0}}; });
}

}  // namespace
