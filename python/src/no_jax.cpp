#include "python/src/solver.hpp"

namespace stiction::python {

/// Built where there was no JAX: the package calls the solver back instead.
void bind_jax(nanobind::module_& module) {
  module.attr("jax_calls") = nanobind::dict();
}

}  // namespace stiction::python
