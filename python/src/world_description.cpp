#include "python/src/world_description.hpp"

#include <nanobind/stl/array.h>

namespace nb = nanobind;

namespace stiction::python {

namespace {

template <class Number, std::size_t N>
std::array<Number, N> numbers(nb::handle object, const char* name) {
  return nb::cast<std::array<Number, N>>(object.attr(name));
}

ShapeKind kind_from(nb::handle object) {
  return static_cast<ShapeKind>(nb::cast<std::uint8_t>(object));
}

WorldBody body_from(nb::handle object) {
  WorldBody body;
  body.mass = nb::cast<double>(object.attr("mass"));
  body.inertia = numbers<double, 3>(object, "inertia");
  body.position = numbers<double, 3>(object, "position");
  body.orientation = numbers<double, 4>(object, "orientation");
  body.twist = numbers<double, 6>(object, "twist");
  return body;
}

}  // namespace

WorldShape shape_from(nb::handle object) {
  WorldShape shape;
  shape.body = nb::cast<Index>(object.attr("body"));
  shape.kind = kind_from(object.attr("_kind"));
  shape.size = numbers<double, 3>(object, "_sizes");
  shape.position = numbers<double, 3>(object, "position");
  shape.orientation = numbers<double, 4>(object, "orientation");
  shape.mu = nb::cast<double>(object.attr("mu"));
  shape.restitution = nb::cast<double>(object.attr("restitution"));
  return shape;
}

WorldDescription description_from(const nb::sequence& bodies, const nb::sequence& shapes,
                                  const std::array<double, 3>& gravity) {
  WorldDescription description;
  for (const nb::handle body : bodies) description.bodies.push_back(body_from(body));
  for (const nb::handle shape : shapes) description.shapes.push_back(shape_from(shape));
  description.gravity = gravity;
  return description;
}

}  // namespace stiction::python
