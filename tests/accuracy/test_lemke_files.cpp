#include <gtest/gtest.h>

#include "core/body/lemke_body.hpp"
#include "tests/support/small_systems.hpp"
#include "tests/support/solve_alone.hpp"

#if defined(STICTION_TEST_HAS_IO)
#include <filesystem>
#include <string>

#include "stiction/io.hpp"
#include "stiction/pyramid.hpp"
#endif

namespace stiction::test {
namespace {

#if defined(STICTION_TEST_HAS_IO)

/// Environments of at most `rows` rows of a shared file, pivoted to 1e-12; returns how many there were.
int pivot_all(const ContactBatch<double>& batch, Index rows) {
  int solved = 0;
  for (Offset env = 0; env < batch.env_count(); ++env) {
    if (batch.view().env_rows(env) > rows) continue;
    const auto solution = solve_alone<Lemke, Law::convex>(batch, options(SolverKind::lemke, 1e-12, 5000), env);
    EXPECT_EQ(solution.status[0].code, EnvCode::solved)
        << "environment " << env << ", residual " << solution.status[0].residual;
    ++solved;
  }
  return solved;
}

TEST(LemkeFiles, NormalRowsOfRealContactProblemsAreSolvedToRounding) {
  const std::string file = STICTION_SHARED_DIR "/data/lcp/normals.h5";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << "no shared data";
  EXPECT_EQ(pivot_all(io::read_batch(file).batch, 300), 32);
}

TEST(LemkeFiles, PyramidsOfARobotAreSolvedToRounding) {
  const std::string file = STICTION_SHARED_DIR "/data/mujoco/go1.h5";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << "no shared data";
  EXPECT_EQ(pivot_all(linearise(io::read_batch(file).batch, 8).batch, 1024), 32);
}

#endif

}  // namespace
}  // namespace stiction::test
