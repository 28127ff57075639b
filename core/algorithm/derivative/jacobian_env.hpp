#pragma once

#include "core/algorithm/derivative/derivative_env.hpp"
#include "core/algorithm/jacobian/jacobian_batch.hpp"

/// One environment of J and M of which derivatives are taken. It is assembled here, so that the factor L of M is there
/// for all that follows.
namespace stiction::inline STICTION_ISA {

/// Flags of an environment that has no factor L.
inline constexpr std::uint32_t kNotFactored = kNotAssembled | kFlagBadMass;

/// One environment and its vectors.
template <class Tile>
struct ChainEnv : JacobianEnv<Tile> {
  using Real = typename Tile::Real;
  static constexpr Offset kVectors = 5;
  Offset first_dof;
  Real* moved;     ///< p = M^-1 J' lambda                             (dofs)
  Real* motion;    ///< solution, then scratch                         (dofs)
  Real* change;    ///< M^-1 motion                                    (dofs)
  Real* moved_L;   ///< L' moved, of a factor that came as M           (dofs)
  Real* change_L;  ///< another product with L' or J'                  (dofs)

  STICTION_HD ChainEnv(const JacobianBatchView<Real>& view, Offset env, Real* scratch)
      : JacobianEnv<Tile>(slice<Tile>(view, env, scratch)),
        first_dof(view.env_dof_offsets[env]),
        moved(scratch + jacobian_elements<Tile>(view, env)),
        motion(moved + this->dofs),
        change(motion + this->dofs),
        moved_L(change + this->dofs),
        change_L(moved_L + this->dofs) {}

  [[nodiscard]] STICTION_HD bool has_factor() const { return this->batch->mass_form == MassForm::factor; }
};

/// Scratch of one environment, in doubles: that of the contact batch's environment, and behind it that of J and M.
template <class Tile, class Job>
STICTION_HD Offset jacobian_derivative_elements(const Job& job, Offset env) {
  return derivative_elements(job.contact, env) + jacobian_elements<Tile>(job.assembly.batch, env) +
         ChainEnv<Tile>::kVectors * job.assembly.batch.env_dofs(env);
}

/// Writes A, or Y, and b of an environment whose rows are written. Returns true if its L is there, on every lane.
template <class Tile, Team TeamT>
STICTION_HD bool assemble_for_derivative(TeamT& team, const JacobianBatchJob<typename Tile::Real>& job, Offset index,
                                         typename Tile::Real* scratch) {
  const bool assembled = (job.to.flags[index] & kNotAssembled) == 0;
  // Every lane has seen the flags before one of them adds to them.
  team.sync();
  if (assembled) assemble_env<Tile>(team, job.job(), index, scratch);
  return (job.to.flags[index] & kNotFactored) == 0;
}

/// p = M^-1 J' lambda.
template <Team TeamT, class Tile>
STICTION_HD void move_by_reactions(TeamT& team, const ChainEnv<Tile>& env, const typename Tile::Real* lambda) {
  pull_reactions(team, env, lambda, env.motion);
  solve_mass(team, env.L, env.motion, env.moved);
}

/// L' x of every block, the blocks of L lying as those of M.
template <Team TeamT, class Tile>
STICTION_HD void multiply_factor(TeamT& team, const ChainEnv<Tile>& env, const typename Tile::Real* L,
                                 const typename Tile::Real* x, typename Tile::Real* out) {
  const Index block = env.L.block;
  for_each(team, env.dofs, [&](Index j) {
    const Index end = (j / block + 1) * block;
    typename Tile::Real sum(0);
    for (Index i = j; i < end; ++i) sum = fma_(L[static_cast<Offset>(i) * block + j % block], x[i], sum);
    out[j] = sum;
  });
}

}  // namespace stiction::inline STICTION_ISA
