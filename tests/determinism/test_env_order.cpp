#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "scenes/rng.hpp"
#include "tests/support/machines/every_solver.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

template <class Real>
class EnvOrder : public testing::Test {
 protected:
  /// Results of a solver for the whole batch, and for any part of it.
  class Whole {
   public:
    explicit Whole(SolverKind solver)
        : batch_(batch_for<Real>(solver, ragged_batch(4, 11), 200)),
          options_(options(solver, 1e-3, few_iterations(solver, 40))),
          hashes_(solve_hashes(batch_, options_)) {}

    /// Every environment of `order` must have the hash it has in the whole batch.
    void expect_same(const std::vector<Offset>& order) const {
      const auto part = solve_hashes(gather<Real>(batch_, order), options_);
      ASSERT_EQ(part.size(), order.size());
      for (std::size_t i = 0; i < order.size(); ++i)
        EXPECT_EQ(part[i], hashes_[static_cast<std::size_t>(order[i])])
            << "environment " << order[i] << " at place " << i;
    }

    [[nodiscard]] std::vector<Offset> identity() const {
      std::vector<Offset> order(hashes_.size());
      std::iota(order.begin(), order.end(), Offset{0});
      return order;
    }

   private:
    ContactBatch<Real> batch_;
    SolverOptions options_;
    std::vector<std::uint64_t> hashes_;
  };

  /// f(whole) for every solver and the fallback chain.
  template <class F>
  static void for_every_solver(const F& f) {
    for (const SolverKind solver : kEveryChoice) {
      SCOPED_TRACE(to_string(solver));
      f(Whole(solver));
    }
  }
};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(EnvOrder, Precisions);

TYPED_TEST(EnvOrder, PermutedEnvironmentsKeepTheirBits) {
  this->for_every_solver([](const auto& whole) {
    for (std::uint64_t seed = 1; seed <= 2; ++seed) {
      auto order = whole.identity();
      scenes::Rng rng(seed);
      for (std::size_t k = order.size(); k > 1; --k)
        std::swap(order[k - 1], order[static_cast<std::size_t>(rng.below(static_cast<int>(k)))]);
      whole.expect_same(order);
    }
  });
}

TYPED_TEST(EnvOrder, SplitBatchesAndBatchesOfOneKeepTheirBits) {
  this->for_every_solver([](const auto& whole) {
    const auto all = whole.identity();
    const auto middle = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 3);
    whole.expect_same({all.begin(), middle});
    whole.expect_same({middle, all.end()});
    for (const Offset env : all) whole.expect_same({env});
  });
}

TYPED_TEST(EnvOrder, MergedAndRepeatedEnvironmentsKeepTheirBits) {
  this->for_every_solver([](const auto& whole) {
    std::vector<Offset> order;
    for (int copy = 0; copy < 3; ++copy)
      for (const Offset env : whole.identity()) order.push_back(env);
    whole.expect_same(order);
  });
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
