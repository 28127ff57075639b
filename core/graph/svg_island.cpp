#include "core/graph/svg_island.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/graph/slots.hpp"
#include "core/graph/text.hpp"

namespace stiction::graph {
namespace {

constexpr double kHeading = 24;  // height of the line that names an island
constexpr double kMargin = 14;

/// Sixteen directions, straight down first.
constexpr double kC1 = 0.9238795325112867, kC2 = 0.7071067811865476, kC3 = 0.3826834323650898;
constexpr std::array<Point, 16> kDirections{{{0, 1},
                                             {kC3, kC1},
                                             {-kC3, kC1},
                                             {kC2, kC2},
                                             {-kC2, kC2},
                                             {kC1, kC3},
                                             {-kC1, kC3},
                                             {1, 0},
                                             {-1, 0},
                                             {kC1, -kC3},
                                             {-kC1, -kC3},
                                             {kC2, -kC2},
                                             {-kC2, -kC2},
                                             {kC3, -kC1},
                                             {-kC3, -kC1},
                                             {0, -1}}};

Point along(Point from, Point direction, double length) {
  return {from.x + length * direction.x, from.y + length * direction.y};
}

/// The direction farthest from all that are taken, with a leaning towards down.
Point free_direction(const std::vector<Point>& taken) {
  Point best = kDirections[0];
  double least = 9;
  for (const Point& direction : kDirections) {
    double nearest = -1;
    for (const Point& other : taken) nearest = std::max(nearest, direction.x * other.x + direction.y * other.y);
    const double cost = nearest - 0.3 * direction.y;
    if (cost < least - 1e-6) {
      least = cost;
      best = direction;
    }
  }
  return best;
}

std::string edge_words(const std::string& from, const std::string& to, Index contact_count, Index color) {
  return from + " - " + to + ": " + counted(contact_count, "contact", "contacts") + ", colour " + std::to_string(color);
}

}  // namespace

DrawingScale scale_for(std::size_t bodies_of_largest_island) {
  if (bodies_of_largest_island <= 40) return {60, 12};
  if (bodies_of_largest_island <= 150) return {46, 10};
  if (bodies_of_largest_island <= 600) return {30, 7};
  return {18, 4};
}

double edge_width(Index contact_count) {
  return 1.2 + 1.1 * std::min<Index>(contact_count, 6);
}

void draw_hatching(SvgText& svg, Point at, Point direction, const std::string& color) {
  const Point across{-direction.y, direction.x};
  svg.line(along(at, across, -8), along(at, across, 8), color, 2);
  for (const double step : {-6.0, -1.0, 4.0}) {
    const Point foot = along(at, across, step);
    svg.line(foot, along(along(foot, direction, 5), across, 4), color, 1);
  }
}

IslandDrawing::IslandDrawing(const IslandEdges& island, const DrawingScale& scale)
    : island_(island), scale_(scale), points_(place_bodies(island)) {
  Point low = points_.front(), high = low;
  for (const Point& p : points_) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y)};
  }
  const double room = kMargin + scale_.radius + (island.ground.empty() ? 0 : 0.5 * scale_.unit);
  const double heading_width = 6.2 * (island.bodies.size() == 1 ? 12 : 34);
  const double width = scale_.unit * (high.x - low.x) + 2 * room;
  size_ = {std::max(width, heading_width), scale_.unit * (high.y - low.y) + 2 * room + kHeading};
  for (Point& p : points_)
    p = {scale_.unit * (p.x - low.x) + room + 0.5 * (size_.x - width), scale_.unit * (p.y - low.y) + room + kHeading};
}

void IslandDrawing::draw_edges(SvgText& svg, Point corner) const {
  for (const LocalEdge& edge : island_.edges) {
    const Point a = points_[at(edge.a)], b = points_[at(edge.b)];
    svg.begin_group(edge_words(std::to_string(island_.bodies[at(edge.a)]), std::to_string(island_.bodies[at(edge.b)]),
                               edge.contact_count, edge.color));
    svg.line(along(corner, a, 1), along(corner, b, 1), color_hex(edge.color), edge_width(edge.contact_count));
    if (edge.contact_count > 1 && scale_.radius >= 10) {
      const Point middle{corner.x + 0.5 * (a.x + b.x), corner.y + 0.5 * (a.y + b.y)};
      svg.circle(middle, 6.5, "#ffffff", color_hex(edge.color));
      svg.text({middle.x, middle.y + 3.2}, 9, "middle", kInk, std::to_string(edge.contact_count));
    }
    svg.end_group();
  }
}

void IslandDrawing::draw_ground(SvgText& svg, Point corner) const {
  std::vector<std::vector<Point>> taken(points_.size());
  for (const LocalEdge& edge : island_.edges) {
    const Point a = points_[at(edge.a)], b = points_[at(edge.b)];
    const double length = std::sqrt((b.x - a.x) * (b.x - a.x) + (b.y - a.y) * (b.y - a.y)) + 1e-9;
    const Point direction{(b.x - a.x) / length, (b.y - a.y) / length};
    taken[at(edge.a)].push_back(direction);
    taken[at(edge.b)].push_back({-direction.x, -direction.y});
  }
  for (const FixedEdge& edge : island_.ground) {
    const Point direction = free_direction(taken[at(edge.a)]);
    taken[at(edge.a)].push_back(direction);
    const Point from = along(corner, points_[at(edge.a)], 1);
    const Point foot = along(from, direction, scale_.radius + 0.3 * scale_.unit);
    const std::string name = edge.fixed_body == kWorldBody ? "world" : "fixed body " + std::to_string(edge.fixed_body);
    svg.begin_group(edge_words(std::to_string(island_.bodies[at(edge.a)]), name, edge.contact_count, edge.color));
    svg.line(from, foot, color_hex(edge.color), edge_width(edge.contact_count));
    draw_hatching(svg, foot, direction, kPale);
    svg.end_group();
  }
}

void IslandDrawing::draw(SvgText& svg, Point corner) const {
  svg.rect(corner, size_, 8, "#f6f7f9", "#cfd4db");
  const std::string name = "island " + std::to_string(island_.bodies.front());
  svg.text({corner.x + 10, corner.y + 17}, 11, "start", kPale,
           island_.bodies.size() == 1 ? name
                                      : name + ": " + std::to_string(island_.bodies.size()) + " bodies, " +
                                            counted(island_.contact_count, "contact", "contacts"));
  draw_edges(svg, corner);
  draw_ground(svg, corner);
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Point centre = along(corner, points_[i], 1);
    const std::string name_of_body = std::to_string(island_.bodies[i]);
    svg.begin_group("body " + name_of_body);
    svg.circle(centre, scale_.radius, "#ffffff", kInk);
    const double letter = name_of_body.size() > 3 ? 0.6 * scale_.radius : 0.85 * scale_.radius;
    if (scale_.radius >= 7) svg.text({centre.x, centre.y + 0.35 * letter}, letter, "middle", kInk, name_of_body);
    svg.end_group();
  }
}

}  // namespace stiction::graph
