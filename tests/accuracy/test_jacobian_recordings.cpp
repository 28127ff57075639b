#include <gtest/gtest.h>

#if defined(STICTION_TEST_HAS_IO)

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "stiction/io.hpp"
#include "stiction/residual.hpp"
#include "tests/support/systems/jacobian_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

/// Compares with MuJoCo on its own models: its mj_solveM2 with our Cholesky, its accelerations with ours.
class JacobianRecordings : public ::testing::TestWithParam<const char*> {
 protected:
  io::Recording recording_ =
      io::read_batch(std::filesystem::path(STICTION_EXAMPLES_DIR) / "data" / (std::string(GetParam()) + ".h5"));
};

double largest_of(std::span<const double> values) {
  double largest = 0.0;
  for (const double value : values) largest = std::max(largest, std::abs(value));
  return largest;
}

TEST_P(JacobianRecordings, AssemblyGivesTheRecordedSystem) {
  const auto assembled = assemble(io::jacobian_batch<double>(recording_).view(), FactorUse::never);
  const auto ours = assembled.view(), theirs = recording_.batch.view();
  ASSERT_EQ(ours.env_count, theirs.env_count);
  for (Offset env = 0; env < ours.env_count; ++env) {
    const Offset first = ours.env_row_offsets[env];
    const auto n = static_cast<std::size_t>(ours.env_rows(env));
    const auto dense = [&](const ContactBatchView<double>& batch) {
      std::vector<double> A(n * n, 0.0);
      for (std::size_t i = 0; i < n; ++i) {
        const Offset row = first + static_cast<Offset>(i);
        for (Index k = 0; k < batch.row_entries(row); ++k)
          A[i * n + static_cast<std::size_t>(batch.row_columns(row)[k])] += batch.A[batch.row_offsets[row] + k];
      }
      return A;
    };
    const std::vector<double> A = dense(ours), expected = dense(theirs);
    EXPECT_LE(largest_difference(A, expected), 1e-12 * largest_of(expected)) << "env " << env;
    const std::span<const double> b(ours.b + first, n), b_expected(theirs.b + first, n);
    EXPECT_LE(largest_difference(b, b_expected), 1e-12 * (1 + largest_of(b_expected))) << "env " << env;
  }
}

TEST_P(JacobianRecordings, VelocitiesOfTheRecordedForcesAreTheRecordedOnes) {
  const auto jacobian = io::jacobian_batch<double>(recording_);
  const auto velocity = velocities(jacobian.view(), std::span<const double>(recording_.lambda_ref));
  for (std::size_t e = 0; e + 1 < recording_.env_dof_offsets.size(); ++e) {
    const auto first = static_cast<std::size_t>(recording_.env_dof_offsets[e]);
    const auto count = static_cast<std::size_t>(recording_.env_dof_offsets[e + 1]) - first;
    const auto expected = std::span<const double>(recording_.v_ref).subspan(first, count);
    const double scale = 1 + largest_of(expected) + largest_of(std::span(recording_.v_free).subspan(first, count));
    EXPECT_LE(largest_difference(std::span<const double>(velocity).subspan(first, count), expected), 1e-7 * scale)
        << "env " << e;
  }
}

TEST_P(JacobianRecordings, MatrixAndFactorReachTheToleranceByTheJudge) {
  const auto jacobian = io::jacobian_batch<double>(recording_);
  SolverOptions o = options(SolverKind::apgd, 1e-6, 20000);
  o.threads = 0;
  for (const FactorUse use : {FactorUse::never, FactorUse::always}) {
    const auto solution = solve(jacobian, o, Device::cpu(), {}, use);
    const auto judged = verify(recording_.batch.view(), std::span<const double>(solution.contact.lambda));
    for (std::size_t e = 0; e < judged.size(); ++e) {
      EXPECT_EQ(solution.contact.status[e].code, EnvCode::solved) << "env " << e;
      EXPECT_LE(judged[e].relative, 1.01e-6) << "env " << e;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Files, JacobianRecordings, testing::Values("humanoid", "hand_cube", "quadruped_rough"));

}  // namespace

#endif
