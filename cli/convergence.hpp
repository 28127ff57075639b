#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "stiction/batch.hpp"

namespace stiction::cli {

/// 1, 2, 3, 4, 6, 8, 12, 16, 24, ... and `max_iterations` itself: two points an octave.
std::vector<Index> convergence_iterations(Index max_iterations);

/// Residual against iterations as CSV: a line `iteration,median,p90,max` for each of convergence_iterations().
/// `solve_to(k)` gives lambda of a run stopped at k iterations, a prefix of every longer one, bit for bit. verify()
/// recomputes the residual from the file's numbers in f64.
std::string convergence_csv(const ContactBatchView<double>& batch, Index max_iterations,
                            const std::function<std::vector<double>(Index)>& solve_to);

}  // namespace stiction::cli
