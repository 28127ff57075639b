#include <gtest/gtest.h>

#if defined(STICTION_TEST_HAS_IO)
#include "tests/support/machines/every_solver.hpp"
#include "tests/support/systems/real_files.hpp"
#endif

/// Complementarity problems of other libraries, many of them not symmetric or with several solutions, and the normal
/// problems of the Coulomb files.
namespace stiction::test {
namespace {

#if defined(STICTION_TEST_HAS_IO)

struct LcpFile {
  const char* name;
  Offset envs;
  std::vector<Unsolved> unsolved;  ///< by auto
};

const char* const kInfeasible = "w = -1 - lambda: no solution";
const char* const kPerturbed = "w_0 = -1e-4 - lambda_1 - lambda_2: no solution";

const LcpFile kFiles[] = {{"dart", 6, {}},     {"drake", 8, {}},    {"drake_unsolved", 1, {{0, kInfeasible}}},
                          {"normals", 35, {}}, {"siconos", 19, {}}, {"siconos_unsolved", 1, {{0, kPerturbed}}}};

class SharedLcp : public testing::TestWithParam<LcpFile> {};

TEST_P(SharedLcp, IsSolvedByAutoAndConfirmedByTheJudge) {
  const LcpFile& file = GetParam();
  const auto path = shared_file(std::string("lcp/") + file.name + ".h5");
  if (!std::filesystem::exists(path)) GTEST_SKIP() << absent(path);
  const ContactBatch<double> batch = io::read_batch(path).batch;
  ASSERT_EQ(batch.env_count(), file.envs);
  for (const double tolerance : {1e-6, 1e-8})
    expect_solved_but_for(file.name, batch, options(SolverKind::automatic, tolerance, 20000), file.unsolved);
}

/// Few of these suit sweeps or splittings. Whatever a solver claims, the judge confirms.
TEST_P(SharedLcp, NoSolverClaimsWhatTheJudgeDenies) {
  const LcpFile& file = GetParam();
  const auto path = shared_file(std::string("lcp/") + file.name + ".h5");
  if (!std::filesystem::exists(path)) GTEST_SKIP() << absent(path);
  const ContactBatch<double> batch = up_to(io::read_batch(path).batch, 300);
  for (const SolverKind solver : kEveryChoice) {
    SolverOptions o = options(solver, 1e-8, is_costly(solver) && solver != SolverKind::lemke ? 60 : 2000);
    o.invalid = InvalidPolicy::isolate;
    const Solution<double> solution = solve(batch, o);
    const auto judged = verify(batch.view(), std::span<const double>(solution.lambda));
    for (std::size_t e = 0; e < judged.size(); ++e) {
      SCOPED_TRACE(std::string(file.name) + ", " + to_string(solver) + ", environment " + std::to_string(e));
      EXPECT_TRUE(std::isfinite(judged[e].absolute));
      if (solution.status[e].code != EnvCode::solved) continue;
      EXPECT_LE(judged[e].relative, o.tolerance * (1 + 1e-6)) << "said to be solved at " << solution.status[e].residual;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Files, SharedLcp, testing::ValuesIn(kFiles),
                         [](const auto& file) { return std::string(file.param.name); });

#else

TEST(SharedLcp, IsSolvedByAutoAndConfirmedByTheJudge) {
  GTEST_SKIP() << "this build reads no HDF5 files: no shared problem is solved";
}

#endif

}  // namespace
}  // namespace stiction::test
