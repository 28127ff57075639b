#pragma once

#include "core/job/body_job.hpp"
#include "distributed/solve/halo.hpp"

namespace stiction::distributed {

/// Sequential impulses on a rank's piece, compiled for one instruction set; all give the same bits.
template <class Real>
struct RankKernels {
  Offset (*elements)(Offset contacts, Offset bodies, bool momentum);  ///< numbers of scratch
  Offset (*exact_elements)(Offset bodies);                            ///< of them in double, besides
  void (*solve)(const BodyJob<Real>& piece, Real* numbers, double* exact, Halo& halo);
};

/// Returns the kernels of the widest instruction set that the CPU runs, for contacts of that law (contact_law).
template <class Real>
RankKernels<Real> rank_kernels(Law law);

}  // namespace stiction::distributed
