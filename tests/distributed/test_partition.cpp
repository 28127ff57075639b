#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "distributed/solve/partition.hpp"
#include "scenes/box_scenes.hpp"
#include "stiction/error.hpp"

namespace stiction::distributed {
namespace {

using ::testing::ElementsAre;

TEST(Partition, HalvesAcrossTheLongestExtent) {
  const std::vector<Point> points{{0, 0, 0}, {3, 0, 0}, {1, 1, 0}, {2, 1, 0}};
  EXPECT_THAT(bisect(points, 2), ElementsAre(0, 1, 0, 1));
  const std::vector<Point> tall{{0, 0, 0}, {1, 0, 3}, {1, 0, 1}, {0, 0, 2}};
  EXPECT_THAT(bisect(tall, 2), ElementsAre(0, 1, 0, 1));
  EXPECT_THAT(bisect(tall, 4), ElementsAre(0, 3, 1, 2));
  EXPECT_THAT(bisect(tall, 1), ElementsAre(0, 0, 0, 0));
}

TEST(Partition, EqualCoordinatesGoByNumber) {
  EXPECT_THAT(bisect(std::vector<Point>(5, Point{1, 1, 1}), 2), ElementsAre(0, 0, 1, 1, 1));
}

TEST(Partition, PartsAreEven) {
  std::vector<Point> points;
  for (int i = 0; i < 100; ++i)
    points.push_back({static_cast<double>(i * 37 % 100), static_cast<double>(i * 53 % 100), 0});
  for (int ranks = 1; ranks <= 9; ++ranks) {
    const std::vector<int> owner = bisect(points, ranks);
    for (int rank = 0; rank < ranks; ++rank)
      EXPECT_NEAR(static_cast<double>(std::count(owner.begin(), owner.end(), rank)), 100.0 / ranks, 4) << ranks;
  }
}

TEST(Partition, MoreRanksThanPointsAndNone) {
  const std::vector<int> owner = bisect(std::vector<Point>{{0, 0, 0}, {1, 0, 0}}, 5);
  EXPECT_NE(owner[0], owner[1]);
  EXPECT_TRUE(bisect({}, 3).empty());
  EXPECT_THROW(bisect({}, 0), Error);
  EXPECT_THROW(random_owners(3, 0, 1), Error);
}

TEST(Partition, ArmsSayWhereBodiesAre) {
  const scenes::BoxScene scene = scenes::box_wall(5, 4);
  BodyBatch<double> batch;
  batch.add(scenes::box_bodies(scene, 0.5));
  const std::vector<Point> found = centres_by_arms(batch.view());
  // The lowest course stands on the world alone, and contacts with the courses above join it to them.
  for (std::size_t body = 1; body < found.size(); ++body)
    for (std::size_t axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(found[body][axis] - found[0][axis], scene.centres[body][axis] - scene.centres[0][axis], 1e-12)
          << body;
}

TEST(Partition, GroupsAreSetSideBySide) {
  BodyBatch<double> batch;
  BodyEnvironment<double> two = scenes::box_bodies(scenes::box_tower(3), 0.5);
  const BodyEnvironment<double> other = two;
  for (const auto& body : other.bodies) two.bodies.push_back(body);
  for (auto contact : other.contacts) {
    if (contact.body_a >= 0) contact.body_a += 3;
    contact.body_b += 3;
    two.contacts.push_back(contact);
  }
  batch.add(two);
  batch.add(scenes::box_bodies(scenes::box_tower(2), 0.5));
  const std::vector<Point> points = centres_by_arms(batch.view());
  ASSERT_EQ(points.size(), 8U);
  EXPECT_EQ(points[0][0], points[2][0]);
  EXPECT_LT(points[2][0], points[3][0]);
  EXPECT_LT(points[5][0], points[6][0]);
}

TEST(Partition, BodiesThatTouchNoOtherDoNotTurnTheCut) {
  BodyEnvironment<double> tower = scenes::box_bodies(scenes::box_wall(30, 4), 0.5);
  const std::size_t boxes = tower.bodies.size();
  for (int lone = 0; lone < 60; ++lone) tower.bodies.push_back(tower.bodies.front());
  BodyBatch<double> batch;
  batch.add(tower);
  const std::vector<int> owner = bisect(centres_by_arms(batch.view()), 2);
  EXPECT_EQ(std::count(owner.begin(), owner.end(), 0), static_cast<std::ptrdiff_t>(owner.size() / 2));
  // The lower courses are one rank's, and the upper ones another's, with the lone ones at either end.
  const auto last = owner.begin() + static_cast<std::ptrdiff_t>(boxes);
  EXPECT_TRUE(std::is_sorted(owner.begin(), last) || std::is_sorted(owner.begin(), last, std::greater<>()));
  EXPECT_NE(owner[0], owner[boxes - 1]);
}

TEST(Partition, RandomOwnersAreTheSameEverywhere) {
  EXPECT_THAT(random_owners(8, 3, 42), ElementsAre(1, 1, 0, 0, 1, 0, 1, 2));
}

}  // namespace
}  // namespace stiction::distributed
