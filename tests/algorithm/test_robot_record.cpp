#include <gtest/gtest.h>

#include "core/algorithm/articulated/robot_source.hpp"

/// The record of a step with several solves.
namespace {

using namespace stiction;

LaneProgress ended(double relative, Index steps, bool is_answered, bool is_rounding = false) {
  LaneProgress lane;
  lane.relative = lane.absolute = relative;
  lane.max_iterations = 10;
  lane.steps = steps;
  lane.is_answered = is_answered;
  lane.is_rounding = is_rounding;
  return lane;
}

TEST(RobotRecord, KeepsTheFirstCodeThatIsNotSolvedAndTheLargestResidual) {
  RobotRecord record;
  record.join(ended(1e-9, 2, true));
  EXPECT_EQ(record.code, EnvCode::solved);
  record.join(ended(1e-3, 10, false));
  record.join(ended(1e-2, 4, false));
  record.join(ended(1e-8, 3, true));
  EXPECT_EQ(record.code, EnvCode::max_iterations);
  EXPECT_EQ(record.relative, 1e-2);
  EXPECT_EQ(record.absolute, 1e-2);
  EXPECT_EQ(record.steps, 19);
}

TEST(RobotRecord, TellsStalledSolvesFromThoseThatRoundingEnded) {
  RobotRecord stalled, rounding;
  stalled.join(ended(1e-3, 4, false));
  rounding.join(ended(1e-6, 4, true, true));
  EXPECT_EQ(stalled.code, EnvCode::stalled);
  EXPECT_EQ(rounding.code, EnvCode::rounding);
}

}  // namespace
