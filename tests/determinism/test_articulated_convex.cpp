#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <string>

#include "stiction/articulated.hpp"
#include "tests/support/error_message.hpp"
#include "tests/support/machines/same_on_all_kernels.hpp"
#include "tests/support/systems/heap.hpp"
#include "tests/support/systems/hulls.hpp"
#include "tests/support/systems/walker_states.hpp"

/// Hulls and cylinders on each other and on boxes, capsules and spheres: points that their support finds, lane by lane.
namespace {

using namespace stiction;
using namespace stiction::test;

ArticulatedDescription general_heap() {
  ArticulatedHull small = prism();
  for (auto& vertex : small.vertices)
    for (double& x : vertex) x *= .5;
  return heap_of({GeomKind::mesh, GeomKind::capsule, GeomKind::cylinder, GeomKind::sphere, GeomKind::mesh,
                  GeomKind::cylinder, GeomKind::box},
                 {small});
}

template <class Real>
ArticulatedBatch<Real> thrown(Offset envs, int threads) {
  ArticulatedBatch<Real> robots(general_heap(), envs, {1e-5, 100, threads});
  for (std::size_t k = 0; k < robots.qvel().size(); ++k) robots.qvel()[k] = static_cast<Real>(number(k));
  return robots;
}

TEST(ArticulatedConvex, InstructionSetsAndThreadsChangeNoBit) {
  expect_same_on_all_kernels([](auto real, int threads) {
    auto robots = thrown<decltype(real)>(kEnvs, threads);
    robots.step(40);
    return robots.hash();
  });
}

TEST(ArticulatedConvex, EveryPairTouchesSomewhere) {
  auto robots = thrown<double>(kEnvs, 1);
  auto touched = touching_kinds(robots, general_heap());
  const auto is_one = [](GeomKind kind) { return kind == GeomKind::cylinder || kind == GeomKind::mesh; };
  std::erase_if(touched, [&](const auto& pair) { return !is_one(pair.first) && !is_one(pair.second); });
  EXPECT_EQ(touched.size(), 9U);
}

TEST(ArticulatedConvex, ARobotHasTheBitsOfOneThatIsAlone) {
  auto robots = thrown<double>(9, 1);
  ArticulatedBatch<double> alone(general_heap(), 1, {1e-5, 100, 1});
  const auto nv = static_cast<std::size_t>(robots.dof_count()), nq = static_cast<std::size_t>(robots.q_count());
  for (std::size_t k = 0; k < nv; ++k) alone.qvel()[k] = number(5 * nv + k);
  robots.qpos()[2 * nq + 9] = __builtin_nan("");
  robots.step(60);
  alone.step(60);
  EXPECT_EQ(robots.status()[2].code, EnvCode::invalid_input);
  for (std::size_t k = 0; k < nq; ++k) EXPECT_EQ(robots.qpos()[5 * nq + k], alone.qpos()[k]) << k;
}

// Corners of a face may turn either way in a description.
TEST(ArticulatedConvex, TheTurnOfAFaceChangesNoPoint) {
  ArticulatedDescription turned = general_heap();
  ArticulatedHull& hull = turned.hulls[0];
  for (std::size_t face = 0; face < 2; ++face)
    std::reverse(hull.corners.begin() + hull.face_begin[face], hull.corners.begin() + hull.face_begin[face + 1]);
  auto robots = thrown<double>(kEnvs, 1);
  ArticulatedBatch<double> other(turned, kEnvs, {1e-5, 100, 1});
  for (std::size_t k = 0; k < other.qvel().size(); ++k) other.qvel()[k] = number(k);
  robots.step(40);
  other.step(40);
  EXPECT_EQ(robots.hash(), other.hash());
}

TEST(ArticulatedConvex, HullsThatTouchPlanesAloneAreNamed) {
  const auto says = [](const char* text, const auto& change) {
    ArticulatedDescription model = general_heap();
    change(model.hulls[0]);
    const std::string found = error_message([&] { ArticulatedBatch<double>(model, 1); });
    EXPECT_NE(found.find(text), std::string::npos) << found;
  };
  says("a face of hulls[0] has 34 corners: up to 32", [](ArticulatedHull& hull) {
    hull.corners.insert(hull.corners.begin(), 27, hull.corners[0]);
    for (std::size_t face = 1; face < hull.face_begin.size(); ++face) hull.face_begin[face] += 27;
  });
  says("hulls[0] has a vertex that is no face's corner", [](ArticulatedHull& hull) { hull.vertices.push_back({}); });
}

}  // namespace
