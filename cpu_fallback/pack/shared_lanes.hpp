#pragma once

#include "core/algorithm/pack/evaluate_lanes.hpp"
#include "core/algorithm/pack/load_lanes.hpp"
#include "core/algorithm/residual/residual_estimate.hpp"
#include "cpu_fallback/pack/pack_width.hpp"

/// Instances shared by all packs of environments. Compiled once per instruction set, in kernels/shared_instances.cpp,
/// as the common parts of single environments. `kind` is `extern` everywhere else.
#define STICTION_SHARED_LANES_OF_LAW(kind, Real, kLaw)                                                                 \
  kind template void record_iterate<false, kLaw>(SerialTeam&, PackSystem<Real>&, Mask<Pack<Real, kPackWidth<Real>>>);  \
  kind template void evaluate_lanes<kLaw>(const PackSystem<Real>&, const PackRoom<Real>&, const EnvView<Real>* const*, \
                                          const int*, int, FinalResidual*);

#define STICTION_SHARED_LANES(kind, Real)                                                                              \
  kind template void load_lanes_of(const PackSystem<Real>&, const DenseSystem<Real, kPackWidth<Real>>*,                \
                                   const PackRoom<Real>&, LoadRules, PendingLoad<Real>*, int);                         \
  kind template void finish_lanes(PackSystem<Real>&, const PackRoom<Real>&, Mask<Pack<Real, kPackWidth<Real>>>, Law);  \
  kind template void start_lanes(PackSystem<Real>&, const PackRoom<Real>&, const DenseSystem<Real, kPackWidth<Real>>*, \
                                 const EnvView<Real>* const*, const int*, int, Mask<Pack<Real, kPackWidth<Real>>>);    \
  STICTION_SHARED_LANES_OF_LAW(kind, Real, Law::convex)                                                                \
  STICTION_SHARED_LANES_OF_LAW(kind, Real, Law::coulomb)

namespace stiction::inline STICTION_ISA {

template <class Real>
using PackSystem = DenseSystem<Pack<Real, kPackWidth<Real>>>;
template <class Real>
using PackRoom = PackWorkspace<Real, kPackWidth<Real>>;

#if STICTION_VECTOR_BYTES > 0
STICTION_SHARED_LANES(extern, float)
STICTION_SHARED_LANES(extern, double)
#endif

}  // namespace stiction::inline STICTION_ISA
