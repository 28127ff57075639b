#pragma once

#include "core/algorithm/rigid/newton/newton_bodies.hpp"
#include "cuda/api/kernel_catalogue.hpp"
#include "cuda/kernels/bodies_program.hpp"
#include "cuda/kernels/body_bundles.hpp"
#include "cuda/kernels/choose_program.hpp"
#include "cuda/kernels/plan_program.hpp"
#include "cuda/kernels/solve_teams.hpp"
#include "cuda/kernels/solve_thread_per_env.hpp"
#include "cuda/kernels/trivial_program.hpp"
#include "cuda/kernels/warm_start_program.hpp"
#include "cuda/kernels/world_program.hpp"

/// Fills a catalogue by whatever turns a program into a kernel of one device:
/// `Make::template kernel<Program>(name)`. Long parts have catalogues of their own (derivative_catalogue.hpp,
/// jacobian_catalogue.hpp): no solver is compiled anew for them.
namespace stiction::cuda {

template <class Make, class Method, Law kLaw, class Real>
KernelRef bundles_kernel() {
  if constexpr (Method::workspace().is_direct()) {
    return {};
  } else {
    return Make::template kernel<SolveThreadPerEnv<Method, kLaw, Real>>("solve_thread_per_env");
  }
}

template <class Make, class Method, Law kLaw, class Real>
SolveKernels solve_kernels() {
  return {bundles_kernel<Make, Method, kLaw, Real>(),
          Make::template kernel<SolveTeams<Method, kLaw, EnvPath::dense, Real>>("solve_dense"),
          Make::template kernel<SolveTeams<Method, kLaw, EnvPath::sparse, Real>>("solve_sparse"),
          Make::template kernel<SolveTeams<Method, kLaw, EnvPath::factor, Real>>("solve_factor")};
}

template <class Make, class Method>
SolverKernels solver_kernels() {
  return {{{solve_kernels<Make, Method, Law::convex, float>(), solve_kernels<Make, Method, Law::coulomb, float>()},
           {solve_kernels<Make, Method, Law::convex, double>(), solve_kernels<Make, Method, Law::coulomb, double>()}},
          Method::workspace()};
}

template <class Make>
PlanKernels plan_kernels() {
  return {Make::template kernel<InspectEnvironments>("plan_inspect"),
          Make::template kernel<SortEnvironments>("plan_sort"), Make::template kernel<ColorEnvironments>("plan_color"),
          Make::template kernel<FindIslands>("find_islands")};
}

template <class Make, class Real>
WarmStartKernels warm_start_kernels() {
  return {Make::template kernel<LoadWarmStarts<Real>>("warm_start_load"),
          Make::template kernel<StoreWarmStarts<Real>>("warm_start_store"),
          Make::template kernel<ResetWarmStarts<Real>>("warm_start_reset")};
}

template <class Make, class Real>
WorldKernels world_kernels() {
  return {Make::template kernel<FindWorldContacts<Real>>("world_find"),
          Make::template kernel<FindNearWorldContacts<Real>>("world_find_near"),
          Make::template kernel<EmitWorldContacts<Real>>("world_emit_contacts"),
          Make::template kernel<IntegrateWorlds<Real>>("world_integrate"),
          Make::template kernel<MeasureWorlds<Real>>("world_measure")};
}

template <class Make, Law kLaw, class Real>
SolveBodyKernels solve_body_kernels() {
  return {Make::template kernel<SolveBodyBundles<kLaw, Real>>("body_bundles"),
          Make::template kernel<SolveBodies<BodySweeps<kLaw, Real>>>("bodies")};
}

template <class Make>
BodyKernels body_kernels() {
  return {{{solve_body_kernels<Make, Law::convex, float>(), solve_body_kernels<Make, Law::coulomb, float>(),
            solve_body_kernels<Make, kBoxFriction, float>()},
           {solve_body_kernels<Make, Law::convex, double>(), solve_body_kernels<Make, Law::coulomb, double>(),
            solve_body_kernels<Make, kBoxFriction, double>()}}};
}

template <class Make, Law kLaw, class Real>
KernelRef newton_body_kernel() {
  return Make::template kernel<SolveBodies<BodyNewton<kLaw, Real>>>("newton_bodies");
}

template <class Make>
NewtonBodyKernels newton_body_kernels() {
  return {{{newton_body_kernel<Make, Law::convex, float>(), newton_body_kernel<Make, Law::coulomb, float>()},
           {newton_body_kernel<Make, Law::convex, double>(), newton_body_kernel<Make, Law::coulomb, double>()}}};
}

}  // namespace stiction::cuda
