#include "core/team/reduce.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "scenes/rng.hpp"

namespace {

using namespace stiction;

/// One lane of a block of `size` whose lanes run one after the other. It has that lane's arithmetic and shares memory
/// with the others. Enough for code that ends in one sync.
struct SequentialLane {
  static constexpr Index kRowTile = 1;
  Index lane, count;
  double* memory;
  [[nodiscard]] Index rank() const { return lane; }
  [[nodiscard]] Index size() const { return count; }
  void sync() const {}
  template <class F>
  auto broadcast(F&& f) const {
    return f();
  }
  [[nodiscard]] std::uint32_t combine(std::uint32_t bits) const { return bits; }
  template <class T>
  T max(T value) const {
    return value;
  }
  template <class T>
  [[nodiscard]] T* leaves() const {
    return memory;
  }
};
static_assert(Team<SequentialLane>);
static_assert(Team<SerialTeam>);

TEST(BlockReduce, LeavesAreFoldedOverATreeOfFixedShape) {
  // 1e16 + 1 = 1e16 in double: the order shows. Leaf 0 and leaf 16 meet first.
  std::vector<double> leaf(kReduceLeaves, 0.0);
  leaf[0] = 1e16;
  leaf[16] = -1e16;
  leaf[1] = 1.0;
  EXPECT_EQ(fold_leaves(leaf.data()), 1.0);
  leaf.assign(kReduceLeaves, 0.0);
  leaf[0] = 1e16;
  leaf[16] = 1.0;
  leaf[1] = -1e16;
  EXPECT_EQ(fold_leaves(leaf.data()), 0.0) << "the 1 is absorbed by its partner";
}

TEST(BlockReduce, TheSumHasTheSameBitsForEveryNumberOfLanes) {
  scenes::Rng rng(5);
  std::vector<double> terms(997);
  for (double& term : terms) term = rng.symmetric(1.0) * (rng.chance(0.1) ? 1e8 : 1.0);
  const auto leaf = [&](Index l) {
    double sum = 0.0;
    for (std::size_t i = static_cast<std::size_t>(l); i < terms.size(); i += kReduceLeaves) sum += terms[i];
    return sum;
  };
  SerialTeam serial;
  const double expected = sum_leaves<double>(serial, leaf);
  for (const Index size : {2, 3, 8, 16, 32, 33}) {
    // Runs lanes one after the other on shared leaves. The fold destroys them, so the last lane's answer counts, and
    // the writes of the lanes before it are put back for it.
    double shared[kReduceLeaves] = {};
    double result = 0.0;
    for (Index lane = 0; lane < size; ++lane) {
      double before[kReduceLeaves];
      std::copy(shared, shared + kReduceLeaves, before);
      SequentialLane block{lane, size, shared};
      result = sum_leaves<double>(block, leaf);
      std::copy(before, before + kReduceLeaves, shared);
      for (Index l = lane; l < kReduceLeaves; l += size) shared[l] = leaf(l);
    }
    EXPECT_EQ(result, expected) << size << " lanes";
  }
}

TEST(BlockReduce, TheLargestOfNothingIsZero) {
  SerialTeam serial;
  EXPECT_EQ(max_over<double>(serial, 0, [](Index) { return 5.0; }), 0.0);
  EXPECT_EQ(max_over<double>(serial, 3, [](Index i) { return static_cast<double>(i) - 10.0; }), 0.0);
  EXPECT_EQ(max_over<double>(serial, 4, [](Index i) { return static_cast<double>(i % 3); }), 2.0);
}

TEST(BlockReduce, ForEachVisitsEveryIndexOnceWhateverTheNumberOfLanes) {
  for (const Index size : {1, 2, 7, 16}) {
    std::vector<int> visits(50, 0);
    for (Index lane = 0; lane < size; ++lane) {
      SequentialLane block{lane, size, nullptr};
      for_each(block, 50, [&](Index i) { ++visits[static_cast<std::size_t>(i)]; });
    }
    EXPECT_EQ(visits, std::vector<int>(50, 1)) << size << " lanes";
  }
}

TEST(BlockReduce, OneLaneDoesWhatIsSingle) {
  int calls = 0;
  for (Index lane = 0; lane < 5; ++lane) {
    SequentialLane block{lane, 5, nullptr};
    single(block, [&] { ++calls; });
  }
  EXPECT_EQ(calls, 1);
}

}  // namespace
