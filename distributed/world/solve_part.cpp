#include "distributed/world/solve_part.hpp"

#include <algorithm>
#include <vector>

#include "core/base/fp_env.hpp"
#include "distributed/solve/agreement.hpp"
#include "distributed/solve/solve_piece.hpp"
#include "distributed/world/plan_piece.hpp"

namespace stiction::distributed {

template <class Real>
EnvStatus solve_part(Transport& transport, const BodyBatchView<Real>& part, const PieceBodies& bodies,
                     const TimeStepping& stepping, const BodySolverOptions& options, Real* impulse,
                     RankReport& report) {
  const ScopedFpEnv fp_env;
  require_impulses(options);
  BodySolverOptions alone = options;
  alone.threads = 1;
  static_cast<void>(BodySolver(Device::cpu(), stepping, alone));  // refuses values out of range
  Digest digest;
  add_options(digest, stepping, options);
  require_agreement(transport, digest.sum(), "other options");
  std::int64_t waves = 0;
  const PiecePlan plan = plan_piece(transport, part, bodies, waves);
  std::vector<Real> twist(static_cast<std::size_t>(6 * part.body_count));
  EnvStatus status{};
  const BodyJob<Real> job{part,    plan.plan.view(), {impulse, twist.data(), nullptr, &status},
                          nullptr, stepping,         options};
  const auto owned = std::count(bodies.owner.begin(), bodies.owner.end(), bodies.rank);
  solve_piece(transport, job, plan.rounds, part.body_count - owned, report);
  return status;
}

template EnvStatus solve_part(Transport&, const BodyBatchView<float>&, const PieceBodies&, const TimeStepping&,
                              const BodySolverOptions&, float*, RankReport&);
template EnvStatus solve_part(Transport&, const BodyBatchView<double>&, const PieceBodies&, const TimeStepping&,
                              const BodySolverOptions&, double*, RankReport&);

}  // namespace stiction::distributed
