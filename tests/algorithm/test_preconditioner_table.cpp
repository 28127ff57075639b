#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <set>
#include <string>
#include <vector>

#include "tests/support/machines/preconditioner_room.hpp"
#include "tests/support/oracles/reference_gradients.hpp"

namespace stiction::test {
namespace {

/// The tables of bench/results/methods.md, each number beside one that does not come from this library. Iterations
/// stand beside those of tests/support/oracles/reference_gradients.hpp, blocks of factors beside an elimination on
/// sets. Every machine counts the same iterations, for they follow from the bits. In short: tables that take seconds
/// without a fused multiply-add instruction.
struct TableRow {
  const char* scene;
  double compliance;
  unsigned sliding;
  std::array<Index, 5> iterations;  ///< in the order of kAllPreconditionings
};
constexpr TableRow kTable[] = {
    {"tower 50", 1e-3, 0, {221, 219, 1, 130, 1}},    {"tower 200", 1e-3, 0, {806, 785, 1, 425, 1}},
    {"wall 10", 1e-3, 0, {223, 198, 59, 99, 1}},     {"wall 30", 1e-3, 0, {1060, 960, 286, 481, 1}},
    {"pyramid 385", 1e-3, 0, {91, 79, 33, 40, 1}},   {"tower 50", 1e-5, 0, {257, 253, 1, 142, 1}},
    {"wall 10", 1e-5, 0, {225, 200, 60, 100, 1}},    {"pyramid 385", 1e-5, 0, {91, 79, 33, 40, 1}},
    {"tower 50", 1e-3, 20, {481, 414, 1, 250, 1}},   {"wall 10", 1e-3, 20, {239, 208, 60, 105, 1}},
    {"pyramid 385", 1e-3, 20, {109, 94, 34, 49, 1}}, {"tower 50", 1e-5, 20, {980, 832, 1, 516, 1}},
    {"wall 10", 1e-5, 20, {245, 211, 62, 107, 1}},   {"pyramid 385", 1e-5, 20, {109, 94, 34, 49, 1}},
};

/// The others, which take minutes there.
constexpr TableRow kLongTable[] = {
    {"tower 200", 1e-5, 0, {1757, 1717, 1, 870, 1}},   {"wall 30", 1e-5, 0, {1265, 1147, 355, 587, 1}},
    {"tower 200", 1e-3, 20, {1325, 995, 1, 553, 1}},   {"wall 30", 1e-3, 20, {991, 797, 241, 413, 1}},
    {"tower 200", 1e-5, 20, {3365, 2118, 1, 1157, 1}}, {"wall 30", 1e-5, 20, {1427, 1123, 346, 576, 1}},
};

BoxScene scene_of(const std::string& name) {
  if (name == "tower 50") return box_tower(50);
  if (name == "tower 200") return box_tower(200);
  if (name == "wall 10") return box_wall(10, 10);
  if (name == "wall 30") return box_wall(30, 30);
  return box_pyramid(10);
}

/// Iterations of the reference. `order` is that of the factorisation; the others do not depend on it.
Index reference_iterations(BlockSystem system, Preconditioning kind, Ordering ordering) {
  using namespace reference;
  const bool is_factor = kind == Preconditioning::incomplete_cholesky || kind == Preconditioning::block_ldl;
  const Rows H = rows_of(system.matrix(), order_rows(system.pattern(), is_factor ? ordering : Ordering::natural));
  // The right-hand side is in the order of bodies, and so is a permuted H's.
  const std::vector<double> b = random_vector(static_cast<Index>(H.size()), 3);
  std::vector<double> permuted = b;
  if (is_factor) {
    const std::vector<Index> order = order_rows(system.pattern(), ordering);
    for (std::size_t k = 0; k < b.size(); ++k) permuted[k] = b[static_cast<std::size_t>(order[k / 6]) * 6 + k % 6];
  }
  const auto iterations = [&](const auto& apply) { return gradient_iterations(H, permuted, 1e-6, 20000, apply); };
  const auto by_factor = [&](const auto& keeps) {
    const Rows L = incomplete_cholesky(H, keeps);
    return iterations([&](const std::vector<double>& r) { return reference::solve(L, r); });
  };
  switch (kind) {
    case Preconditioning::scalar_diagonal:
      return by_factor([](std::size_t i, std::size_t j) { return i == j; });
    case Preconditioning::block_diagonal:
      return by_factor([](std::size_t i, std::size_t j) { return body_of(i) == body_of(j); });
    case Preconditioning::incomplete_cholesky:
      return by_factor([](std::size_t, std::size_t) { return true; });
    case Preconditioning::sparse_inverse: {
      const Rows G = sparse_inverse(H, kInverseRowBlocks);
      return iterations([&](const std::vector<double>& r) { return transposed_product(G, product(G, r)); });
    }
    case Preconditioning::block_ldl:
      return 1;  // H^-1 itself: the first step is the solution
  }
  return -1;
}

/// Gradients lose their directions' conjugacy to rounding, and two programs do so differently. Counts were seen to
/// differ by three in a hundred, five are allowed. (In extended precision the reference takes 790 iterations for the
/// tower of 200 with the scalar diagonal, in double 808.)
void expect_near_reference(Index counted, Index reference, const char* what) {
  EXPECT_LE(std::abs(counted - reference), 1 + reference / 20)
      << what << ": " << counted << ", elsewhere " << reference;
}

void expect_measured(const TableRow& row) {
  SCOPED_TRACE(std::string(row.scene) + ", R = " + std::to_string(row.compliance) + ", sliding " +
               std::to_string(row.sliding));
  BlockSystem system = box_matrix(scene_of(row.scene), row.compliance, row.sliding);
  std::array<Index, 5> iterations{};
  for (std::size_t k = 0; k < iterations.size(); ++k) {
    PreconditionerWorkspace workspace(system, kAllPreconditionings[k]);
    std::vector<double> x;
    const GradientOutcome outcome = workspace.solve(random_vector(workspace.n(), 3), x, 1e-6, 20000);
    EXPECT_TRUE(outcome.is_met);
    iterations[k] = outcome.iterations;
    const Index reference = reference_iterations(system, kAllPreconditionings[k], kDefaultOrdering);
    expect_near_reference(outcome.iterations, reference, name_of(kAllPreconditionings[k]));
    std::printf("%d (%d) ", outcome.iterations, reference);
  }
  std::printf("%s\n", row.scene);
  EXPECT_EQ(iterations, row.iterations) << "bench/results/methods.md says otherwise";
}

TEST(PreconditionerTable, IsWhatIsMeasured) {
  for (const TableRow& row : kTable) expect_measured(row);
}
TEST(PreconditionerTable, DISABLED_IsWhatIsMeasuredInMinutes) {
  for (const TableRow& row : kLongTable) expect_measured(row);
}

/// Only orderings whose algorithm is this library's own.
TEST(PreconditionerTable, IncompleteCholeskyByOrderingIsWhatIsMeasured) {
  const auto iterations = [](const char* scene, Ordering ordering) {
    const BlockSystem system = box_matrix(scene_of(scene), 1e-3);
    PreconditionerWorkspace workspace(system, Preconditioning::incomplete_cholesky, ordering);
    std::vector<double> x;
    const Index counted = workspace.solve(random_vector(workspace.n(), 3), x, 1e-6, 20000).iterations;
    expect_near_reference(counted, reference_iterations(system, Preconditioning::incomplete_cholesky, ordering), scene);
    return counted;
  };
  EXPECT_EQ(iterations("tower 200", Ordering::natural), 1);
  EXPECT_EQ(iterations("wall 30", Ordering::natural), 333);
  EXPECT_EQ(iterations("pyramid 385", Ordering::natural), 34);
}

/// Blocks of L and levels by elimination on sets. Row j's later neighbours become neighbours of each other. A row's
/// level is one above the highest of the rows that its blocks of L need.
std::array<Index, 2> eliminate(const BlockPattern& pattern, const std::vector<Index>& order) {
  const std::size_t n = order.size();
  std::vector<std::size_t> position(n);
  for (std::size_t k = 0; k < n; ++k) position[static_cast<std::size_t>(order[k])] = k;
  std::vector<std::set<std::size_t>> later(n);
  for (Index row = 0; row < pattern.rows; ++row)
    for (Index k = pattern.offsets[row]; k < pattern.offsets[row + 1]; ++k) {
      const std::size_t i = position[static_cast<std::size_t>(row)];
      const std::size_t j = position[static_cast<std::size_t>(pattern.columns[k])];
      if (j > i) later[i].insert(j);
    }
  Index blocks = 0, levels = 0;
  std::vector<Index> level(n, 1);
  for (std::size_t j = 0; j < n; ++j) {
    blocks += 1 + static_cast<Index>(later[j].size());
    levels = std::max(levels, level[j]);
    for (const std::size_t i : later[j]) {
      level[i] = std::max(level[i], level[j] + 1);
      for (const std::size_t other : later[j])
        if (other > i) later[i].insert(other);
    }
  }
  return {blocks, levels};
}

/// Only orderings whose algorithm is this library's own; a library's may change with its version.
TEST(PreconditionerTable, FillIsWhatIsCounted) {
  const auto blocks = [](const char* scene, Ordering ordering) {
    const BlockSystem system = box_matrix(scene_of(scene), 1e-3);
    PreconditionerWorkspace workspace(system, Preconditioning::block_ldl, ordering);
    const std::array<Index, 2> counted{workspace.factor().lower.blocks(), workspace.factor().level_count};
    EXPECT_EQ(counted, eliminate(system.pattern(), order_rows(system.pattern(), ordering))) << scene;
    return counted;
  };
  using Counts = std::array<Index, 2>;
  EXPECT_EQ(blocks("tower 200", Ordering::natural), (Counts{399, 200}));
  EXPECT_EQ(blocks("wall 10", Ordering::natural), (Counts{964, 91}));
  EXPECT_EQ(blocks("wall 30", Ordering::natural), (Counts{26594, 871}));
  EXPECT_EQ(blocks("pyramid 385", Ordering::natural), (Counts{12451, 286}));
  EXPECT_EQ(blocks("tower 200", Ordering::reverse_cuthill_mckee), (Counts{399, 200}));
  EXPECT_EQ(blocks("wall 10", Ordering::reverse_cuthill_mckee), (Counts{593, 92}));
  EXPECT_EQ(blocks("wall 30", Ordering::reverse_cuthill_mckee), (Counts{15568, 872}));
  EXPECT_EQ(blocks("pyramid 385", Ordering::reverse_cuthill_mckee), (Counts{10933, 367}));
}

}  // namespace
}  // namespace stiction::test
