#pragma once

#include <span>
#include <vector>

#include "core/plan/block_factor_plan.hpp"
#include "distributed/solve/part_kernels.hpp"
#include "stiction/ordering.hpp"

namespace stiction::distributed {

/// The factor of some rows of a block matrix, and of the same columns.
class PartFactor {
 public:
  /// `rows` ascending.
  PartFactor(const BlockPattern& whole, std::span<const Index> rows, Ordering ordering);

  /// `blocks`: the whole matrix's, 36 numbers each.
  void prepare(const BlockPattern& whole, double* blocks);
  /// z = (the part)^-1 r, six numbers of each of the part's rows in their order.
  void solve(const double* r, double* z) const;
  [[nodiscard]] Index rows() const { return plan().rows; }
  /// Blocks of the factor.
  [[nodiscard]] Index blocks() const { return plan().lower.blocks(); }

 private:
  [[nodiscard]] BlockFactorView plan() const;

  PartKernels kernels_ = part_kernels();
  std::vector<Index> stream_;
  std::vector<double> values_;
};

}  // namespace stiction::distributed
