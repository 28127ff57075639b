#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cli/commands.hpp"
#include "cli/report.hpp"
#include "stiction/io.hpp"

namespace stiction::cli {

/// The part that "I/N" names, of a batch that is not known yet. \throws Error(invalid_argument) unless 0 <= I < N.
std::optional<io::SolutionShard> shard_from_option(const std::optional<std::string>& text);

/// The environments of a part, of so many in the file: as even as can be, as by stiction.distributed.Shard.split.
/// Completes `shard` with the data common to parts of one solution. `warm_start` holds reactions of the whole file, or
/// nothing. \throws Error(io) if the file cannot be read.
std::vector<Offset> describe_shard(const SolveArguments& arguments, const std::vector<double>& warm_start,
                                   Offset environments, const SolveReport& report, io::SolutionShard& shard);

}  // namespace stiction::cli
