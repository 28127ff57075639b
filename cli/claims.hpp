#pragma once

#include "stiction/batch.hpp"
#include "stiction/solver.hpp"

namespace stiction::cli {

/// Holds claims of `solved` against the file's own numbers. A solve in single precision was given rounded ones; where
/// its reactions are not within the tolerance of the file's, the environment's code becomes `rounding`.
void judge_by_file(const ContactBatch<double>& file_batch, const SolverOptions& options, Solution<float>& solution);
inline void judge_by_file(const ContactBatch<double>&, const SolverOptions&, const Solution<double>&) {}

}  // namespace stiction::cli
