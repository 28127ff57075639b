#pragma once

#include <filesystem>
#include <string>

namespace stiction::cli {

/// Writes DOT text to `path`: as it is for .dot and .gv, drawn by Graphviz for .svg. `clusters` says that the boxes
/// around subgraphs matter, else the layout that shows the structure of a mesh best is taken. \throws
/// Error(invalid_argument) for another extension, Error(unsupported) when Graphviz is not installed, Error(io) when it
/// fails.
void write_graph(const std::filesystem::path& path, const std::string& dot, bool clusters);

/// Refuses extensions that write_graph would refuse, before any work is done.
void require_graph_path(const std::filesystem::path& path);

}  // namespace stiction::cli
