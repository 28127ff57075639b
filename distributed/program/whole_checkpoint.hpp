#pragma once

#include <filesystem>

#include "distributed/transport/transport.hpp"
#include "distributed/world/bodies.hpp"
#include "stiction/io.hpp"

namespace stiction::distributed {

/// Writes the checkpoint of one process, by all ranks together: one file, which no rank holds. `own` is the argument
/// of write_checkpoint_part(): the bodies of `share`, of `bodies` in each environment, and their contacts.
/// \throws Error(io), Error(unsupported) without parallel HDF5, RankLost
void write_whole_checkpoint(Transport& transport, const std::filesystem::path& path, const io::CheckpointFile& own,
                            const BodyRange& share, Index bodies);

}  // namespace stiction::distributed
