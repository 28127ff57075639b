#pragma once

#include "core/algorithm/linear/block/block_diagonal.hpp"
#include "core/algorithm/linear/block/block_ldl.hpp"
#include "core/algorithm/linear/block/incomplete_cholesky.hpp"
#include "core/algorithm/linear/block/scalar_diagonal.hpp"
#include "core/algorithm/linear/block/sparse_inverse.hpp"
#include "core/algorithm/linear/multigrid/multigrid.hpp"
#include "core/algorithm/newton/outer_loop.hpp"
#include "core/algorithm/rigid/newton/space_room.hpp"
#include "stiction/body_space.hpp"

namespace stiction::inline STICTION_ISA {

/// Doubles that a preconditioner keeps. For the host, which makes room.
inline Offset preconditioner_doubles(const NewtonStream& stream, const BodySpaceOptions& space) {
  const auto rows = static_cast<Offset>(stream.pattern.rows);
  const Index* own = stream.preconditioner;
  switch (space.preconditioner) {
    case BodyPreconditioner::diagonal:
      return ScalarDiagonal::doubles(rows);
    case BodyPreconditioner::block_diagonal:
      return BlockDiagonal::doubles(rows);
    case BodyPreconditioner::incomplete_cholesky:
      return IncompleteCholesky::doubles(take_block_factor(own).lower.blocks());
    case BodyPreconditioner::sparse_inverse: {
      const SparseInverseView plan = take_sparse_inverse(own);
      return SparseInverse::doubles(rows, plan.lower.blocks(), plan.dense_offsets[rows]);
    }
    case BodyPreconditioner::factor:
      return BlockLdl::doubles(take_block_factor(own).lower.blocks());
    case BodyPreconditioner::multigrid:
      return Multigrid::doubles(take_multigrid(own));
  }
  return 0;
}

/// Doubles that Newton's method needs for an environment of `contacts` that are solved. For the host.
inline Offset newton_doubles(Offset contacts, const Index* integers, const BodySpaceOptions& space) {
  const NewtonStream stream = take_newton_stream(integers);
  return SpaceWorkspace::doubles(contacts, stream.pattern.rows, stream.pattern.blocks()) +
         preconditioner_doubles(stream, space);
}

/// Which system is solved: H d = force, or that of workspace.sliding, which H preconditions.
enum class SpaceSystem { symmetric, sliding };

/// d into workspace.step, by a preconditioner that is prepared.
template <Team TeamT, class Preconditioner>
STICTION_HD_OUTLINE void solve_with(TeamT& team, const SpaceWorkspace& workspace, const Preconditioner& preconditioner,
                                    SpaceSystem system, double tolerance) {
  const KrylovProblem problem{workspace.H.unknowns(), workspace.force, workspace.step,
                              workspace.gradients,    tolerance,       kMostGradientSteps};
  if (system == SpaceSystem::symmetric)
    conjugate_gradient(team, workspace.H, problem, preconditioner);
  else
    bicgstab(team, workspace.sliding, problem, preconditioner);
}
template <Team TeamT, class Preconditioner>
STICTION_HD_OUTLINE void prepare_and_solve(TeamT& team, const SpaceWorkspace& workspace,
                                           const Preconditioner& preconditioner, SpaceSystem system, double tolerance) {
  preconditioner.prepare(team, workspace.H);
  solve_with(team, workspace, preconditioner, system, tolerance);
}

/// Solves with the preconditioner that the options name.
template <Team TeamT>
STICTION_HD_OUTLINE void solve_space(TeamT& team, const SpaceWorkspace& workspace, const BodySpaceOptions& space,
                                     SpaceSystem system, double tolerance) {
  const Index rows = workspace.stream.pattern.rows;
  const Index* own = workspace.stream.preconditioner;
  double* const memory = workspace.preconditioner;
  switch (space.preconditioner) {
    case BodyPreconditioner::diagonal:
      return prepare_and_solve(team, workspace, ScalarDiagonal{rows, memory}, system, tolerance);
    case BodyPreconditioner::block_diagonal:
      return prepare_and_solve(team, workspace, BlockDiagonal{rows, memory}, system, tolerance);
    case BodyPreconditioner::incomplete_cholesky:
      return prepare_and_solve(team, workspace, IncompleteCholesky{take_block_factor(own), memory}, system, tolerance);
    case BodyPreconditioner::sparse_inverse:
      return prepare_and_solve(team, workspace, SparseInverse::in(take_sparse_inverse(own), memory), system, tolerance);
    case BodyPreconditioner::factor:
      return prepare_and_solve(team, workspace, BlockLdl{take_block_factor(own), memory}, system, tolerance);
    case BodyPreconditioner::multigrid: {
      Multigrid multigrid;
      multigrid.plan = take_multigrid(own);
      multigrid.cycle = space.multigrid.cycle;
      multigrid.memory = memory;
      multigrid.prepare(team, workspace.H, workspace.positions);
      solve_with(team, workspace, multigrid, system, tolerance);
    }
  }
}

}  // namespace stiction::inline STICTION_ISA
