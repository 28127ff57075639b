#pragma once

#include <vector>

#include "stiction/pyramid.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/small_systems.hpp"

/// Every solver that a batch can be given to, and batches that it takes.
namespace stiction::test {

inline const std::vector<SolverKind> kEveryChoice = [] {
  std::vector<SolverKind> choices(kEverySolver.begin(), kEverySolver.end());
  choices.push_back(SolverKind::automatic);
  return choices;
}();

/// Returns true if an iteration costs a factorisation, or may.
inline bool is_costly(SolverKind solver) {
  return solver == SolverKind::automatic || factorises(solver);
}

/// The batch without environments of more rows than that.
inline ContactBatch<double> up_to(const ContactBatch<double>& batch, Index rows) {
  std::vector<Offset> small;
  for (Offset env = 0; env < batch.env_count(); ++env)
    if (batch.view().env_rows(env) <= rows) small.push_back(env);
  return gather(batch, small);
}

/// Makes the batch as that solver takes it. lemke, which refuses friction cones, gets pyramids of four edges. Whatever
/// is costly gets nothing of more than `costly_rows` rows. 200 rows leave dense and sparse environments, 100 dense
/// ones and a few sparse.
template <class Real>
ContactBatch<Real> batch_for(SolverKind solver, const ContactBatch<double>& batch, Index costly_rows) {
  if (!is_costly(solver)) return convert<Real>(batch);
  const ContactBatch<double> small = up_to(batch, costly_rows);
  return convert<Real>(solver == SolverKind::lemke ? linearise(small, 4).batch : small);
}

/// Returns so few that nothing costly takes long, and pivots for lemke, whose iterations are cheap.
inline Index few_iterations(SolverKind solver, Index cheap) {
  return is_costly(solver) && solver != SolverKind::lemke ? 4 : cheap;
}

}  // namespace stiction::test
