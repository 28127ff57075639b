#pragma once

#include <span>

#include "core/job/block_factor_view.hpp"

namespace stiction::distributed {

/// Kernels that take the time in linear systems over subdomains, compiled for one instruction set; all give the same
/// bits. A matrix is a pattern and its blocks of 36 numbers.
struct PartKernels {
  void (*factor)(const BlockFactorView& plan, const BlockPattern& pattern, double* blocks, double* values);
  void (*solve)(const BlockFactorView& plan, const double* values, const double* r, double* z);
  /// y = A x in those rows.
  void (*multiply)(const BlockPattern& pattern, double* blocks, std::span<const Index> rows, const double* x,
                   double* y);
};

/// Returns the kernels of the widest instruction set that the CPU runs.
PartKernels part_kernels();

}  // namespace stiction::distributed
