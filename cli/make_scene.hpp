#pragma once

#include "cli/commands.hpp"
#include "stiction/io.hpp"

namespace stiction::cli {

/// The batch that `stiction generate` writes. \throws Error(invalid_argument) for a scene or a size that is not there.
io::Recording make_scene(const GenerateArguments& arguments);

}  // namespace stiction::cli
