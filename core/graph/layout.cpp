#include "core/graph/layout.hpp"

#include <cmath>
#include <cstdint>

#include "core/graph/slots.hpp"

namespace stiction::graph {
namespace {

using Vector = std::vector<double>;
using Neighbours = std::vector<std::vector<std::size_t>>;

Neighbours neighbours_of(const IslandEdges& island) {
  Neighbours neighbours(island.bodies.size());
  for (const LocalEdge& edge : island.edges) {
    neighbours[at(edge.a)].push_back(at(edge.b));
    neighbours[at(edge.b)].push_back(at(edge.a));
  }
  return neighbours;
}

/// Bodies in the order in which a search from `start` reaches them; distance[i] is the number of edges to i.
std::vector<std::size_t> breadth_first(const Neighbours& neighbours, std::size_t start, double* distance) {
  std::vector<bool> reached(neighbours.size(), false);
  std::vector<std::size_t> order(1, start);
  reached[start] = true;
  distance[start] = 0;
  for (std::size_t head = 0; head < order.size(); ++head) {
    for (const std::size_t other : neighbours[order[head]]) {
      if (reached[other]) continue;
      reached[other] = true;
      distance[other] = distance[order[head]] + 1;
      order.push_back(other);
    }
  }
  return order;
}

/// Vogel's (1979) spiral: each body a golden angle further, at a radius that leaves each the same area.
std::vector<Point> spiral(const Neighbours& neighbours) {
  constexpr Point kGoldenAngle{-0.7373688780783197, 0.6754902942615238};  // cosine and sine
  Vector distance(neighbours.size());
  std::vector<Point> points(neighbours.size());
  Point turn{1, 0};
  double count = 0;
  for (const std::size_t body : breadth_first(neighbours, 0, distance.data())) {
    const double radius = 0.7 * std::sqrt(count++);
    points[body] = {radius * turn.x, radius * turn.y};
    turn = {turn.x * kGoldenAngle.x - turn.y * kGoldenAngle.y, turn.x * kGoldenAngle.y + turn.y * kGoldenAngle.x};
  }
  return points;
}

/// All distances in edges (row-major).
Vector all_distances(const Neighbours& neighbours) {
  const std::size_t n = neighbours.size();
  Vector distance(n * n);
  for (std::size_t i = 0; i < n; ++i) breadth_first(neighbours, i, distance.data() + i * n);
  return distance;
}

/// Numbers in [-1, 1) without structure, the same in every run.
Vector start_vector(std::size_t n) {
  Vector x(n);
  std::uint64_t state = 0x9e3779b97f4a7c15U;
  for (double& value : x) {
    state = state * 6364136223846793005U + 1442695040888963407U;
    value = static_cast<double>(state >> 11) * 0x1p-52 - 1;
  }
  return x;
}

double dot(const Vector& x, const Vector& y) {
  double sum = 0;
  for (std::size_t i = 0; i < x.size(); ++i) sum += x[i] * y[i];
  return sum;
}

void remove_share(Vector& x, const Vector& unit) {
  const double share = dot(x, unit);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] -= share * unit[i];
}

/// Classical scaling (Torgerson 1952): the two leading eigenvectors of the doubly centred squared distances, by power
/// iteration. The first is the longest extent, so drawings lie on their long side.
std::vector<Point> classical_scaling(const Vector& distance, std::size_t n) {
  const Vector ones(n, 1 / std::sqrt(static_cast<double>(n)));
  std::vector<Vector> found{ones};
  std::vector<double> extent{0};
  for (int axis = 0; axis < 2; ++axis) {
    Vector x = start_vector(n);
    double length = 0;
    for (int round = 0; round < 60; ++round) {
      for (const Vector& unit : found) remove_share(x, unit);
      const double norm = std::sqrt(dot(x, x));
      if (!(norm > 1e-12)) break;
      for (double& value : x) value /= norm;
      Vector image(n, 0);
      for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t j = 0; j < n; ++j) image[i] -= 0.5 * distance[i * n + j] * distance[i * n + j] * x[j];
      }
      remove_share(image, ones);
      length = dot(x, image);
      if (round < 59) x = image;
    }
    found.push_back(x);
    extent.push_back(length > 0 ? std::sqrt(length) : 0);
  }
  std::vector<Point> points(n);
  const Vector jitter = start_vector(n);  // lifts bodies off one another and off a line they could not leave
  for (std::size_t i = 0; i < n; ++i)
    points[i] = {extent[1] * found[1][i] + 0.01 * jitter[i], extent[2] * found[2][i] + 0.01 * jitter[n - 1 - i]};
  return points;
}

/// Moves each body to where its springs to all others would on average have it. A spring has natural length d and
/// stiffness 1 / d^2 (stress majorisation, one body at a time).
void relax(std::vector<Point>& points, const Vector& distance) {
  const std::size_t n = points.size();
  for (int round = 0; round < 80; ++round) {
    for (std::size_t i = 0; i < n; ++i) {
      Point sum;
      double weights = 0;
      for (std::size_t j = 0; j < n; ++j) {
        if (i == j) continue;
        const double wanted = distance[i * n + j];
        const double dx = points[i].x - points[j].x, dy = points[i].y - points[j].y;
        const double length = std::sqrt(dx * dx + dy * dy);
        const double stretch = length > 1e-9 ? wanted / length : 0;
        const double weight = 1 / (wanted * wanted);
        sum.x += weight * (points[j].x + stretch * dx);
        sum.y += weight * (points[j].y + stretch * dy);
        weights += weight;
      }
      points[i] = {sum.x / weights, sum.y / weights};
    }
  }
}

/// Turns the drawing so that the bodies that touch something fixed lie below the others, if they lie to one side.
void turn_ground_down(std::vector<Point>& points, const IslandEdges& island) {
  Point middle, ground;
  for (const Point& p : points) middle = {middle.x + p.x, middle.y + p.y};
  for (const FixedEdge& edge : island.ground)
    ground = {ground.x + points[at(edge.a)].x, ground.y + points[at(edge.a)].y};
  const auto n = static_cast<double>(points.size());
  const auto g = static_cast<double>(island.ground.size());
  if (g == 0) return;
  const Point down{ground.x / g - middle.x / n, ground.y / g - middle.y / n};
  const double length = std::sqrt(down.x * down.x + down.y * down.y);
  if (length < 0.1) return;
  const double c = down.y / length, s = down.x / length;
  for (Point& p : points) p = {c * p.x - s * p.y, s * p.x + c * p.y};
}

/// Mirrors the drawing if bodies of small index would lie on the right.
void turn_first_left(std::vector<Point>& points) {
  const auto n = static_cast<double>(points.size());
  double lean = 0;
  for (std::size_t i = 0; i < points.size(); ++i) lean += (2 * static_cast<double>(i) + 1 - n) * points[i].x;
  if (lean >= 0) return;
  for (Point& p : points) p.x = -p.x;
}

}  // namespace

std::vector<Point> place_bodies(const IslandEdges& island) {
  const std::size_t n = island.bodies.size();
  if (n == 1) return {Point{}};
  const Neighbours neighbours = neighbours_of(island);
  if (n > kMaxStressBodies) return spiral(neighbours);
  const Vector distance = all_distances(neighbours);
  std::vector<Point> points = classical_scaling(distance, n);
  relax(points, distance);
  turn_ground_down(points, island);
  turn_first_left(points);
  return points;
}

}  // namespace stiction::graph
