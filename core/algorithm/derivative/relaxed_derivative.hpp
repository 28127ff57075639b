#pragma once

#include "core/algorithm/derivative/find_relaxed.hpp"
#include "core/algorithm/derivative/jacobian_jvp.hpp"
#include "core/algorithm/derivative/jacobian_vjp.hpp"
#include "core/job/relaxed_job.hpp"

/// Derivatives of the relaxed problem. Its directions stand in for those of the modes and its reactions for the exact
/// ones; everything else is that of the exact problem (docs/math/derivative.md).
namespace stiction::inline STICTION_ISA {

/// Finds the relaxed problem's directions, and the job as it is at the relaxed reactions.
template <Team TeamT, class Job, class Real>
STICTION_HD Job relaxed_at(TeamT& team, const EnvView<Real>& env, const Job& job, Offset index, double kappa, Real* out,
                           const RelaxedScratch& s, ModesFound& found) {
  found = find_relaxed(team, env, job, index, kappa, out, s);
  Job relaxed = job;
  relaxed.at.lambda = out;
  return relaxed;
}

template <Team TeamT, class Real>
STICTION_HD void relaxed_vjp_env(TeamT& team, const RelaxedJob<VjpJob<Real>, Real>& job, Offset index, double* memory) {
  const EnvView<Real> env = environment_of(team, job.job, index);
  const RelaxedScratch s = lay_out_relaxed(job.job, index, memory);
  ModesFound found;
  const VjpJob<Real> relaxed = relaxed_at(team, env, job.job, index, job.kappa, job.lambda, s, found);
  vjp_along(team, env, relaxed, index, s, found);
}

template <Team TeamT, class Real>
STICTION_HD void relaxed_jvp_env(TeamT& team, const RelaxedJob<JvpJob<Real>, Real>& job, Offset index, double* memory) {
  const EnvView<Real> env = slice_problem(job.job.batch, job.job.law, index);
  const RelaxedScratch s = lay_out_relaxed(job.job, index, memory);
  ModesFound found;
  const JvpJob<Real> relaxed = relaxed_at(team, env, job.job, index, job.kappa, job.lambda, s, found);
  jvp_along(team, env, relaxed, index, s, found);
}

/// Scratch of one environment of J and M, in doubles.
template <class Tile, class Job>
STICTION_HD Offset relaxed_jacobian_elements(const Job& job, Offset env) {
  return jacobian_derivative_elements<Tile>(job, env) - derivative_elements(job.contact, env) +
         relaxed_elements(job.contact, env);
}

/// Pulls all sets of cotangents of one environment back, to J and M where there are such, and writes its record.
template <class Tile, Team TeamT, class Real>
STICTION_HD_OUTLINE void relaxed_jacobian_vjp_env(TeamT& team, const RelaxedJob<JacobianVjpJob<Real>, Real>& job,
                                                  Offset index, double* memory) {
  JacobianVjpJob<Real> own = job.job;
  auto* const chain = reinterpret_cast<Real*>(memory + relaxed_elements(own.contact, index));
  const bool is_mass = own.has_jacobian && begin_jacobian_vjp<Tile>(team, own, index, chain);
  relaxed_vjp_env(team, RelaxedJob<VjpJob<Real>, Real>{own.contact, job.kappa, job.lambda}, index, memory);
  if (!own.has_jacobian) return;
  own.contact.at.lambda = job.lambda;
  end_jacobian_vjp<Tile>(team, own, index, chain, is_mass);
}

/// Pushes all sets of changes of one environment forward, of J and M where there are such, and writes its record.
/// Terms of J and M at resting reactions depend on the relaxed reactions, which are therefore found before.
template <class Tile, Team TeamT, class Real>
STICTION_HD_OUTLINE void relaxed_jacobian_jvp_env(TeamT& team, const RelaxedJob<JacobianJvpJob<Real>, Real>& job,
                                                  Offset index, double* memory) {
  JacobianJvpJob<Real> own = job.job;
  auto* const chain = reinterpret_cast<Real*>(memory + relaxed_elements(own.contact, index));
  const bool is_mass = own.has_jacobian && assemble_for_derivative<Tile>(team, own.assembly, index, chain);
  const EnvView<Real> env = slice_problem(own.contact.batch, own.contact.law, index);
  const RelaxedScratch s = lay_out_relaxed(own.contact, index, memory);
  ModesFound found;
  own.contact = relaxed_at(team, env, own.contact, index, job.kappa, job.lambda, s, found);
  if (is_mass) change_motion(team, ChainEnv<Tile>(own.assembly.batch, index, chain), own, index);
  jvp_along(team, env, own.contact, index, s, found);
  if (own.has_jacobian) end_jacobian_jvp<Tile>(team, own, index, chain, is_mass);
}

}  // namespace stiction::inline STICTION_ISA
