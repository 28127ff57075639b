#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "bench/scenes/rng.hpp"
#include "tests/support/scene_batches.hpp"
#include "tests/support/small_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

template <class Real>
class EnvOrder : public testing::Test {
 protected:
  EnvOrder() : batch(convert<Real>(ragged_batch(4, 11))) {}

  /// Every environment of `order` must have the hash it has in the whole batch.
  void expect_as_in_batch(const std::vector<Offset>& order, const SolverOptions& o,
                          const std::vector<std::uint64_t>& whole) {
    const auto part = solve_hashes(gather<Real>(batch, order), o);
    ASSERT_EQ(part.size(), order.size());
    for (std::size_t i = 0; i < order.size(); ++i)
      EXPECT_EQ(part[i], whole[static_cast<std::size_t>(order[i])]) << "environment " << order[i] << " at place " << i;
  }

  [[nodiscard]] std::vector<Offset> identity() const {
    std::vector<Offset> order(static_cast<std::size_t>(batch.env_count()));
    std::iota(order.begin(), order.end(), Offset{0});
    return order;
  }

  ContactBatch<Real> batch;
};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(EnvOrder, Precisions);

TYPED_TEST(EnvOrder, PermutedEnvironmentsKeepTheirBits) {
  for (const SolverKind solver : kAllSolvers) {
    SCOPED_TRACE(to_string(solver));
    const SolverOptions o = options(solver, 1e-3, 40);
    const auto whole = solve_hashes(this->batch, o);
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      auto order = this->identity();
      scenes::Rng rng(seed);
      for (std::size_t k = order.size(); k > 1; --k)
        std::swap(order[k - 1], order[static_cast<std::size_t>(rng.below(static_cast<int>(k)))]);
      this->expect_as_in_batch(order, o, whole);
    }
  }
}

TYPED_TEST(EnvOrder, SplitBatchesAndBatchesOfOneKeepTheirBits) {
  const SolverOptions o = options(SolverKind::npgs, 1e-3, 40);
  const auto whole = solve_hashes(this->batch, o);
  const auto all = this->identity();
  const auto middle = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 3);
  this->expect_as_in_batch({all.begin(), middle}, o, whole);
  this->expect_as_in_batch({middle, all.end()}, o, whole);
  for (const Offset env : all) this->expect_as_in_batch({env}, o, whole);
}

TYPED_TEST(EnvOrder, MergedAndRepeatedEnvironmentsKeepTheirBits) {
  for (const SolverKind solver : {SolverKind::npgs, SolverKind::apgd}) {
    SCOPED_TRACE(to_string(solver));
    const SolverOptions o = options(solver, 1e-3, 24);
    const auto whole = solve_hashes(this->batch, o);
    std::vector<Offset> order;
    for (int copy = 0; copy < 3; ++copy)
      for (const Offset env : this->identity()) order.push_back(env);
    this->expect_as_in_batch(order, o, whole);
  }
}

TYPED_TEST(EnvOrder, NeighboursThatTakeLongerOrStopEarlierChangeNothing) {
  // One environment among neighbours that are all harder, all easier, and none.
  const ContactBatch<TypeParam> probe = convert<TypeParam>(scene_batch("walker", 1, 2));
  const SolverOptions o = options(SolverKind::npgs, 1e-3, 200);
  const std::uint64_t alone = solve_hashes(probe, o).at(0);
  for (const char* neighbours : {"adversarial", "stack", "grasp"}) {
    ContactBatch<double> mixed(Law::convex);
    for (std::uint64_t e = 0; e < 20; ++e) mixed.add(scenes::make(neighbours, 1, e).system);
    mixed.add(scenes::make("walker", 2, 0).system);
    for (std::uint64_t e = 0; e < 7; ++e) mixed.add(scenes::make(neighbours, 2, e).system);
    EXPECT_EQ(solve_hashes(convert<TypeParam>(mixed), o).at(20), alone) << "among " << neighbours;
  }
}

}  // namespace
