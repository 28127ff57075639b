#include <gtest/gtest.h>

#if defined(STICTION_TEST_HAS_IO)
#include "tests/support/systems/real_files.hpp"
#endif

namespace {

/// Recordings of this project's own models (examples/data/README.md).
class Examples : public testing::TestWithParam<const char*> {
 protected:
  void expect_solved(const char* solver) {
#if defined(STICTION_TEST_HAS_IO)
    const auto path = std::filesystem::path(STICTION_EXAMPLES_DIR) / "data" / (std::string(GetParam()) + ".h5");
    if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not there";
    stiction::test::expect_solved_like_the_recording(path, stiction::solver_from_string(solver), 1e-6, 20000);
#else
    GTEST_SKIP() << "this build reads no HDF5 files: " << solver << " is not tried on " << GetParam();
#endif
  }
};

TEST_P(Examples, NpgsReachesOneMillionthInEveryEnvironment) {
  expect_solved("npgs");
}

TEST_P(Examples, ApgdReachesOneMillionthInEveryEnvironment) {
  expect_solved("apgd");
}

INSTANTIATE_TEST_SUITE_P(Files, Examples,
                         testing::Values("humanoid", "quadruped_rough", "hand_cube", "pile", "trajectory"));

}  // namespace
