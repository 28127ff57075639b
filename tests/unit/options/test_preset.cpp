#include <gtest/gtest.h>

#include "stiction/error.hpp"
#include "stiction/preset.hpp"
#include "tests/support/systems/scene_batches.hpp"

namespace stiction::test {
namespace {

TEST(Preset, NamesAreReadBackAndOthersAreRefusedWithTheList) {
  for (int k = 0; k < kPresetCount; ++k) {
    const auto preset = static_cast<Preset>(k);
    EXPECT_EQ(preset_from_string(to_string(preset)), preset);
  }
  try {
    preset_from_string("walking");
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::invalid_argument);
    EXPECT_STREQ(error.what(), "preset 'walking' is not known; use one of: navigation, locomotion, grasping, assembly");
  }
}

TEST(Preset, EachAsksForMoreThanTheOneBefore) {
  for (int k = 1; k < kPresetCount; ++k) {
    const SolverOptions before = options_for(static_cast<Preset>(k - 1)), next = options_for(static_cast<Preset>(k));
    EXPECT_LT(next.tolerance, before.tolerance);
    EXPECT_GT(next.max_iterations, before.max_iterations);
  }
}

TEST(Preset, WhatIsSolvedUnderOneIsAsAccurateAsItSays) {
  const ContactBatch<double> batch = scene_batch("walker", 12, 4);
  for (int k = 0; k < kPresetCount; ++k) {
    const SolverOptions options = options_for(static_cast<Preset>(k));
    for (const EnvStatus& status : solve(batch, options).status) {
      EXPECT_EQ(status.code, EnvCode::solved) << to_string(static_cast<Preset>(k));
      EXPECT_LE(status.residual, options.tolerance);
    }
  }
}

}  // namespace
}  // namespace stiction::test
