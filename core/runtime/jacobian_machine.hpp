#pragma once

#include "core/base/jacobian_job.hpp"

namespace stiction {

/// What can be done to a Jacobian batch, every environment of it; all was checked before.
template <class Real>
void assemble_on_cpu(const JacobianJob<Real>& job, int threads);
template <class Real>
void velocities_on_cpu(const JacobianJob<Real>& job, int threads);

}  // namespace stiction
