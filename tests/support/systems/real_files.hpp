#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "stiction/io.hpp"
#include "stiction/residual.hpp"
#include "tests/support/oracles/motion_bound.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace stiction::test {

/// The folder with real contact problems: environment variable STICTION_SHARED_DIR, else the configured one.
inline std::filesystem::path shared_folder() {
  const char* set = std::getenv("STICTION_SHARED_DIR");
  return set != nullptr ? set : STICTION_SHARED_DIR;
}

/// Solves a recorded file in f64. It expects every environment to reach the tolerance by the judge, to report it, and
/// to move as the recording simulator's own solution does.
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

/// An environment of a file that a solver does not solve to a tolerance, and why.
struct Unsolved {
  Offset env;
  const char* why;
  bool is_judged = true;  ///< the judge denies it, too
};

/// Expects a status to agree with the judge: `solved` at or below the tolerance, anything else finite and above it. A
/// record's residual and the judge's differ by the roundings of a row, a factor of less than two.
inline void expect_honest(const EnvStatus& status, const Residual& judged, double tolerance) {
  EXPECT_TRUE(std::isfinite(judged.absolute)) << to_string(status.code);
  if (status.code == EnvCode::solved) {
    EXPECT_LE(status.residual, tolerance);
    EXPECT_LE(judged.relative, tolerance * (1 + 1e-6)) << "solved, says the status at " << status.residual;
  } else {
    EXPECT_GT(status.residual, tolerance) << to_string(status.code);
    EXPECT_GT(judged.relative, 0.5 * tolerance) << to_string(status.code) << " at " << status.residual;
  }
}

/// Solves every environment in f64, on all cores, and expects honest answers. The judge confirms every `solved`, and
/// that is every environment but those listed. Same bits everywhere: the list is exact.
inline void expect_solved_but_for(const std::string& file, const ContactBatch<double>& batch,
                                  const SolverOptions& asked, const std::vector<Unsolved>& unsolved) {
  SCOPED_TRACE(file + ", " + to_string(asked.solver));
  SolverOptions o = asked;
  o.stall_window = SolverOptions{}.stall_window;  // a caller's default
  o.threads = 0;
  o.invalid = InvalidPolicy::isolate;
  const Solution<double> solution = solve(batch, o);
  const auto judged = verify(batch.view(), std::span<const double>(solution.lambda));
  Offset solved = 0;
  for (Offset e = 0; e < batch.env_count(); ++e) {
    SCOPED_TRACE("environment " + std::to_string(e));
    const auto i = static_cast<std::size_t>(e);
    const EnvStatus& status = solution.status[i];
    const auto listed =
        std::find_if(unsolved.begin(), unsolved.end(), [e](const Unsolved& known) { return known.env == e; });
    if (listed == unsolved.end() || listed->is_judged) expect_honest(status, judged[i], o.tolerance);
    if (status.code == EnvCode::solved) {
      ++solved;
      EXPECT_EQ(listed, unsolved.end()) << "is solved now: take it off the list";
    } else {
      EXPECT_NE(listed, unsolved.end()) << to_string(status.code) << " after " << status.iterations << " iterations of "
                                        << to_string(status.solver) << " at " << status.residual;
    }
  }
  std::printf("%-28s %-8s %g: %lld of %lld environments\n", file.c_str(), to_string(o.solver), o.tolerance,
              static_cast<long long>(solved), static_cast<long long>(batch.env_count()));
  for (const Unsolved& known : unsolved)
    std::printf("  not solved: %lld, %s\n", static_cast<long long>(known.env), known.why);
}

/// Environments that share a reason.
inline std::vector<Unsolved> all_of(const std::vector<Offset>& envs, const char* why) {
  std::vector<Unsolved> result;
  for (const Offset env : envs) result.push_back({env, why});
  return result;
}

/// Returns the path of a file of the shared data.
inline std::filesystem::path shared_file(const std::string& name) {
  return shared_folder() / "data" / name;
}

/// Why a test without that file is skipped.
inline std::string absent(const std::filesystem::path& path) {
  return path.string() + " is not there: set STICTION_SHARED_DIR to the folder with real contact problems";
}

}  // namespace stiction::test
