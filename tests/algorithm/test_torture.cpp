#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "core/algorithm/solver/apgd.hpp"
#include "core/algorithm/solver/npgs.hpp"
#include "tests/support/machines/solve_on_lanes.hpp"
#include "tests/support/machines/torture_cases.hpp"

namespace stiction::test {

namespace {

/// One environment solved by an algorithm itself, against the public solver.
template <class Method, Law kLaw, class System, Index kTile>
void expect_same_on_lanes(const Environment<double>& environment, bool warm, std::initializer_list<Index> widths,
                          std::uint64_t seed) {
  using Real = typename System::Real;
  const ContactBatch<Real> batch = convert<Real>(batch_of({environment}, kLaw));
  const SolverOptions options = torture_options(Method::kKind);
  const std::vector<Real> guess = torture_guess<Real>(warm, batch.row_count());
  const Solution<Real> expected = solve(batch, options, Device::cpu(), std::span<const Real>(guess));
  for (const Index width : widths)
    EXPECT_TRUE(same_bits(expected, solve_on_lanes<Method, kLaw, System, kTile>(batch, options, width, seed, guess)))
        << label(Method::kKind, kLaw) << ", width " << width;
}

}  // namespace

TEST(Torture, ABlockGivesEveryLaneTheFirstLanesValue) {
  for (const Index width : kWidths) {
    std::vector<double> seen(static_cast<std::size_t>(width));
    run_stressed(width, [&](auto& team) {
      double sum = 0.0;
      for (int round = 0; round < 50; ++round) sum += team.broadcast([&] { return 1.0 + round + 100.0 * team.rank(); });
      seen[static_cast<std::size_t>(team.rank())] = sum;
    });
    for (const double sum : seen) EXPECT_EQ(sum, 50.0 + 49.0 * 25.0) << "width " << width;
  }
}

TEST(Torture, MaximaFlagsAndSumsAreOnEveryLaneWhateverTheWidth) {
  const std::vector<float> values{0.1F, 7.5F, 3.3F, 1e-3F, 2.2F, 7.25F, 0.7F};
  const auto term = [&](Index leaf) { return values[static_cast<std::size_t>(leaf) % values.size()]; };
  SerialTeam serial;
  const float expected = sum_leaves<float>(serial, term);
  for (const Index width : kWidths) {
    run_stressed(width, [&](auto& team) {
      const auto own = values[static_cast<std::size_t>(team.rank()) % values.size()];
      EXPECT_EQ(team.max(own), width == 1 ? 0.1F : 7.5F);
      EXPECT_EQ(team.combine(1U << (team.rank() % 32)), width >= 32 ? 0xffffffffU : (1U << width) - 1U);
      EXPECT_EQ(sum_leaves<float>(team, term), expected);
    });
  }
}

// A lane takes one row at once, as a GPU's does; the emulated device's takes four, and the CPU's eight.
TEST(Torture, LanesThatDawdleChangeNoBitOfADenseEnvironment) {
  expect_same_on_lanes<Npgs, Law::coulomb, DenseSystem<float>, 1>(small_dense(), true, {3, 33}, 42);
}

TEST(Torture, LanesThatDawdleChangeNoBitOfASparseEnvironment) {
  expect_same_on_lanes<Apgd, Law::convex, SparseSystem<double>, 4>(small_sparse(), false, {5, 16}, 42);
}

TEST(Torture, APoisonedEnvironmentIsRefusedAlikeOnBlocksOfEveryWidth) {
  Environment<double> poisoned = small_dense();
  poisoned.b[2] = std::numeric_limits<double>::quiet_NaN();
  expect_same_on_lanes<Npgs, Law::coulomb, DenseSystem<float>, 1>(poisoned, false, {1, 2, 3, 8, 16, 33}, 42);
}

}  // namespace stiction::test
