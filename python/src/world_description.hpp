#pragma once

#include <nanobind/nanobind.h>

#include <array>

#include "stiction/world.hpp"

namespace stiction::python {

/// A shape of the package, whose class has checked names and lengths.
WorldShape shape_from(nanobind::handle object);

/// Bodies and shapes of the package.
WorldDescription description_from(const nanobind::sequence& bodies, const nanobind::sequence& shapes,
                                  const std::array<double, 3>& gravity);

}  // namespace stiction::python
