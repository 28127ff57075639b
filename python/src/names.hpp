#pragma once

#include <string>

#include "stiction/solver.hpp"

namespace stiction::python {

/// The law of that name. \throws Error(invalid_argument) that lists the names there are.
Law law_from(const std::string& name);

/// "cpu", "cuda:0", "emulated": as Device::from_string reads it.
std::string name_of(Device device);

}  // namespace stiction::python
