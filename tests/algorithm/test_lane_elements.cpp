// Elements of a warp's lanes in one memory, and of a pack: where each number lies.
#include "core/algorithm/articulated/lane_elements.hpp"

#include <gtest/gtest.h>

#include <numeric>
#include <vector>

#include "core/algorithm/rigid/vector3.hpp"

namespace stiction::test {

namespace {

constexpr Index kLanes = 32, kElements = 5;

/// Number n of element i of a lane.
double number(Index i, Index n, Index lane) {
  return 1000 * lane + 3 * i + n;
}

TEST(LaneElements, NumbersOfAWarpsLanesAreNeighbours) {
  std::vector<double> memory(3 * kElements * kLanes, -1);
  for (Index lane = 0; lane < kLanes; ++lane) {
    const LaneElements<Vector3<double>, double, kLanes> own{memory.data() + lane};
    for (Index i = 0; i < kElements; ++i) own.put(i, {number(i, 0, lane), number(i, 1, lane), number(i, 2, lane)});
  }
  for (Index i = 0; i < kElements; ++i)
    for (Index n = 0; n < 3; ++n)
      for (Index lane = 0; lane < kLanes; ++lane)
        EXPECT_EQ(memory[static_cast<std::size_t>((3 * i + n) * kLanes + lane)], number(i, n, lane))
            << i << ", " << n << ", lane " << lane;
  const LaneElements<Vector3<double>, double, kLanes> last{memory.data() + kLanes - 1};
  const Vector3<double> read = last.from(2)[1];
  EXPECT_EQ(read.x, number(3, 0, kLanes - 1));
  EXPECT_EQ(read.z, number(3, 2, kLanes - 1));
  EXPECT_EQ(last.as<double>()[4], number(1, 1, kLanes - 1));
  EXPECT_EQ(last.as<double>().numbers()[4], number(1, 1, kLanes - 1));
  last.as<double>()[4] = 7;
  EXPECT_EQ(memory[4 * kLanes + kLanes - 1], 7);
}

TEST(LaneElements, APacksElementsLieBehindOneAnother) {
  std::vector<double> memory(3 * kElements);
  std::iota(memory.begin(), memory.end(), 0.0);
  const LaneElements<Vector3<double>, double, 1> own{memory.data()};
  EXPECT_EQ(own[2].y, 7);
  EXPECT_EQ(&own[1].x, &memory[3]);
  own.from(3).put(1, {-1, -2, -3});
  EXPECT_EQ(memory[13], -2);
}

}  // namespace

}  // namespace stiction::test
