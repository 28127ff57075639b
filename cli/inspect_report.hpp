#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cli/features.hpp"
#include "stiction/io.hpp"

namespace stiction::cli {

/// Everything `stiction inspect` prints.
struct InspectReport {
  std::string file, source;
  std::optional<std::int64_t> environment;        ///< the only one analysed, if one was named
  std::optional<std::int64_t> graph_environment;  ///< the one drawn
  io::FileKind kind = io::FileKind::contact_batch;
  Law law = Law::convex;
  bool has_jacobian = false, has_reference = false;
  Features features;
  std::vector<std::string> warnings;
};

/// Broken preconditions, then properties that a solver may find hard.
std::vector<std::string> warnings(const Features& features, const std::vector<Defect>& defects);

std::string to_json(const InspectReport& report);
std::string to_text(const InspectReport& report);

}  // namespace stiction::cli
