#include "core/runtime/world_model.hpp"
#include "core/base/fp_env.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <tuple>

#include "core/base/extents.hpp"
#include "core/runtime/defects.hpp"
#include "core/runtime/expect.hpp"

namespace stiction {

namespace {

/// How far a quaternion's length may be from one.
constexpr double kUnitTolerance = 1e-6;
/// All shapes are tested against all others: beyond this, memory and time are not what a caller expects.
constexpr std::size_t kMostShapes = 2048;
/// What bounding radii are enlarged by, so that no rounding of a later step makes them too small.
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
  require(shape.mu >= 0, name + ".mu", shape.mu, "finite and >= 0");
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

/// Every two shapes of different bodies, neighbours if of the same bodies: the solver visits those as one.
template <class Real>
std::vector<WorldPair<Real>> pairs_of(const std::vector<WorldShape>& shapes) {
  std::vector<WorldPair<Real>> pairs;
  for (std::size_t i = 0; i < shapes.size(); ++i)
    for (std::size_t j = i + 1; j < shapes.size(); ++j) {
      if (shapes[i].body == shapes[j].body) continue;
      const bool in_order = shapes[i].body < shapes[j].body;
      const std::size_t a = in_order ? i : j;
      const std::size_t b = in_order ? j : i;
      const double restitution =
          shapes[a].restitution < shapes[b].restitution ? shapes[b].restitution : shapes[a].restitution;
      pairs.push_back({static_cast<Index>(a), static_cast<Index>(b), shapes[a].body, shapes[b].body,
                       static_cast<Real>(std::sqrt(shapes[a].mu * shapes[b].mu)), static_cast<Real>(restitution)});
    }
  std::sort(pairs.begin(), pairs.end(), [](const WorldPair<Real>& one, const WorldPair<Real>& other) {
    return std::tie(one.body_a, one.body_b, one.shape_a, one.shape_b) <
           std::tie(other.body_a, other.body_b, other.shape_a, other.shape_b);
  });
  return pairs;
}

}  // namespace

void check_description(const WorldDescription& description) {
  if (description.shapes.size() > kMostShapes)
    refuse("shapes has " + std::to_string(description.shapes.size()) + " entries: at most " +
           std::to_string(kMostShapes) + ", since each is tested against all others in every environment");
  for (std::size_t k = 0; k < description.bodies.size(); ++k)
    check_body("bodies[" + std::to_string(k) + "]", description.bodies[k]);
  for (std::size_t k = 0; k < description.shapes.size(); ++k)
    check_shape("shapes[" + std::to_string(k) + "]", description.shapes[k], description.bodies.size());
  require_finite("gravity", all_finite(description.gravity));
}

template <class Real>
WorldModel<Real>::WorldModel(const WorldDescription& description, const WorldOptions& options)
    : pair_(pairs_of<Real>(description.shapes)) {
  for (const WorldBody& body : description.bodies) body_.push_back(data_of<Real>(body));
  for (const WorldShape& shape : description.shapes) shape_.push_back(data_of<Real>(shape));
  view_ = {static_cast<Index>(body_.size()),
           static_cast<Index>(shape_.size()),
           static_cast<Index>(pair_.size()),
           body_.data(),
           shape_.data(),
           pair_.data(),
           {static_cast<Real>(description.gravity[0]), static_cast<Real>(description.gravity[1]),
            static_cast<Real>(description.gravity[2])},
           static_cast<Real>(options.stepping.dt),
           static_cast<Real>(options.margin)};
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

template class WorldModel<float>;
template class WorldModel<double>;

}  // namespace stiction
