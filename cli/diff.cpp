#include <fmt/format.h>

#include "cli/bits.hpp"
#include "cli/commands.hpp"
#include "stiction/error.hpp"
#include "stiction/io.hpp"

namespace stiction::cli {

namespace {

[[noreturn]] void refuse(const DiffArguments& arguments, const std::string& why) {
  throw Error(ErrorCode::invalid_argument,
              fmt::format("{} and {} cannot be compared: {}", arguments.left.string(), arguments.right.string(), why));
}

/// Returns the offsets of environments in both files; a file without them is read by the other's.
std::vector<Offset> common_offsets(const DiffArguments& arguments, const io::SolutionFile& left,
                                   const io::SolutionFile& right) {
  if (left.lambda.size() != right.lambda.size()) {
    refuse(arguments, fmt::format("{} and {} rows", left.lambda.size(), right.lambda.size()));
  }
  if (left.precision != right.precision) {
    refuse(arguments, fmt::format("{} and {}", to_string(left.precision), to_string(right.precision)));
  }
  const auto& a = left.env_row_offsets;
  const auto& b = right.env_row_offsets;
  if (!a.empty() && !b.empty() && a != b) refuse(arguments, "their environments begin at different rows");
  if (!a.empty()) return a;
  if (!b.empty()) return b;
  return {0, static_cast<Offset>(left.lambda.size())};
}

}  // namespace

int run_diff(const DiffArguments& arguments) {
  const io::SolutionFile left = io::read_solution(arguments.left);
  const io::SolutionFile right = io::read_solution(arguments.right);
  const std::vector<Offset> offsets = common_offsets(arguments, left, right);
  Offset different_envs = 0;
  Offset different_rows = 0;
  for (std::size_t env = 0; env + 1 < offsets.size(); ++env) {
    bool differs = false;
    for (Offset row = offsets[env]; row < offsets[env + 1]; ++row) {
      const double a = left.lambda[static_cast<std::size_t>(row)];
      const double b = right.lambda[static_cast<std::size_t>(row)];
      if (same_bits(a, b)) continue;
      if (different_rows == 0) {
        fmt::print("first difference: environment {}, row {}: {} and {}, {}\n", env, row - offsets[env], a, b,
                   ulps_text(a, b, left.precision));
      }
      ++different_rows;
      differs = true;
    }
    different_envs += differs ? 1 : 0;
  }
  const auto env_count = offsets.size() - 1;
  if (different_rows == 0) {
    fmt::print("identical: {} environments, {} rows\n", env_count, left.lambda.size());
    return kExitDone;
  }
  fmt::print("{} of {} environments differ, in {} of {} rows\n", different_envs, env_count, different_rows,
             left.lambda.size());
  return kExitMissed;
}

}  // namespace stiction::cli
