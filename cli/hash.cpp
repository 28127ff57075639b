#include <fmt/format.h>

#include "cli/commands.hpp"
#include "cli/hash_rows.hpp"
#include "cli/report.hpp"
#include "stiction/error.hpp"
#include "stiction/hash.hpp"
#include "stiction/io.hpp"

namespace stiction::cli {

std::uint64_t hash_rows(std::span<const double> rows, Precision precision) {
  if (precision == Precision::f64) return hash_bits(rows);
  std::vector<float> narrow;
  narrow.reserve(rows.size());
  for (const double value : rows) narrow.push_back(static_cast<float>(value));
  return hash_bits(std::span<const float>(narrow));
}

int run_hash(const HashArguments& arguments) {
  const io::SolutionFile solution = io::read_solution(arguments.solution);
  const std::span<const double> lambda(solution.lambda);
  if (arguments.per_environment) {
    if (solution.env_row_offsets.empty()) {
      throw Error(ErrorCode::bad_file, fmt::format("{}: without env_row_ptr the rows of an environment are unknown; "
                                                   "hash the file as a whole",
                                                   arguments.solution.string()));
    }
    for (std::size_t env = 0; env + 1 < solution.env_row_offsets.size(); ++env) {
      const auto first = static_cast<std::size_t>(solution.env_row_offsets[env]);
      const auto last = static_cast<std::size_t>(solution.env_row_offsets[env + 1]);
      fmt::print("{} {}\n", env, hex(hash_rows(lambda.subspan(first, last - first), solution.precision)));
    }
  }
  fmt::print("{}\n", hex(hash_rows(lambda, solution.precision)));
  return kExitDone;
}

}  // namespace stiction::cli
