#include <gtest/gtest.h>

#include <vector>

#include "core/algorithm/solver/lemke/lemke.hpp"
#include "scenes/rng.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/machines/solve_alone.hpp"
#include "tests/support/machines/solve_on_lanes.hpp"
#include "tests/support/machines/torture_cases.hpp"
#include "tests/support/systems/small_systems.hpp"

/// The scenes of torture_cases.hpp have friction, which Lemke refuses; these have every kind of row that it takes.
namespace stiction::test {
namespace {

/// Rows of every kind in islands of `island` rows, half of them redundant. There are free rows that depend on one
/// another, degenerate contacts, bounds of every sort.
Environment<double> islands(std::size_t rows, std::size_t island) {
  scenes::Rng rng(77);
  const double infinite = __builtin_huge_val();
  Environment<double> env;
  std::vector<double> A(rows * rows, 0.0), J(rows * island / 2);
  for (double& entry : J) entry = rng.symmetric(1.0);
  for (std::size_t i = 0; i < rows; ++i) {
    env.cones.push_back(i % 3 == 0 ? free_row() : i % 3 == 1 ? unilateral() : box());
    env.lo.push_back(i % 4 == 1 ? -infinite : -0.25);
    env.hi.push_back(i % 5 == 1 ? infinite : i % 7 == 1 ? -0.25 : 0.125);
    double b = 0.0;
    for (std::size_t k = 0; k < island / 2; ++k) b += J[i * island / 2 + k];
    env.b.push_back(b);
    for (std::size_t j = 0; j < rows; ++j)
      for (std::size_t k = 0; k < island / 2 && i / island == j / island; ++k)
        A[i * rows + j] += J[i * island / 2 + k] * J[j * island / 2 + k];
  }
  env.set_dense(A, static_cast<Index>(rows));
  return env;
}

template <class Real>
void torture(const Environment<double>& environment, EnvPath path) {
  const ContactBatch<Real> batch = convert<Real>(batch_of({environment}));
  const SolverOptions o = options(SolverKind::lemke, 1e-3, 1000);
  const Solution<Real> expected = solve_alone(batch, o);
  EXPECT_EQ(expected.status[0].code, EnvCode::solved) << expected.status[0].residual;
  EXPECT_GT(expected.status[0].iterations, Lemke::kChunk) << "the path is longer than one chunk";
  ASSERT_EQ(make_plan(batch.view()).path[0], path);
  for (const Index width : {1, 2, 3, 8, 33})
    EXPECT_TRUE(same_bits(expected, solve_on_teams(batch, o, width))) << "width " << width;
}

TEST(Torture, LemkeHasTheSameBitsOnTeamsOfEveryWidth) {
  const Environment<double> small = islands(40, 40);
  torture<float>(small, EnvPath::dense);
  torture<double>(small, EnvPath::dense);
  const Environment<double> large = islands(72, 12);
  torture<float>(large, EnvPath::sparse);
  torture<double>(large, EnvPath::sparse);
}

TEST(Torture, LemkesLanesThatDawdleChangeNoBit) {
  for (const Index width : {1, 2, 3, 8}) {
    const ContactBatch<float> batch = convert<float>(batch_of({islands(40, 40)}));
    const SolverOptions o = options(SolverKind::lemke, 1e-3, 1000);
    EXPECT_TRUE(
        same_bits(solve_alone(batch, o), solve_on_lanes<Lemke, Law::convex, DenseSystem<float>>(batch, o, width, 42)))
        << "width " << width;
  }
}

}  // namespace
}  // namespace stiction::test
