#include "cli/convergence.hpp"

#include <fmt/format.h>

#include <span>

#include "cli/quantiles.hpp"
#include "stiction/residual.hpp"

namespace stiction::cli {

std::vector<Index> convergence_iterations(Index max_iterations) {
  std::vector<Index> points;
  for (std::int64_t octave = 1; octave <= max_iterations; octave *= 2) {
    points.push_back(static_cast<Index>(octave));
    const std::int64_t between = octave + octave / 2;
    if (octave > 1 && between <= max_iterations) points.push_back(static_cast<Index>(between));
  }
  if (!points.empty() && points.back() != max_iterations) points.push_back(max_iterations);
  return points;
}

std::string convergence_csv(const ContactBatchView<double>& batch, Index max_iterations,
                            const std::function<std::vector<double>(Index)>& solve_to) {
  std::string csv = "iteration,median,p90,max\n";
  for (const Index iteration : convergence_iterations(max_iterations)) {
    const std::vector<double> lambda = solve_to(iteration);
    std::vector<double> relative;
    for (const Residual& residual : verify(batch, std::span<const double>(lambda)))
      relative.push_back(residual.relative);
    if (const auto values = quantiles(std::move(relative))) {
      csv += fmt::format("{},{:.6e},{:.6e},{:.6e}\n", iteration, values->median, values->p90, values->max);
    }
  }
  return csv;
}

}  // namespace stiction::cli
