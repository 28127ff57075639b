#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "stiction/articulated.hpp"
#include "tests/support/error_message.hpp"
#include "tests/support/machines/same_on_all_kernels.hpp"
#include "tests/support/systems/hulls.hpp"

/// Hulls of meshes on planes: each lane's stands on other vertices.
namespace {

using namespace stiction;
using namespace stiction::test;

TEST(ArticulatedHulls, InstructionSetsAndThreadsChangeNoBit) {
  expect_same_on_all_kernels([](auto real, int threads) {
    ArticulatedBatch<decltype(real)> robots(walker_and_prism(true), kEnvs, {1e-5, 100, threads});
    put_states(robots, all_envs());
    robots.step(60);
    return robots.hash();
  });
}

TEST(ArticulatedHulls, ARobotHasTheBitsOfOneThatIsAlone) {
  ArticulatedBatch<double> robots(walker_and_prism(true), 9, {1e-5, 100, 1}),
      alone(walker_and_prism(true), 1, {1e-5, 100, 1});
  put_states(robots, {0, 1, 2, 3, 4, 5, 6, 7, 8});
  put_states(alone, {5});
  robots.step(120);
  alone.step(120);
  const auto nq = static_cast<std::size_t>(robots.q_count());
  for (std::size_t k = 0; k < nq; ++k) EXPECT_EQ(robots.qpos()[5 * nq + k], alone.qpos()[k]) << k;
  const ArticulatedProbe probe = robots.probe();
  EXPECT_GT(*std::max_element(probe.contacts.begin(), probe.contacts.end()), 3) << "prisms lie on a face";
}

/// A prism over a plane, nearly upright, without gravity.
ArticulatedProbe points_of_prism(double height, double turn, double lean, const ArticulatedHull& hull = prism()) {
  ArticulatedDescription model;
  model.gravity = {0, 0, 0};
  model.bodies.push_back({});
  model.geoms.push_back({0, GeomKind::plane, {}, {}, {1, 0, 0, 0}});
  add_free_prism(model, {0, 0, height});
  model.hulls[0] = hull;
  model.pairs[0].margin = model.pairs[0].reach = 0;
  ArticulatedBatch<double> batch(model, 1, {1e-8, 100, 1});
  const double length = std::sqrt(1 + turn * turn + lean * lean);
  const double q[] = {0, 0, height, 1 / length, lean / length, 0, turn / length};
  std::copy(std::begin(q), std::end(q), batch.qpos().begin());
  return batch.probe();
}

// The area of four corners that stand for an end of seven is most of the end's, wherever they begin.
TEST(ArticulatedHulls, FourCornersStandForAnEnd) {
  for (const double turn : {0.0, 0.5, 1.0, 2.0, -1.5}) {
    const ArticulatedProbe probe = points_of_prism(.0999, turn, 1e-5);
    ASSERT_EQ(probe.contacts[0], 4) << turn;
    double area = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const double *const a = &probe.contact[7 * k], *const b = &probe.contact[7 * ((k + 1) % 4)];
      area += (a[1] * b[2] - a[2] * b[1]) / 2;
      EXPECT_NEAR(a[0], -.0001, 1e-5);
      EXPECT_NEAR(a[3], -.00005, 1e-5) << "halfway between the surfaces";
    }
    EXPECT_GT(std::abs(area), .059) << "of .104";
  }
}

// A face's first three corners may lie on a line: its normal is that of the whole.
TEST(ArticulatedHulls, ACornerOnAnEdgeHidesNoFace) {
  ArticulatedHull hull = prism();
  hull.vertices[6] = {.125, -.15625, -.1};
  hull.vertices[5] = {-.0625, -.171875, -.1};
  hull.vertices.push_back({.03125, -.1640625, -.1});  // halfway without rounding
  hull.corners.insert(hull.corners.begin() + 1, 14);  // of the lower end
  for (std::size_t face = 1; face < hull.face_begin.size(); ++face) ++hull.face_begin[face];
  for (const double turn : {0.0, 0.5, 1.0, 2.0, -1.5})
    EXPECT_EQ(points_of_prism(.0999, turn, 1e-5, hull).contacts[0], 4) << turn;
}

// Corners above the plane are no points, though they stand for the face.
TEST(ArticulatedHulls, OnlyWhatIsWithinReachTouches) {
  EXPECT_EQ(points_of_prism(.1001, 0, 0).contacts[0], 0);
  EXPECT_EQ(points_of_prism(.0999, 0, 0.02).contacts[0], 3);
}

TEST(ArticulatedHulls, MistakesAreNamed) {
  const auto says = [](const char* text, const auto& change) {
    ArticulatedDescription model = walker_and_prism(true);
    change(model);
    const std::string found = error_message([&] { ArticulatedBatch<double>(model, 1); });
    EXPECT_NE(found.find(text), std::string::npos) << found;
  };
  says("hulls[0].vertices", [](auto& m) { m.hulls[0].vertices[3][1] = std::nan(""); });
  says("hulls[0].vertices.size() = 0", [](auto& m) { m.hulls[0].vertices.clear(); });
  says("hulls[0].corners = 14", [](auto& m) { m.hulls[0].corners[5] = 14; });
  says("hulls[0].corners has 41 entries, expected 42", [](auto& m) { m.hulls[0].corners.pop_back(); });
  says("hulls[0].face_begin = 8", [](auto& m) { m.hulls[0].face_begin[2] = 8; });
  says("hulls[0].face_begin", [](auto& m) { m.hulls[0].face_begin.clear(); });
  says("hulls[0].face_begin = 14: must be the first corner of a face with an area", [](auto& m) {
    for (const std::size_t k : {15U, 16U, 17U}) m.hulls[0].corners[k] = m.hulls[0].corners[14];
  });
  says("hull = 1", [](auto& m) { m.geoms.back().hull = 1; });
}

}  // namespace
