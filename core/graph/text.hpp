#pragma once

#include <string>

#include "stiction/types.hpp"

namespace stiction::graph {

/// A number with so many digits after the point, whatever the locale.
std::string fixed_text(double value, int digits);
/// "1 body", "2 bodies".
std::string counted(Offset count, const char* one, const char* many);
/// Text between quotes in DOT.
std::string escape_dot(const std::string& text);
/// Text between tags or quotes in XML.
std::string escape_xml(const std::string& text);
/// "#rrggbb" of a colour of the graph: ten distinct ones, then hues a golden ratio apart.
std::string color_hex(Index color);

}  // namespace stiction::graph
