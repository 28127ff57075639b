#pragma once

#include "core/job/workspace.hpp"

namespace stiction::test {

/// A method to which every environment is too large for matrices.
template <class Method>
struct Matrixless : Method {
  static constexpr Workspace workspace() { return Method::workspace().up_to(0); }
};

}  // namespace stiction::test
