#include "distributed/solve/solve_piece.hpp"

#include "distributed/solve/kernels.hpp"
#include "distributed/solve/rank_meter.hpp"
#include "distributed/solve/scratch.hpp"

namespace stiction::distributed {

template <class Real>
void solve_piece(Transport& transport, const BodyJob<Real>& piece, const Rounds& rounds, Offset ghosts,
                 RankReport& report) {
  const Offset bodies = piece.batch.body_count, contacts = piece.batch.contact_count;
  const RankKernels<Real> kernels = rank_kernels<Real>(contact_law(piece.options));
  Scratch<Real> numbers(kernels.elements(contacts, bodies, piece.options.momentum));
  Scratch<double> exact(kernels.exact_elements(bodies));
  Halo halo(transport, rounds);
  const RankMeter meter(transport);
  kernels.solve(piece, numbers.data(), exact.data(), halo);
  meter.add_to(report);
  report.bodies += bodies;
  report.ghosts += ghosts;
  report.contacts += contacts;
}

template void solve_piece(Transport&, const BodyJob<float>&, const Rounds&, Offset, RankReport&);
template void solve_piece(Transport&, const BodyJob<double>&, const Rounds&, Offset, RankReport&);

}  // namespace stiction::distributed
