#include "core/algorithm/jacobian/delassus.hpp"
#include "cpu_fallback/pack/mass_tile.hpp"
#include "cpu_fallback/tables/jacobian_kernels.hpp"
#include "cpu_fallback/tables/velocity_blocks.hpp"

namespace stiction::inline STICTION_ISA {

namespace {

template <class Real>
using OneRow = RowTile<Real>;
template <class Real>
using Rows = MassTile<Real>;

template <class Real>
Offset elements_of(const JacobianJob<Real>& job, Offset env) {
  return jacobian_elements<Rows<Real>>(job.batch, env);
}
template <class Real>
void assemble_one(const JacobianJob<Real>& job, Offset env, Real* scratch) {
  SerialTeam team;
  assemble_env<Rows<Real>>(team, job, env, scratch);
}
template <class Real>
void velocity_one(const JacobianJob<Real>& job, Offset env, Real* scratch) {
  SerialTeam team;
  // A factor of small blocks has no panels to speak of, and nothing else is worth a tile here.
  constexpr Index kSmall = 4;
  const Index mass_rows = mass_block(job.batch, job.batch.env_dofs(env));
  if (mass_rows < kSmall) {
    velocity_env<OneRow<Real>>(team, job, env, scratch);
  } else {
    velocity_env<Rows<Real>>(team, job, env, scratch);
  }
}

}  // namespace

cpu::JacobianKernelSet jacobian_kernels() {
  return {{elements_of<float>, assemble_one<float>, velocity_one<float>, solve_one_in_blocks<float>},
          {elements_of<double>, assemble_one<double>, velocity_one<double>, solve_one_in_blocks<double>}};
}

}  // namespace stiction::inline STICTION_ISA
