#pragma once

#include "stiction/batch.hpp"
#include "stiction/types.hpp"

namespace stiction::c {

/// \throws Error(invalid_argument) for a batch in device memory, which the caller cannot look into.
void need_host(MemorySpace space);

/// \throws Error(invalid_argument) with the first defect of a host batch under that solver.
template <class Real>
void need_valid(const ContactBatchView<Real>& batch, SolverKind solver);

/// \throws Error(invalid_argument) with the first defect of offsets, counts and columns alone.
template <class Real>
void need_sound(const ContactBatchView<Real>& batch);

}  // namespace stiction::c
