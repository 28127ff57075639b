#include "core/runtime/world/world_model.hpp"
#include "core/base/fp_env.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <string>

#include "core/base/extents.hpp"
#include "core/job/shape_pairs.hpp"
#include "core/runtime/check/defects.hpp"
#include "core/runtime/check/expect.hpp"

namespace stiction {

namespace {

/// Allowed distance of a quaternion's length from one.
constexpr double kUnitTolerance = 1e-6;
/// Places of shapes, twice over, are numbered by 32 bits.
constexpr std::size_t kMostShapes = std::numeric_limits<Index>::max() / 2;
/// Cells of the grid that shapes are sorted by: most per metre, so that no coordinate overflows.
constexpr double kMostCells = 1e18;
/// Factor that enlarges bounding radii, so that no rounding of a later step makes them too small.
constexpr double kBoundSlack = 1.0001;

using Three = std::array<double, 3>;
using Four = std::array<double, 4>;

double length_of(const Three& a) {
  return std::sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
}
double length_of(const Four& q) {
  return std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
}
template <class Array>
bool all_finite(const Array& values) {
  return std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
}

/// Refuses `name` = value unless the rule holds.
void require(bool holds, const std::string& name, double value, const char* rule) {
  if (!holds || !std::isfinite(value)) refuse(name + " = " + shortest_text(value) + ": must be " + rule);
}
void require_unit(const std::string& name, const Four& q) {
  if (!(std::abs(length_of(q) - 1.0) <= kUnitTolerance))
    refuse(name + " has length " + shortest_text(length_of(q)) + ": must be a unit quaternion (w, x, y, z)");
}
void require_finite(const std::string& name, bool is_finite) {
  if (!is_finite) refuse(name + " holds a number that is not finite");
}

int sizes_of(ShapeKind kind) {
  switch (kind) {
    case ShapeKind::sphere:
      return 1;
    case ShapeKind::capsule:
      return 2;
    case ShapeKind::box:
      return 3;
    case ShapeKind::plane:
      return 0;
  }
  refuse("a shape's kind = " + std::to_string(static_cast<int>(kind)) + ": use one of ShapeKind");
}

/// Radius about the shape's centre.
double bound_of(const WorldShape& shape) {
  switch (shape.kind) {
    case ShapeKind::sphere:
      return shape.size[0];
    case ShapeKind::capsule:
      return shape.size[0] + shape.size[1];
    case ShapeKind::box:
      return length_of(shape.size);
    case ShapeKind::plane:
      break;
  }
  return 0;
}

void check_body(const std::string& name, const WorldBody& body) {
  require(body.mass > 0, name + ".mass", body.mass, "finite and > 0");
  for (std::size_t k = 0; k < 3; ++k)
    require(body.inertia[k] > 0, name + ".inertia[" + std::to_string(k) + "]", body.inertia[k], "finite and > 0");
  require_unit(name + ".orientation", body.orientation);
  require_finite(name + ".position", all_finite(body.position));
  require_finite(name + ".twist", all_finite(body.twist));
}

void check_shape(const std::string& name, const WorldShape& shape, std::size_t bodies) {
  if (shape.body < -1 || shape.body >= static_cast<Index>(bodies))
    refuse(name + ".body = " + std::to_string(shape.body) + ": there are bodies 0 to " + std::to_string(bodies) +
           " - 1, and -1 is the world");
  if (shape.kind == ShapeKind::plane && shape.body != -1)
    refuse(name + " is a plane of body " + std::to_string(shape.body) + ": planes belong to the world, body = -1");
  for (int k = 0; k < sizes_of(shape.kind); ++k) {
    const double size = shape.size[at(k)];
    // A capsule of length zero is a sphere.
    const bool may_be_zero = shape.kind == ShapeKind::capsule && k == 1;
    require(may_be_zero ? size >= 0 : size > 0, name + ".size[" + std::to_string(k) + "]", size,
            may_be_zero ? "finite and >= 0" : "finite and > 0");
  }
  require_unit(name + ".orientation", shape.orientation);
  require_finite(name + ".position", all_finite(shape.position));
  require(shape.mu >= 0 && shape.mu <= kLargestShapeFriction, name + ".mu", shape.mu,
          "a friction in [0, 1e12]; 1e3 sticks as well as any larger one");
  require(shape.restitution >= 0 && shape.restitution <= 1, name + ".restitution", shape.restitution, "in [0, 1]");
}

/// Columns of the rotation matrix.
std::array<double, 9> columns_of(const Four& q) {
  const double n = length_of(q);
  const double w = q[0] / n, x = q[1] / n, y = q[2] / n, z = q[3] / n;
  return {1 - 2 * (y * y + z * z), 2 * (x * y + w * z),     2 * (x * z - w * y),
          2 * (x * y - w * z),     1 - 2 * (x * x + z * z), 2 * (y * z + w * x),
          2 * (x * z + w * y),     2 * (y * z - w * x),     1 - 2 * (x * x + y * y)};
}

template <class Real>
WorldBodyData<Real> data_of(const WorldBody& body) {
  WorldBodyData<Real> data{};
  data.inv_mass = static_cast<Real>(1 / body.mass);
  data.mass = body.mass;
  for (std::size_t k = 0; k < 3; ++k) {
    data.inertia[k] = static_cast<Real>(body.inertia[k]);
    data.inv_inertia[k] = static_cast<Real>(1 / body.inertia[k]);
  }
  data.isotropic = body.inertia[0] == body.inertia[1] && body.inertia[1] == body.inertia[2];
  return data;
}

template <class Real>
WorldShapeData<Real> data_of(const WorldShape& shape) {
  WorldShapeData<Real> data{};
  data.body = shape.body;
  data.kind = shape.kind;
  data.mu = shape.mu;
  data.restitution = shape.restitution;
  for (std::size_t k = 0; k < 3; ++k) {
    data.size[k] = static_cast<Real>(shape.size[k]);
    data.position[k] = static_cast<Real>(shape.position[k]);
  }
  const std::array<double, 9> columns = columns_of(shape.orientation);
  for (std::size_t k = 0; k < 9; ++k) data.axes[k] = static_cast<Real>(columns[k]);
  data.bound = static_cast<Real>(kBoundSlack * bound_of(shape));
  data.reach = static_cast<Real>(kBoundSlack * (bound_of(shape) + length_of(shape.position)));
  return data;
}

/// Shapes in order of bodies, and of the description within a body.
std::vector<Index> by_body(const std::vector<WorldShape>& shapes) {
  std::vector<Index> order(shapes.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](Index one, Index other) { return shapes[at(one)].body < shapes[at(other)].body; });
  return order;
}

/// Lists the shapes of the world and of each body, which are in order.
template <class Real>
std::vector<BodyShapes> shapes_of(const std::vector<WorldShapeData<Real>>& shape, std::size_t bodies) {
  std::vector<BodyShapes> all(bodies + 1);
  const auto shapes = static_cast<Index>(shape.size());
  Index next = 0;
  Offset pairs = 0;
  for (std::size_t k = 0; k < all.size(); ++k) {
    const Index begin = next;
    while (next < shapes && shape[at(next)].body < static_cast<Index>(k)) ++next;
    all[k] = {begin, next, pairs};
    pairs += Offset{next - begin} * (shapes - next);
  }
  return all;
}

/// All pairs in order of their numbers. Contacts of the same bodies are neighbours: the solver visits them as one.
template <class Real>
std::vector<WorldPair<Real>> pairs_of(const WorldModelView<Real>& model) {
  std::vector<WorldPair<Real>> pairs;
  for (Index a = 0; a < model.shapes; ++a)
    for (Index b = a + 1; b < model.shapes; ++b)
      if (model.shape[a].body != model.shape[b].body) pairs.push_back(with_surfaces(model, shape_pair(model, a, b)));
  std::sort(pairs.begin(), pairs.end(), [&](const WorldPair<Real>& one, const WorldPair<Real>& other) {
    return pair_number(model, one.shapes) < pair_number(model, other.shapes);
  });
  return pairs;
}

/// Half the size of the shape in the middle of all by size.
template <class Real>
double typical_length(const std::vector<WorldShapeData<Real>>& shapes) {
  std::vector<double> bound;
  for (const WorldShapeData<Real>& shape : shapes)
    if (shape.kind != ShapeKind::plane) bound.push_back(static_cast<double>(shape.bound));
  if (bound.empty()) return 1;
  const auto middle = bound.begin() + static_cast<std::ptrdiff_t>(bound.size() / 2);
  std::nth_element(bound.begin(), middle, bound.end());
  return *middle;
}

}  // namespace

void check_description(const WorldDescription& description) {
  if (description.shapes.size() > kMostShapes)
    refuse("shapes has " + std::to_string(description.shapes.size()) + " entries: at most " +
           std::to_string(kMostShapes) + ", since their pairs are counted by 32 bits: use several environments");
  for (std::size_t k = 0; k < description.bodies.size(); ++k)
    check_body("bodies[" + std::to_string(k) + "]", description.bodies[k]);
  for (std::size_t k = 0; k < description.shapes.size(); ++k)
    check_shape("shapes[" + std::to_string(k) + "]", description.shapes[k], description.bodies.size());
  require_finite("gravity", all_finite(description.gravity));
}

void check_world_options(const WorldOptions& options) {
  if (options.solver.substeps != 1)
    refuse("solver.substeps = " + std::to_string(options.solver.substeps) +
           ": must be 1: a world detects contacts in every step; take a smaller stepping.dt");
  if (options.solver.asynchronous)
    refuse("solver.asynchronous = true: must be false: a world has the same bits whenever it is stepped");
  if (!(options.margin >= 0) || !std::isfinite(options.margin))
    refuse("margin = " + shortest_text(options.margin) + ": must be finite and >= 0");
  if (!(options.warm_start >= 0 && options.warm_start <= 1))
    refuse("warm_start = " + shortest_text(options.warm_start) + ": must be in [0, 1]");
}

template <class Real>
void put_unit(const Four& quaternion, Real* to) {
  const double norm = length_of(quaternion);
  if (!(norm > 0) || !std::isfinite(norm)) return;
  for (std::size_t k = 0; k < 4; ++k) to[k] = static_cast<Real>(quaternion[k] / norm);
}

template <class Real>
void WorldModel<Real>::view_arrays() {
  shapes_of_ = shapes_of(shape_, body_.size());
  view_.bodies = static_cast<Index>(body_.size());
  view_.shapes = static_cast<Index>(shape_.size());
  view_.body = body_.data();
  view_.shape = shape_.data();
  view_.shapes_of = shapes_of_.data();
}

template <class Real>
WorldModel<Real>::WorldModel(const WorldDescription& description, const WorldOptions& options, std::size_t most_listed)
    : order_(by_body(description.shapes)) {
  for (const WorldBody& body : description.bodies) body_.push_back(data_of<Real>(body));
  for (const Index shape : order_) shape_.push_back(data_of<Real>(description.shapes[at(shape)]));
  view_arrays();
  view_.by_tree = shape_.size() > most_listed;
  for (std::size_t k = 0; k < 3; ++k) view_.gravity[k] = static_cast<Real>(description.gravity[k]);
  view_.step = static_cast<Real>(options.stepping.dt);
  view_.margin = static_cast<Real>(options.margin);
  const double length = typical_length(shape_);
  view_.cells_per_length = static_cast<Real>(length * kMostCells > 1 ? 1 / length : kMostCells);
  if (!view_.by_tree) pair_ = pairs_of(view_);
  view_.pairs = static_cast<Index>(pair_.size());
  view_.pair = pair_.data();
}

template <class Real>
WorldModel<Real>::WorldModel(const WorldModelView<Real>& whole, std::span<const Index> bodies) : view_(whole) {
  body_.reserve(bodies.size());
  const auto add_shapes = [&](const BodyShapes& of, Index body) {
    for (Index shape = of.begin; shape < of.end; ++shape) {
      order_.push_back(shape);
      shape_.push_back(whole.shape[shape]);
      shape_.back().body = body;
    }
  };
  add_shapes(whole.shapes_of[0], -1);
  for (const Index body : bodies) {
    add_shapes(whole.shapes_of[body + 1], static_cast<Index>(body_.size()));
    body_.push_back(whole.body[body]);
  }
  view_arrays();
  view_.by_tree = true;
  view_.pairs = 0;
  view_.pair = nullptr;
}

double slowest_bounce(const std::array<double, 3>& gravity, double dt) {
  const ScopedFpEnv fp_env;
  constexpr double kMost = 0.1, kSteps = 5;
  const double square = gravity[0] * gravity[0] + gravity[1] * gravity[1] + gravity[2] * gravity[2];
  const double speed = kSteps * dt * std::sqrt(square);
  return speed >= 0 && speed < kMost ? speed : kMost;
}

WorldBody solid_body(const WorldShape& shape, double density) {
  const ScopedFpEnv fp_env;
  require(density > 0, "density", density, "finite and > 0");
  if (shape.kind == ShapeKind::plane) refuse("shape is a plane, which has no mass: use a sphere, capsule or box");
  check_shape("shape", shape, at(shape.body) + 1);
  WorldBody body;
  body.position = shape.position;
  body.orientation = shape.orientation;
  const auto& s = shape.size;
  if (shape.kind == ShapeKind::box) {
    body.mass = density * 8 * s[0] * s[1] * s[2];
    body.inertia = {body.mass / 3 * (s[1] * s[1] + s[2] * s[2]), body.mass / 3 * (s[0] * s[0] + s[2] * s[2]),
                    body.mass / 3 * (s[0] * s[0] + s[1] * s[1])};
    return body;
  }
  const double r = s[0];
  const double ball = density * 4 / 3 * std::numbers::pi * r * r * r;
  if (shape.kind == ShapeKind::sphere) {
    body.mass = ball;
    body.inertia.fill(0.4 * ball * r * r);
    return body;
  }
  // A cylinder of half length h and two half balls, each with its centre of mass 3 r / 8 beyond the cylinder's end.
  const double h = s[1];
  const double cylinder = density * 2 * std::numbers::pi * r * r * h;
  body.mass = ball + cylinder;
  const double axial = cylinder * r * r / 2 + 0.4 * ball * r * r;
  const double across = cylinder * (r * r / 4 + h * h / 3) + ball * (0.4 * r * r + h * h + 0.75 * h * r);
  body.inertia = {across, across, axial};
  return body;
}

template void put_unit(const Four&, float*);
template void put_unit(const Four&, double*);
template class WorldModel<float>;
template class WorldModel<double>;

}  // namespace stiction
