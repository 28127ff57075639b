#pragma once

#include <Eigen/Core>
#include <cstdio>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "stiction/analysis.hpp"
#include "tests/support/systems/scene_batches.hpp"
#if defined(STICTION_TEST_HAS_IO)
#include "stiction/io.hpp"
#endif

/// Operators as matrices for other libraries, and where tests of their analysis get them from.
namespace stiction::test {

inline Eigen::MatrixXd dense(const ContactBatchView<double>& batch, Offset env) {
  const Index n = batch.env_rows(env);
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(n, n);
  for (Index i = 0; i < n; ++i) {
    const Offset row = batch.env_row_offsets[env] + i;
    for (Offset k = batch.row_offsets[row]; k < batch.row_offsets[row + 1]; ++k) A(i, batch.column[k]) += batch.A[k];
    A(i, i) += batch.R[row];
  }
  return A;
}

inline OperatorAnalysis analyse_one(const ContactBatchView<double>& batch, Offset env, Index max_steps) {
  AnalysisOptions options;
  options.max_steps = max_steps;
  const std::vector<Offset> only{env};
  return analyse(batch, std::span<const Offset>(only), options).at(0);
}

/// Calls f(batch, environment) for the first three environments of 3 to 120 rows; how many those were.
template <class F>
int for_each_small(const ContactBatchView<double>& batch, F&& f) {
  int seen = 0;
  for (Offset env = 0; env < batch.env_count && seen < 3; ++env) {
    if (batch.env_rows(env) < 3 || batch.env_rows(env) > 120) continue;
    f(batch, env);
    ++seen;
  }
  return seen;
}

/// Calls f for the small environments of every generated scene.
template <class F>
int for_each_small_scene(F&& f) {
  int seen = 0;
  for (const auto& info : scenes::list()) {
    const auto batch = scene_batch(info.name, 3, 11);
    SCOPED_TRACE(info.name);
    seen += for_each_small(batch.view(), f);
  }
  return seen;
}

/// Calls f for those of every recording beside the examples; 0 where no files are read.
template <class F>
int for_each_small_recording([[maybe_unused]] F&& f) {
  int seen = 0;
#if defined(STICTION_TEST_HAS_IO)
  for (const char* name : {"humanoid", "quadruped_rough", "hand_cube", "pile", "trajectory"}) {
    SCOPED_TRACE(name);
    const auto path = std::filesystem::path(STICTION_EXAMPLES_DIR) / "data" / (std::string(name) + ".h5");
    seen += for_each_small(io::read_batch(path).batch.view(), f);
  }
#endif
  return seen;
}

}  // namespace stiction::test
