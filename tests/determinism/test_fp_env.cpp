#include <gtest/gtest.h>

#include <cfenv>
#include <cmath>

#include "tests/support/machines/flush_modes.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

/// Puts the floating-point environment back, whatever a test did to it.
class FpEnv : public testing::Test {
 protected:
  FpEnv() { std::fegetenv(&saved_); }
  ~FpEnv() override { std::fesetenv(&saved_); }

  /// An omega that no float holds: its rounding to f32 is a rounding like any other.
  static SolverOptions relaxed(SolverKind solver) {
    SolverOptions o = options(solver, 1e-5, 24);
    o.omega = 1.1;
    return o;
  }

 private:
  std::fenv_t saved_{};
};

const ContactBatch<double>& doubles() {
  static const ContactBatch<double> batch = scene_batch("walker", 20, 9);
  return batch;
}
const ContactBatch<float>& floats() {
  static const ContactBatch<float> batch = convert<float>(doubles());
  return batch;
}

/// Small enough that intermediate results are subnormal: b and A scaled by powers of two.
ContactBatch<float> subnormal_batch() {
  auto arrays = floats().arrays();
  for (float& value : arrays.b) value *= 0x1p-126F;
  return ContactBatch<float>::from_arrays(floats().law(), arrays);
}

TEST_F(FpEnv, TheCallersRoundingModeReachesNoBitAndIsLeftAsItWas) {
  for (const SolverKind solver : kAllSolvers) {
    std::fesetround(FE_TONEAREST);
    const auto expected32 = solve_hashes(floats(), relaxed(solver));
    const auto expected64 = solve_hashes(doubles(), relaxed(solver));
    for (const int mode : {FE_UPWARD, FE_DOWNWARD, FE_TOWARDZERO}) {
      for (const int threads : {1, 2}) {
        SCOPED_TRACE(std::string(to_string(solver)) + ", mode " + std::to_string(mode));
        SolverOptions o = relaxed(solver);
        o.threads = threads;
        std::fesetround(mode);
        const Solution<float> single = solve(floats(), o);
        const Solution<double> twice = solve(doubles(), o);
        const int after = std::fegetround();
        std::fesetround(FE_TONEAREST);
        EXPECT_EQ(after, mode);
        EXPECT_EQ(env_hashes(floats(), single), expected32);
        EXPECT_EQ(env_hashes(doubles(), twice), expected64);
      }
    }
  }
}

TEST_F(FpEnv, FlushedSubnormalsReachNoBitAndTheModeIsLeftAsItWas) {
  if (kFlushModes.empty()) GTEST_SKIP() << "this processor has no such mode, or none that the test knows";
  const ContactBatch<float> tiny = subnormal_batch();
  for (const SolverKind solver : kAllSolvers) {
    const auto expected = solve_hashes(tiny, relaxed(solver));
    for (const unsigned mode : kFlushModes) {
      for (const int threads : {1, 2}) {
        SCOPED_TRACE(std::string(to_string(solver)) + ", mode " + std::to_string(mode));
        SolverOptions o = relaxed(solver);
        o.threads = threads;
        const unsigned before = fp_control();
        set_fp_control(before | mode);
        const Solution<float> solution = solve(tiny, o);
        const unsigned after = fp_control();
        set_fp_control(before);
        EXPECT_EQ(after & kFlushBits, mode);
        EXPECT_EQ(env_hashes(tiny, solution), expected);
      }
    }
  }
}

TEST_F(FpEnv, TheSubnormalBatchOfTheseTestsWouldNoticeAFlush) {
  const ContactBatch<float> tiny = subnormal_batch();
  const Solution<float> solution = solve(tiny, relaxed(SolverKind::pgs));
  int subnormal = 0;
  for (const float value : solution.w) subnormal += std::fpclassify(value) == FP_SUBNORMAL;
  EXPECT_GT(subnormal, 0);
}

}  // namespace
