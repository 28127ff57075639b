#pragma once

#include <string>
#include <vector>

#include "bench/support/contact_batch.hpp"

namespace stiction::bench {

/// One environment of three-row contacts as a baseline reads it, and where it writes.
template <class Real>
struct BaselineTask {
  Index n;                    ///< rows, a multiple of three
  const Offset* row_offsets;  ///< CSR rows of A, offsets into the batch (n + 1)
  const Index* column;        ///< CSR columns, the whole batch          (nnz)
  const Real* A;              ///< CSR values, the whole batch           (nnz)
  const Real *b, *R, *mu;     ///< as in ContactBatchView                (n)
  Real* lambda;               ///< reactions, out                        (n)
  Real* scratch;              ///< n * n + 4 * n numbers
};

/// One environment from the batch's arrays to lambda, by a fixed number of sweeps from zero.
template <class Real>
using Baseline = void (*)(const BaselineTask<Real>& task, int sweeps);

/// A baseline with its name and the flags it was compiled with.
struct BaselineInfo {
  std::string name;   ///< naive, naive_csr, eigen
  std::string flags;  ///< "-O3", "-O3 -march=native", ...
  Baseline<float> f32;
  Baseline<double> f64;
};

/// All there are; the first is the naive scalar loop with the project's own optimisation flags.
const std::vector<BaselineInfo>& baselines();

/// The baseline over every environment of the batch, one after the other.
template <class Real>
void run_baseline(Baseline<Real> baseline, const ContactBatch<Real>& batch, int sweeps, std::vector<Real>& lambda);

}  // namespace stiction::bench
