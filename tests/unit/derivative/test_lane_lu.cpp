// Matrices factored side by side have the bits of one by one.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "core/algorithm/derivative/mode_slots.hpp"
#include "core/algorithm/linear/dense/dense_lu.hpp"
#include "core/algorithm/linear/dense/lane_lu.hpp"
#include "tests/support/systems/derivative_cases.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

constexpr int kWidth = 4;
using Lanes = Pack<double, kWidth>;

TEST(LaneLu, HasTheBitsOfOneByOne) {
  SerialTeam team;
  for (const Index n : {1, 2, 5, 12, 31}) {
    const Index own[kWidth] = {n, (n + 1) / 2, n,
                               n};  // the second is smaller, the third singular, the fourth not finite
    std::vector<double> matrix[kWidth], side[kWidth], pivots(static_cast<std::size_t>(n));
    const auto size = static_cast<std::size_t>(n);
    std::vector<double> packed(size * size * kWidth, 0.0), right(size * kWidth, 0.0);
    for (int l = 0; l < kWidth; ++l) {
      const auto own_size = static_cast<std::size_t>(own[l]);
      const auto seed = static_cast<std::uint64_t>(10 * n + l);
      matrix[l] = random_numbers<double>(own_size * own_size, seed);
      side[l] = random_numbers<double>(own_size, seed + 1000);
      if (l == 0)  // pivots that several rows could give
        for (double& number : matrix[l]) number = (number < 0.0 ? -1.0 : 1.0) * (abs_(number) < 0.5 ? 1.0 : 2.0);
      if (l == 2)  // its last column is its first, or zero
        for (Index i = 0; i < n; ++i)
          matrix[l][static_cast<std::size_t>((n - 1) * n + i)] = n == 1 ? 0.0 : matrix[l][static_cast<std::size_t>(i)];
      if (l == 3) matrix[l].back() = std::numeric_limits<double>::infinity();
      for (Index j = 0; j < n; ++j)
        for (Index i = 0; i < n; ++i) {
          const bool is_own = i < own[l] && j < own[l];
          packed[static_cast<std::size_t>((j * n + i) * kWidth + l)] =
              is_own ? matrix[l][static_cast<std::size_t>(j * own[l] + i)] : (i == j ? 1.0 : 0.0);
        }
      for (Index i = 0; i < own[l]; ++i)
        right[static_cast<std::size_t>(i * kWidth + l)] = side[l][static_cast<std::size_t>(i)];
    }
    std::vector<Index> exchanged(size * kWidth);
    std::vector<Lanes> K(size * size), v(size);
    for (std::size_t k = 0; k < K.size(); ++k) load_lanes(packed.data() + k * kWidth, K[k]);
    for (std::size_t k = 0; k < v.size(); ++k) load_lanes(right.data() + k * kWidth, v[k]);
    const LaneMatrix<kWidth> all{K.data(), n};
    constexpr double kFloor = 1e-13;
    const auto sound = factor_lane_lu(all, exchanged.data(), Lanes(kFloor));
    solve_lu(team, all, exchanged.data(), v.data());
    for (int l = 0; l < kWidth; ++l) {
      const Index replaced = factor_lu(team, DenseMatrix{matrix[l].data(), own[l]}, pivots.data(), kFloor);
      EXPECT_EQ(replaced == 0, (lane_bits(sound) >> l & 1U) != 0) << n << ", " << l;
      if (l > 0) {
        EXPECT_EQ(replaced == 0, l == 1) << n << ", " << l;
      }
      if (replaced > 0) continue;
      solve_lu(team, DenseMatrix{matrix[l].data(), own[l]}, pivots.data(), side[l].data());
      for (Index i = 0; i < own[l]; ++i) {
        EXPECT_EQ(v[static_cast<std::size_t>(i)].v[l], side[l][static_cast<std::size_t>(i)]) << n << ", " << l;
        EXPECT_EQ(exchanged[static_cast<std::size_t>(i * kWidth + l)],
                  static_cast<Index>(pivots[static_cast<std::size_t>(i)]));
      }
    }
  }
}

TEST(ModeSlots, HaveEveryOrderInThem) {
  scenes::Rng rng(3);
  constexpr Index kMostRows = 60;
  Index taken = 0;
  for (int round = 0; round < 200; ++round) {
    ModeSlots slots;
    std::vector<std::vector<Index>> members;
    for (int member = 0; member < 8; ++member) {
      std::vector<Index> sizes(static_cast<std::size_t>(rng.below(12)));
      for (Index& size : sizes) size = 1 + 2 * rng.below(2) + (rng.below(6) == 0 ? 1 : 0);
      if (slots.take(
              static_cast<Index>(sizes.size()), [&](Index cone) { return sizes[static_cast<std::size_t>(cone)]; },
              kMostRows))
        members.push_back(sizes);
    }
    taken += static_cast<Index>(members.size());
    std::vector<Index> size_at(static_cast<std::size_t>(slots.rows()), 0);
    Index row = 0;
    for (Index run = 0; run < slots.runs(); ++run)
      for (Index k = 0; k < slots.count(run); ++k, row += slots.size(run))
        size_at[static_cast<std::size_t>(row)] = slots.size(run);
    EXPECT_EQ(row, slots.rows());
    EXPECT_LE(row, kMostRows);
    for (const auto& sizes : members) {
      Index next = 0, end = 0;
      slots.for_each_cone(
          static_cast<Index>(sizes.size()), [&](Index cone) { return sizes[static_cast<std::size_t>(cone)]; },
          [&](Index cone, Index first) {
            EXPECT_EQ(cone, next++);
            EXPECT_GE(first, end);
            ASSERT_LT(first, slots.rows());
            EXPECT_EQ(size_at[static_cast<std::size_t>(first)], sizes[static_cast<std::size_t>(cone)]);
            end = first + sizes[static_cast<std::size_t>(cone)];
          });
      EXPECT_EQ(next, static_cast<Index>(sizes.size()));
    }
  }
  EXPECT_GT(taken, 800);
}

}  // namespace
