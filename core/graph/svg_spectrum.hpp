#pragma once

#include <vector>

#include "core/graph/svg_text.hpp"

namespace stiction::graph {

/// Eigenvalues in ascending order against their number; the first `zero_count` are zero but for rounding. Draws a box.
void draw_spectrum(SvgText& svg, Point corner, Point size, const std::vector<double>& spectrum, Offset zero_count);

}  // namespace stiction::graph
