#include <gtest/gtest.h>

#if defined(STICTION_TEST_HAS_IO)
#include "tests/support/systems/real_files.hpp"
#endif

namespace {

/// Recordings of public MuJoCo models, optional shared data.
class Mujoco : public testing::TestWithParam<const char*> {
 protected:
  void expect_solved(const char* solver) {
#if defined(STICTION_TEST_HAS_IO)
    const auto path = stiction::test::shared_folder() / "data" / "mujoco" / (std::string(GetParam()) + ".h5");
    if (!std::filesystem::exists(path))
      GTEST_SKIP() << path << " is not there: set STICTION_SHARED_DIR to the folder with real contact problems";
    stiction::test::expect_solved_like_the_recording(path, stiction::solver_from_string(solver), 1e-6, 20000);
#else
    GTEST_SKIP() << "this build reads no HDF5 files: " << solver << " is not tried on " << GetParam();
#endif
  }
};

TEST_P(Mujoco, NpgsReachesOneMillionthInEveryEnvironment) {
  expect_solved("npgs");
}

TEST_P(Mujoco, ApgdReachesOneMillionthInEveryEnvironment) {
  expect_solved("apgd");
}

INSTANTIATE_TEST_SUITE_P(Files, Mujoco,
                         testing::Values("22_humanoids", "aloha_peg", "car", "cube_3x3x3", "dominos", "franka_cube",
                                         "g1", "go1", "humanoid", "leap_hand"));

}  // namespace
