#pragma once

#include "core/io/hdf5_in.hpp"
#include "stiction/io.hpp"

namespace stiction::io {

/// Returns the kind of an open file.
FileKind kind_of(const InputFile& file);

/// The readers behind read_batch, one per kind.
Recording read_contact_batch(const InputFile& file);
Recording read_fclib_local(const InputFile& file);
Recording read_fclib_global(const InputFile& file);

Recording read_any(const InputFile& file);
SolutionFile read_solution(const InputFile& file);
CheckpointFile read_checkpoint(const InputFile& file);
CheckpointHead read_checkpoint_head(const InputFile& file);
/// Reads the file that names the parts of a checkpoint; `base`: the name that theirs begin with.
CheckpointParts read_checkpoint_parts(const InputFile& file, std::string& base);
/// Returns true if a file is one.
bool is_in_parts(const InputFile& file);
/// Removes parts of a checkpoint that lie beside it, but for these.
void remove_parts(const std::filesystem::path& path, const CheckpointParts& but);
/// The checksum that a checkpoint was written with.
std::int64_t checksum_of(const InputFile& file);

/// A file's law attribute. Absent: `fallback`, or refused if there is none.
Law read_law(const InputFile& file, std::optional<Law> fallback);

/// Refuses offsets that do not start at 0, decrease, or do not end at `last`.
void check_offsets(const InputFile& file, const std::string& path, const std::vector<Offset>& offsets,
                   std::size_t last);

}  // namespace stiction::io
