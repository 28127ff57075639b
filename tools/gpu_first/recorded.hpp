#pragma once

#include <optional>
#include <string>

#include "stiction/batch.hpp"

/// Recorded batches in a form that needs no HDF5 to read (pack_batches.cpp writes it).
namespace stiction::gpu_first {

/// Names of the batches that are timed, as the recordings have them.
inline constexpr const char* kRecorded[] = {"humanoid", "g1", "go1", "leap_hand", "franka_cube"};

/// The batch of `folder`/`name`.batch; nothing if there is none. \throws Error(io) if the file is another or damaged.
std::optional<ContactBatch<float>> read_recorded(const std::string& folder, const std::string& name);
/// \throws Error(io) if the file cannot be written.
void write_recorded(const std::string& path, const ContactBatch<float>& batch);

}  // namespace stiction::gpu_first
