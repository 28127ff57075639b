#include <gtest/gtest.h>

#include "tests/support/machines/solve_alone.hpp"
#include "tests/support/systems/small_systems.hpp"

#if defined(STICTION_TEST_HAS_IO)
#include <filesystem>
#include <string>
#include <vector>

#include "stiction/io.hpp"
#include "stiction/pyramid.hpp"
#include "stiction/residual.hpp"
#endif

namespace stiction::test {
namespace {

#if defined(STICTION_TEST_HAS_IO)

/// Environments of at most `rows` rows of a shared file, pivoted to 1e-9; returns how many there were. Pivots are as
/// good as roundings of the largest numbers, 1e-10 of the scale of light bodies beside them.
int pivot_all(const ContactBatch<double>& batch, Index rows) {
  int solved = 0;
  for (Offset env = 0; env < batch.env_count(); ++env) {
    if (batch.view().env_rows(env) > rows) continue;
    const auto solution = solve_alone(batch, options(SolverKind::lemke, 1e-9, 5000), env);
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

/// Environments of a file of complementarity problems that end on a ray; all others must be solved.
std::vector<std::size_t> rays_among(const std::string& path) {
  const auto batch = io::read_batch(path).batch;
  const auto solution = solve(batch, options(SolverKind::automatic, 1e-8, 5000));
  const auto judged = verify(batch.view(), std::span<const double>(solution.lambda));
  std::vector<std::size_t> rays;
  for (std::size_t env = 0; env < judged.size(); ++env) {
    if ((solution.status[env].flags & kFlagRay) != 0)
      rays.push_back(env);
    else
      EXPECT_LE(judged[env].relative, 1e-8) << path << ", environment " << env;
  }
  return rays;
}

TEST(LemkeFiles, ComplementarityProblemsOfOtherLibrariesAreSolvedOrEndOnARay) {
  const std::string folder = STICTION_SHARED_DIR "/data/lcp/";
  if (!std::filesystem::exists(folder + "siconos.h5")) GTEST_SKIP() << "no shared data";
  using Rays = std::vector<std::size_t>;
  EXPECT_EQ(rays_among(folder + "dart.h5"), Rays{});
  // With one bimatrix game in both: every path from the start ends on a ray, and one begun elsewhere does not.
  EXPECT_EQ(rays_among(folder + "drake.h5"), Rays{});
  EXPECT_EQ(rays_among(folder + "siconos.h5"), Rays{});
  // These have no solution: w = -1 - lambda, and w_0 = -1e-4 - lambda_1 - lambda_2.
  EXPECT_EQ(rays_among(folder + "drake_unsolved.h5"), Rays{0});
  EXPECT_EQ(rays_among(folder + "siconos_unsolved.h5"), Rays{0});
}

#endif

}  // namespace
}  // namespace stiction::test
