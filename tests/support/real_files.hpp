#pragma once

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "stiction/io.hpp"
#include "stiction/residual.hpp"
#include "tests/support/motion_bound.hpp"
#include "tests/support/small_systems.hpp"

namespace stiction::test {

/// The folder with real contact problems: environment variable STICTION_SHARED_DIR, else what was configured.
inline std::filesystem::path shared_folder() {
  const char* set = std::getenv("STICTION_SHARED_DIR");
  return set != nullptr ? set : STICTION_SHARED_DIR;
}

/// Solves a recorded file in f64 and expects every environment to reach the tolerance by the judge, to say so, and to
/// move as the recording simulator's own solution does.
inline void expect_solved_like_the_recording(const std::filesystem::path& path, SolverKind solver, double tolerance,
                                             Index max_iterations) {
  SCOPED_TRACE(path.filename().string() + ", " + to_string(solver));
  const io::Recording recording = io::read_batch(path);
  const auto view = recording.batch.view();
  SolverOptions o = options(solver, tolerance, max_iterations);
  o.threads = 0;
  const Solution<double> solution = solve(recording.batch, o);
  const auto judged = verify(view, std::span<const double>(solution.lambda));
  const bool has_reference = !recording.lambda_ref.empty();
  const auto reference = has_reference ? verify(view, std::span<const double>(recording.lambda_ref)) : judged;
  Index most = 0;
  for (Offset e = 0; e < view.env_count; ++e) {
    const auto i = static_cast<std::size_t>(e);
    const EnvStatus& status = solution.status[i];
    most = status.iterations > most ? status.iterations : most;
    EXPECT_EQ(status.code, EnvCode::solved)
        << "environment " << e << " after " << status.iterations << " iterations at " << status.residual;
    EXPECT_LE(judged[i].relative, tolerance * (1 + 1e-6)) << "environment " << e;
    if (!has_reference) continue;
    const auto first = static_cast<std::ptrdiff_t>(view.env_row_offsets[e]);
    const auto end = static_cast<std::ptrdiff_t>(view.env_row_offsets[e + 1]);
    const std::vector<double> ours(solution.lambda.begin() + first, solution.lambda.begin() + end);
    const std::vector<double> theirs(recording.lambda_ref.begin() + first, recording.lambda_ref.begin() + end);
    const MotionBound motion = motion_bound(view, e, ours, judged[i].absolute, theirs, reference[i].absolute);
    EXPECT_LE(motion.difference, motion.bound) << "environment " << e << " moves unlike the recording";
  }
  std::printf("%-24s %-6s %4lld environments, at most %d iterations\n", path.filename().string().c_str(),
              to_string(solver), static_cast<long long>(view.env_count), most);
}

}  // namespace stiction::test
