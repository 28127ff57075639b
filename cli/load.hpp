#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "stiction/io.hpp"

namespace stiction::cli {

/// "file" (empty result), "convex" or "coulomb". \throws Error(invalid_argument).
std::optional<Law> law_from_option(const std::string& text);

/// The defects of a batch that is about to be used; at most `limit`.
inline constexpr std::size_t kDefectLimit = 1000;

/// "first sentence (and 3 more)".
std::string describe(const std::vector<Defect>& defects);

/// Treatment of numbers that break a precondition, in load_batch. Broken structure is always refused.
enum class ValueDefects { refuse, keep };

struct LoadedBatch {
  io::Recording recording;
  std::vector<Defect> defects;  ///< value defects that were kept
};

/// Reads a contact-batch or FCLIB file, applies a law other than the file's if one is given, and validates it for a
/// solver.
/// \throws Error with one sentence that begins with the file's name.
LoadedBatch load_batch(const std::filesystem::path& path, const std::optional<Law>& law, ValueDefects policy,
                       SolverKind solver = SolverKind::npgs);

/// Reads a solution and makes sure that it belongs to a batch of these rows and environments.
/// \throws Error(invalid_argument) if it does not.
io::SolutionFile load_solution(const std::filesystem::path& path, const ContactBatch<double>& batch);

/// Throws unless `environment` is one of `count`.
void require_environment(std::int64_t environment, Offset count);

}  // namespace stiction::cli
