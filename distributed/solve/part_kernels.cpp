// Compiled once for each instruction set, in a namespace of its own.
#include "distributed/solve/part_kernels.hpp"

#include "core/algorithm/linear/block/block_ldl.hpp"

namespace stiction::inline STICTION_ISA {

distributed::PartKernels part_kernels_of_isa() {
  return {[](const BlockFactorView& plan, const BlockPattern& pattern, double* blocks, double* values) {
            SerialTeam alone;
            factor_levels(alone, plan, BlockMatrix{pattern, blocks}, 0.0, values);
          },
          [](const BlockFactorView& plan, const double* values, const double* r, double* z) {
            SerialTeam alone;
            solve_levels(alone, plan, values, r, z);
          },
          [](const BlockPattern& pattern, double* blocks, std::span<const Index> rows, const double* x, double* y) {
            const BlockMatrix A{pattern, blocks};
            for (const Index row : rows) {
              double sum[kBodyBlock] = {};
              multiply_row(A, row, x, sum);
              for (Index i = 0; i < kBodyBlock; ++i) y[static_cast<Offset>(row) * kBodyBlock + i] = sum[i];
            }
          }};
}

}  // namespace stiction::inline STICTION_ISA
