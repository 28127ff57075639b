#pragma once

/// \file
/// Numbers of rows and cones, kinds of cones, laws and solvers.

#include <cstdint>

#include "stiction/config.hpp"

namespace stiction {

/// A row, cone or column inside one environment.
using Index = std::int32_t;
/// A position in an array that spans the whole batch.
using Offset = std::int64_t;

/// Kind of a cone; the values are those of the contact-batch file format.
enum class ConeKind : std::uint8_t {
  free = 0,        ///< 1 row, w = 0
  unilateral = 1,  ///< 1 row, 0 <= lambda _|_ w >= 0
  box = 2,         ///< 1 row, lo <= lambda <= hi; w >= 0 at lo, w <= 0 at hi, w = 0 inside
  friction = 3,    ///< 2..6 rows, normal first: lambda_n >= norm(lambda_t / mu), one mu per axis
  /// 2..6 rows, normal first: 0 <= lambda_n _|_ w_n >= 0, then |lambda_k| <= mu_k lambda_n axis by axis. w_k = 0
  /// inside,
  /// <= 0 at the upper bound, >= 0 at the lower. Boxed friction, as Bullet, DART, ODE and PhysX have it
  box_friction = 4,
  /// 3 or 6 rows: a symmetric matrix of order 2 or 3, its upper triangle column by column, off-diagonals times sqrt(2).
  /// lambda and w are positive semidefinite and lambda . w = 0 (docs/math/semidefinite.md)
  semidefinite = 5,
};

/// Returns true if a cone has a normal row and then rows with mu: friction or box_friction.
STICTION_HD constexpr bool carries_friction(ConeKind kind) {
  return kind == ConeKind::friction || kind == ConeKind::box_friction;
}

/// The largest number of rows of a friction cone: normal, two tangential, torsional, two rolling.
inline constexpr Index kMaxConeRows = 6;

/// Returns true if a cone of that kind can have so many rows.
STICTION_HD constexpr bool is_cone(ConeKind kind, Offset rows) {
  if (carries_friction(kind)) return rows >= 2 && rows <= kMaxConeRows;
  if (kind == ConeKind::semidefinite) return rows == 3 || rows == 6;
  return kind < ConeKind::friction && rows == 1;
}

/// Law of the friction cones. Cones of box_friction have their own, whichever this is.
enum class Law : std::uint8_t {
  convex = 0,   ///< associated law: lambda minimises 1/2 lambda'(A+R)lambda + b'lambda over the cones
  coulomb = 1,  ///< exact Coulomb law: w is replaced by w + (norm(mu * w_t), 0) (de Saxce 1998)
};

/// Type of the numbers of a batch.
enum class Precision : std::uint8_t {
  f32 = 0,  ///< `float`
  f64 = 1,  ///< `double`
};

/// A solver by its command-line name (docs/reference/cli.md).
enum class SolverKind : std::uint8_t {
  pgs = 0,                ///< projected Gauss-Seidel by cones
  npgs = 1,               ///< the same with momentum and restarts
  jacobi = 2,             ///< damped projected Jacobi
  apgd = 3,               ///< accelerated projected gradient descent
  nsgs = 4,               ///< Gauss-Seidel with the exact one-contact Coulomb solve
  admm = 5,               ///< operator splitting with a cached factor
  newton = 6,             ///< primal Newton where R > 0, proximal semismooth Newton elsewhere
  lemke = 7,              ///< complementary pivoting, for problems without friction cones but boxed ones
  ipm = 8,                ///< predictor-corrector interior point
  subspace = 9,           ///< npgs with steps to where all contacts keep sticking, sliding or being open
  end,                    ///< no solver: the number after those that can answer a contact batch
  velocity_newton = 253,  ///< Newton's method in velocities, where J and M are given: auto's first solver there
  multigrid = 254,        ///< of bodies alone: Newton's method with that preconditioner (docs/howto/bodies.md)
  automatic = 255,        ///< "auto": per environment, from its own features; a status names the one that answered
};
/// Solvers that can answer a contact batch.
inline constexpr int kSolverKindCount = static_cast<int>(SolverKind::end);

}  // namespace stiction
