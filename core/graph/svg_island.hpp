#pragma once

#include <vector>

#include "core/graph/svg_text.hpp"

namespace stiction::graph {

/// Measures that all islands of a picture share [px].
struct DrawingScale {
  double unit = 60;    ///< between neighbours
  double radius = 12;  ///< of a body
};

/// Wide enough for the bodies of a large island not to fill a wall.
DrawingScale scale_for(std::size_t bodies_of_largest_island);

/// An island in its box.
class IslandDrawing {
 public:
  IslandDrawing(const IslandEdges& island, const DrawingScale& scale);
  [[nodiscard]] Point size() const { return size_; }
  void draw(SvgText& svg, Point corner) const;

 private:
  void draw_edges(SvgText& svg, Point corner) const;
  void draw_ground(SvgText& svg, Point corner) const;

  const IslandEdges& island_;
  DrawingScale scale_;
  std::vector<Point> points_;  ///< centres of the bodies, from the corner of the box
  Point size_;
};

/// Width of an edge of so many contacts.
double edge_width(Index contact_count);
/// Hatched ground where a line that comes from `direction` ends.
void draw_hatching(SvgText& svg, Point at, Point direction, const std::string& color);

}  // namespace stiction::graph
