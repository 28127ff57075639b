#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "core/algorithm/collision/collide.hpp"

/// Shapes in known or random places, and facts about them by definition alone.
namespace stiction::test {

using Point = Vector3<double>;
using Shape = PlacedShape<double>;

inline Quaternion<double> random_turn(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const double w = normal(random), x = normal(random), y = normal(random), z = normal(random);
  return normalised(Quaternion<double>{w, x, y, z});
}
inline Point random_direction(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const Point p{normal(random), normal(random), normal(random)};
  return scaled(1 / length(p), p);
}

inline Point random_point(std::mt19937_64& random, double size) {
  std::uniform_real_distribution<double> place(-size, size);
  const double x = place(random), y = place(random), z = place(random);
  return {x, y, z};
}

inline Shape shape_of(ShapeKind kind, std::array<double, 3> size, Point centre = {0, 0, 0},
                      Quaternion<double> turn = {1, 0, 0, 0}) {
  return {kind, centre, axes_of(turn), {size[0], size[1], size[2]}};
}

/// The largest coordinate of the shape's points along n.
inline double support(const Shape& shape, const Point& n) {
  const double centre = dot(shape.centre, n);
  const Point c = components(shape.axes, n);
  switch (shape.kind) {
    case ShapeKind::sphere:
      return centre + shape.size[0];
    case ShapeKind::capsule:
      return centre + shape.size[0] + shape.size[1] * std::abs(c.z);
    case ShapeKind::box:
      return centre + shape.size[0] * std::abs(c.x) + shape.size[1] * std::abs(c.y) + shape.size[2] * std::abs(c.z);
    case ShapeKind::plane:
      break;
  }
  return c.z > 1 - 1e-12 ? centre : HUGE_VAL;
}

/// Distance of b beyond a along n; negative where they overlap.
inline double gap_along(const Shape& a, const Shape& b, const Point& n) {
  return -support(b, scaled(-1.0, n)) - support(a, n);
}

/// The distance of two convex shapes, or minus the shortest translation that parts them: the largest gap along any
/// direction. Found by trying directions all over the sphere and then ever nearer to the best.
inline double signed_distance(const Shape& a, const Shape& b) {
  constexpr int kDirections = 600;
  constexpr int kStarts = 4;
  std::array<std::pair<double, Point>, kStarts> best;
  best.fill({-HUGE_VAL, {0, 0, 1}});
  for (int k = 0; k < kDirections; ++k) {
    const double z = 1 - (2 * k + 1.0) / kDirections, r = std::sqrt(1 - z * z), turn = 2.399963229728653 * k;
    const Point n{r * std::cos(turn), r * std::sin(turn), z};
    const double gap = gap_along(a, b, n);
    std::size_t worst = 0;
    for (std::size_t j = 1; j < kStarts; ++j)
      if (best[j].first < best[worst].first) worst = j;
    if (gap > best[worst].first) best[worst] = {gap, n};
  }
  double largest = -HUGE_VAL;
  for (auto [gap, n] : best) {
    std::mt19937_64 random(7);
    for (double step = 0.1; step > 1e-9; step *= 0.7)
      for (int k = 0; k < 24; ++k) {
        Point tried = add_scaled(n, step, random_direction(random));
        tried = scaled(1 / length(tried), tried);
        if (const double there = gap_along(a, b, tried); there > gap) gap = there, n = tried;
      }
    largest = std::max(largest, gap);
  }
  return largest;
}

/// Distance of a point from a shape's surface, positive outside.
inline double distance_to_surface(const Shape& shape, const Point& p) {
  const Point c = components(shape.axes, subtract(p, shape.centre));
  if (shape.kind == ShapeKind::plane) return c.z;
  if (shape.kind == ShapeKind::sphere) return length(c) - shape.size[0];
  if (shape.kind == ShapeKind::capsule) {
    const double along = std::clamp(c.z, -shape.size[1], shape.size[1]);
    return std::sqrt(c.x * c.x + c.y * c.y + (c.z - along) * (c.z - along)) - shape.size[0];
  }
  const double x = std::abs(c.x) - shape.size[0], y = std::abs(c.y) - shape.size[1], z = std::abs(c.z) - shape.size[2];
  const double outside = std::hypot(std::max(x, 0.0), std::max(y, 0.0), std::max(z, 0.0));
  return outside > 0 ? outside : std::max({x, y, z});
}

inline ContactCandidate<double> deepest_point(const Manifold<double>& found) {
  return *std::max_element(found.at, found.at + found.count,
                           [](const auto& one, const auto& other) { return one.depth < other.depth; });
}
inline double deepest(const Manifold<double>& found) {
  return deepest_point(found).depth;
}

}  // namespace stiction::test
