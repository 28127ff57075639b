#pragma once

#include <optional>
#include <string>

#include "stiction/jacobian.hpp"

/// Recorded batches of J and M in a form that needs no HDF5 to read (pack_batches.cpp writes it).
namespace stiction::gpu_first {

/// The batch of `folder`/`name`.batch; nothing if there is none. \throws Error(io) if the file is another or damaged.
std::optional<JacobianBatch<float>> read_recorded(const std::string& folder, const std::string& name);
/// \throws Error(io) if the file cannot be written.
void write_recorded(const std::string& path, const JacobianBatch<float>& batch);

/// The batch's environments in turn, until there are so many.
JacobianBatch<float> repeated(const JacobianBatch<float>& batch, Offset envs);

}  // namespace stiction::gpu_first
