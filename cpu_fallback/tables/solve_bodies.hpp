#pragma once

#include "cpu_fallback/tables/body_kernels.hpp"
#include "cpu_fallback/threads/threaded_team.hpp"

/// A method of solving bodies (BodySweeps, BodyNewton) on one thread and on a team of them. Compiled once per
/// instruction set.
namespace stiction::inline STICTION_ISA {

template <class Method, class Real>
void solve_alone(const BodyJob<Real>& job, Offset env, Real* numbers, double* exact) {
  SerialTeam team;
  Method::solve(team, job, slice_bodies(job, env), numbers, exact);
}

template <class Method, class Real>
void solve_together(const BodyJob<Real>& job, Offset env, Real* numbers, double* exact, cpu::ThreadTeam& threads,
                    Index rank) {
  ThreadedTeam team(threads, rank);
  Method::solve(team, job, slice_bodies(job, env), numbers, exact);
}

}  // namespace stiction::inline STICTION_ISA
