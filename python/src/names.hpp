#pragma once

#include <string>

#include "stiction/types.hpp"

namespace stiction::python {

/// The law of that name. \throws Error(invalid_argument) that lists the names there are.
Law law_from(const std::string& name);

}  // namespace stiction::python
