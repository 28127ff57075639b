#pragma once

#include "python/src/views.hpp"

namespace stiction::python {

/// A packed copy in f64 of the part of a host batch in use.
ContactBatch<double> packed(const ContactView& batch);
/// The matrices of a host batch of Jacobians, packed likewise.
ContactBatch<double> packed(const JacobianView& batch);

}  // namespace stiction::python
