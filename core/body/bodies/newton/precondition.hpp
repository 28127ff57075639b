#pragma once

#include "core/body/bodies/newton/newton_room.hpp"
#include "core/body/linear/block_diagonal.hpp"
#include "core/body/linear/scalar_diagonal.hpp"
#include "stiction/body_space.hpp"

namespace stiction::inline STICTION_ISA {

/// Steps of conjugate gradients in one linear system, at most; what they leave is still a direction of descent.
inline constexpr Index kMostGradientSteps = 1000;

/// Doubles that a preconditioner keeps.
STICTION_HD Offset preconditioner_doubles(const NewtonStream& stream, const BodySpaceOptions& space) {
  const auto rows = static_cast<Offset>(stream.pattern.rows);
  switch (space.preconditioner) {
    case BodyPreconditioner::diagonal:
      return ScalarDiagonal::doubles(rows);
    case BodyPreconditioner::block_diagonal:
      return BlockDiagonal::doubles(rows);
  }
  return 0;
}

/// Doubles that Newton's method needs for an environment, whose own are read through its plan.
template <class Real>
STICTION_HD Offset newton_doubles(const BodyEnv<Real>& env, const BodySpaceOptions& space) {
  const NewtonStream stream = take_newton_stream(env.newton_stream);
  return NewtonRoom::doubles(env.kept, env.bodies, stream.pattern.blocks()) + preconditioner_doubles(stream, space);
}

template <Block B, class Preconditioner>
STICTION_HD_OUTLINE Index solve_with(B& block, const NewtonRoom& room, const Preconditioner& preconditioner,
                                     double tolerance) {
  return solve_gradients(block, room.H, preconditioner, room.force, room.step, room.gradients, tolerance,
                         kMostGradientSteps)
      .iterations;
}

/// H d = force for room.step; the steps that conjugate gradients took.
template <Block B>
STICTION_HD_OUTLINE Index solve_space(B& block, const NewtonRoom& room, const BodySpaceOptions& space,
                                      double tolerance) {
  const Index rows = room.stream.pattern.rows;
  switch (space.preconditioner) {
    case BodyPreconditioner::diagonal: {
      const ScalarDiagonal scalar{rows, room.preconditioner};
      scalar.prepare(block, room.H);
      return solve_with(block, room, scalar, tolerance);
    }
    case BodyPreconditioner::block_diagonal: {
      const BlockDiagonal diagonal{rows, room.preconditioner};
      diagonal.prepare(block, room.H);
      return solve_with(block, room, diagonal, tolerance);
    }
  }
  return 0;
}

}  // namespace stiction::inline STICTION_ISA
