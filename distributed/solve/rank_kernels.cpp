// Compiled once for each instruction set, in a namespace of its own.
#include "distributed/solve/kernels.hpp"
#include "distributed/solve/rank_team.hpp"

namespace stiction::inline STICTION_ISA {

namespace {

template <class Real, Law kLaw>
distributed::RankKernels<Real> kernels() {
  using Method = BodySweeps<kLaw, Real>;
  using System = typename Method::System;
  return {System::elements, System::exact_elements,
          [](const BodyJob<Real>& piece, Real* numbers, double* exact, distributed::Halo& halo) {
            RankTeam team(halo);
            Method::solve(team, piece, slice_bodies(piece, 0), numbers, exact);
          }};
}

template <class Real>
distributed::RankKernels<Real> kernels_of(Law law) {
  if (law == kBoxFriction) return kernels<Real, kBoxFriction>();
  return law == Law::convex ? kernels<Real, Law::convex>() : kernels<Real, Law::coulomb>();
}

}  // namespace

distributed::RankKernels<float> rank_kernels_f32(Law law) {
  return kernels_of<float>(law);
}
distributed::RankKernels<double> rank_kernels_f64(Law law) {
  return kernels_of<double>(law);
}

}  // namespace stiction::inline STICTION_ISA
