#pragma once

/// \file
/// Options of Newton's method on the velocities of bodies.

#include <cstdint>
#include <string>

#include "stiction/ordering.hpp"

namespace stiction {

/// Method that solves bodies (docs/howto/bodies.md).
enum class BodyMethod : std::uint8_t {
  impulses = 0,  ///< sequential impulses (docs/math/si.md)
  newton = 1,    ///< inexact Newton's method on the bodies' velocities (docs/math/body_newton.md)
};

/// Preconditioner of the linear systems of Newton's method in body space.
enum class BodyPreconditioner : std::uint8_t {
  diagonal = 0,             ///< of the matrix
  block_diagonal = 1,       ///< each body separately
  incomplete_cholesky = 2,  ///< a factor without fill; its triangular solves are for CPUs
  sparse_inverse = 3,       ///< factored approximate inverse on the graph of bodies
  factor = 4,               ///< the whole factor: a direct solve
  multigrid = 5,            ///< aggregates of bodies that move rigidly (docs/math/multigrid.md)
};
/// Number of BodyPreconditioner values.
inline constexpr int kBodyPreconditionerCount = 6;

/// Map from a coarse body's motion to that of its members (docs/math/multigrid.md).
enum class Prolongation : std::uint8_t {
  plain = 0,     ///< rigidly
  smoothed = 1,  ///< rigidly, then one damped block-Jacobi step against the forces that this makes
};

/// Times that a cycle visits a coarser level for each visit of the finer one.
enum class Cycle : std::uint8_t {
  v = 1,  ///< once
  w = 2,  ///< twice
};

/// Cycle of the multigrid preconditioner between its levels (docs/math/multigrid.md).
struct MultigridOptions {
  Prolongation prolongation = Prolongation::smoothed;  ///< from a coarse level to a finer one
  Cycle cycle = Cycle::v;                              ///< visits of the coarser level
  bool operator==(const MultigridOptions&) const = default;
};

/// Options of Newton's method in body space, read when it plans.
struct BodySpaceOptions {
  BodyPreconditioner preconditioner = BodyPreconditioner::multigrid;  ///< of the conjugate gradients
  MultigridOptions multigrid;                                         ///< read by multigrid
  Ordering ordering = kDefaultOrdering;                               ///< read by factor and incomplete_cholesky
  bool operator==(const BodySpaceOptions&) const = default;
};

/// Name of a method, as reports print it ("impulses", "newton").
const char* to_string(BodyMethod method) noexcept;
/// Name of a preconditioner, as reports print it ("multigrid", ...).
const char* to_string(BodyPreconditioner preconditioner) noexcept;
/// The preconditioner of that name. \throws Error(invalid_argument) that lists the names there are.
BodyPreconditioner body_preconditioner_from_string(const std::string& name);

}  // namespace stiction
