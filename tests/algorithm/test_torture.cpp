#include <limits>
#include <vector>

#include "core/algorithm/solver/apgd.hpp"
#include "core/algorithm/solver/npgs.hpp"
#include "tests/support/torture_cases.hpp"

namespace stiction::test {

TEST(Torture, ABlockGivesEveryLaneTheFirstLanesValue) {
  for (const Index width : kWidths) {
    std::vector<double> seen(static_cast<std::size_t>(width));
    run_stressed(width, kTorture<1>, [&](auto& team) {
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
    run_stressed(width, kTorture<8>, [&](auto& team) {
      const auto own = values[static_cast<std::size_t>(team.rank()) % values.size()];
      EXPECT_EQ(team.max(own), width == 1 ? 0.1F : 7.5F);
      EXPECT_EQ(team.combine(1U << (team.rank() % 32)), width >= 32 ? 0xffffffffU : (1U << width) - 1U);
      EXPECT_EQ(sum_leaves<float>(team, term), expected);
    });
  }
}

TEST(Torture, LanesThatDawdleChangeNoBitOfADenseEnvironment) {
  const TortureCase<Npgs, Law::coulomb, float> one(small_dense(), true);
  for (const Index width : {3, 33}) one.expect_same_dense<1>(width, kJitter, "jitter, dense");
}

TEST(Torture, LanesThatDawdleChangeNoBitOfASparseEnvironment) {
  const TortureCase<Apgd, Law::convex, double> one(small_sparse(), false);
  for (const Index width : {5, 16}) one.expect_same_sparse(width, kJitter, "jitter, sparse");
}

TEST(Torture, APoisonedEnvironmentIsRefusedAlikeOnBlocksOfEveryWidth) {
  Environment<double> poisoned = small_dense();
  poisoned.b[2] = std::numeric_limits<double>::quiet_NaN();
  const TortureCase<Npgs, Law::coulomb, float> one(poisoned, false);
  for (const Index width : kWidths) one.expect_same_dense<1>(width, kJitter, "poisoned");
}

}  // namespace stiction::test
