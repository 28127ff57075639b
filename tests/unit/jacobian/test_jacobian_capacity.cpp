#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "stiction/jacobian_solver.hpp"

namespace {

using namespace stiction;

/// docs/howto/jacobian.md: a factor is kept above 72 rows, if they are more than four times the degrees of freedom.
bool is_kept_as_factor(FactorUse use, Offset rows, Offset dofs) {
  if (rows == 0 || dofs == 0 || use == FactorUse::never) return false;
  return use == FactorUse::always || (rows > 72 && 4 * dofs < rows);
}

TEST(JacobianCapacity, OfTheLargestHoldsWhateverIsSmaller) {
  for (const FactorUse use : {FactorUse::never, FactorUse::by_size, FactorUse::always})
    for (const Index rows : {0, 1, 72, 73, 77, 120})
      for (const Index dofs : {0, 1, 17, 18, 19, 30, 40}) {
        Offset matrix = 0, factor = 0;
        for (Offset n = 0; n <= rows; ++n)
          if (!is_kept_as_factor(use, n, dofs)) matrix = std::max(matrix, n * n);
        for (Offset k = 1; k <= dofs; ++k)
          if (is_kept_as_factor(use, rows, k)) factor = std::max(factor, rows * k);
        const auto capacity = JacobianCapacity::of_largest(3, rows, 1, dofs, use);
        EXPECT_EQ(capacity.matrix, 3 * matrix) << rows << " rows, " << dofs << " dofs";
        EXPECT_EQ(capacity.factor, 3 * factor) << rows << " rows, " << dofs << " dofs";
      }
}

// Found by fuzz_c_api: it took a minute of counting down.
TEST(JacobianCapacity, OfBillionsOfRowsIsKnownAtOnce) {
  constexpr Index kMost = std::numeric_limits<Index>::max();
  EXPECT_EQ(JacobianCapacity::of_largest(1, kMost, 1, 20).matrix, 80 * 80);
  EXPECT_EQ(JacobianCapacity::of_largest(1, 100, 1, kMost).factor, 100 * 24);
}

}  // namespace
