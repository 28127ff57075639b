#include <gtest/gtest.h>

#include <numeric>

#include "scenes/body_scenes.hpp"
#include "scenes/rng.hpp"
#include "tests/support/machines/body_methods.hpp"

/// Environments of bodies keep their bits wherever they are, whatever is beside them and however many there are: by
/// every method, with every preconditioner.
namespace stiction::test {
namespace {

std::vector<BodyEnvironment<double>> mixed_environments() {
  std::vector<BodyEnvironment<double>> envs;
  for (std::uint64_t seed = 0; seed < 24; ++seed)
    envs.push_back(random_bodies(seed, 2 + static_cast<Index>(seed % 7), static_cast<Index>(3 * seed % 40)));
  envs.push_back({});
  envs.push_back(scenes::make_body_stack(2, 4));
  envs.push_back(scenes::make_body_pile(1, 120));
  return envs;
}

template <class Real>
class BodyOrder : public testing::Test {
 protected:
  /// Results of a method for all environments, and for any choice of them.
  class Whole {
   public:
    explicit Whole(const BodyMethodCase& method) : options_(method.options()) {
      for (const auto& env : mixed_environments()) envs_.push_back(as<Real>(env));
      batch_ = batch_of<Real>(envs_);
      solution_ = solve_bodies(batch_, {}, options_);
    }

    [[nodiscard]] std::vector<std::size_t> identity() const {
      std::vector<std::size_t> order(envs_.size());
      std::iota(order.begin(), order.end(), std::size_t{0});
      return order;
    }

    void expect_same(const std::vector<std::size_t>& order) const {
      std::vector<BodyEnvironment<Real>> chosen;
      for (const std::size_t env : order) chosen.push_back(envs_[env]);
      const BodyBatch<Real> batch = batch_of<Real>(chosen);
      const BodySolution<Real> solution = solve_bodies(batch, {}, options_);
      for (std::size_t k = 0; k < order.size(); ++k)
        expect_same_bodies(part_of(solution_, batch_.view(), static_cast<Offset>(order[k])),
                           part_of(solution, batch.view(), static_cast<Offset>(k)),
                           "environment " + std::to_string(order[k]) + " at place " + std::to_string(k));
    }

   private:
    BodySolverOptions options_;
    std::vector<BodyEnvironment<Real>> envs_;
    BodyBatch<Real> batch_;
    BodySolution<Real> solution_;
  };

  template <class F>
  static void for_every_method(const F& f) {
    for (const BodyMethodCase& method : every_body_method()) {
      SCOPED_TRACE(method.name());
      f(Whole(method));
    }
  }
};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(BodyOrder, Precisions);

TYPED_TEST(BodyOrder, PermutedEnvironmentsKeepTheirBits) {
  this->for_every_method([](const auto& whole) {
    auto order = whole.identity();
    scenes::Rng rng(17);
    for (std::size_t k = order.size(); k > 1; --k)
      std::swap(order[k - 1], order[static_cast<std::size_t>(rng.below(static_cast<int>(k)))]);
    whole.expect_same(order);
  });
}

TYPED_TEST(BodyOrder, SplitBatchesAndBatchesOfOneKeepTheirBits) {
  this->for_every_method([](const auto& whole) {
    const auto all = whole.identity();
    const auto middle = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 3);
    whole.expect_same({all.begin(), middle});
    whole.expect_same({middle, all.end()});
    for (const std::size_t env : all) whole.expect_same({env});
  });
}

TYPED_TEST(BodyOrder, MergedAndRepeatedEnvironmentsKeepTheirBits) {
  this->for_every_method([](const auto& whole) {
    std::vector<std::size_t> order;
    for (int copy = 0; copy < 3; ++copy)
      for (const std::size_t env : whole.identity()) order.push_back(env);
    whole.expect_same(order);
  });
}

}  // namespace
}  // namespace stiction::test
