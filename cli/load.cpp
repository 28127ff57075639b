#include "cli/load.hpp"

#include <fmt/format.h>

#include "stiction/error.hpp"

namespace stiction::cli {

std::optional<Law> law_from_option(const std::string& text) {
  if (text == "file") return std::nullopt;
  for (const Law law : {Law::convex, Law::coulomb}) {
    if (text == to_string(law)) return law;
  }
  throw Error(ErrorCode::invalid_argument, fmt::format("--law {}: expected file, convex or coulomb", text));
}

std::string describe(const std::vector<Defect>& defects) {
  std::string text = defects.front().message;
  if (defects.size() > kDefectLimit) return text + fmt::format(" (and {} or more others)", kDefectLimit);
  if (defects.size() > 1) text += fmt::format(" (and {} more)", defects.size() - 1);
  return text;
}

LoadedBatch load_batch(const std::filesystem::path& path, const std::optional<Law>& law, ValueDefects policy,
                       SolverKind solver) {
  LoadedBatch loaded{io::read_batch(path), {}};
  if (law) loaded.recording.batch.set_law(*law);
  loaded.defects = validate(loaded.recording.batch.view(), kDefectLimit + 1, solver);
  if (loaded.defects.empty()) return loaded;
  // Structural defects come first, so the first one decides.
  if (policy == ValueDefects::refuse || loaded.defects.front().structural) {
    throw Error(ErrorCode::bad_file, fmt::format("{}: {}", path.string(), describe(loaded.defects)));
  }
  return loaded;
}

io::SolutionFile load_solution(const std::filesystem::path& path, const ContactBatch<double>& batch) {
  io::SolutionFile solution = io::read_solution(path);
  if (static_cast<Offset>(solution.lambda.size()) != batch.row_count()) {
    throw Error(ErrorCode::invalid_argument,
                fmt::format("{}: lambda has {} rows but the batch has {}; is it a solution of another batch?",
                            path.string(), solution.lambda.size(), batch.row_count()));
  }
  if (!solution.env_row_offsets.empty() && solution.env_row_offsets != batch.arrays().env_row_offsets) {
    throw Error(
        ErrorCode::invalid_argument,
        fmt::format("{}: env_row_ptr differs from the batch's; is it a solution of another batch?", path.string()));
  }
  return solution;
}

void require_environment(std::int64_t environment, Offset count) {
  if (environment >= 0 && environment < count) return;
  throw Error(ErrorCode::invalid_argument,
              count == 0 ? fmt::format("--env {}: the file has no environments", environment)
                         : fmt::format("--env {}: the file has environments 0 to {}", environment, count - 1));
}

}  // namespace stiction::cli
