#pragma once

/// \file
/// How the solve of one environment ended, and names of codes.

#include <cstdint>
#include <string>

#include "stiction/types.hpp"

namespace stiction {

/// Outcome of the solve of one environment.
enum class EnvCode : std::uint8_t {
  solved = 0,          ///< residual finite and at most the tolerance
  max_iterations = 1,  ///< iteration limit reached; the best iterate seen is returned
  stalled = 2,         ///< no progress within the stall window, or the solver ended short of the tolerance; the best
                       ///< iterate seen is returned
  numerical = 3,       ///< the iteration left the finite numbers; the best finite iterate is returned
  invalid_input = 4,   ///< see the flags; lambda = 0 and w = 0 are returned
  unsupported = 5,     ///< the solver cannot treat this system (see the flags); lambda = 0, w = b
  rounding = 6,        ///< the residual is above the tolerance, and roundings of the reactions are all that is left of
                       ///< it: no solver gets below in this precision. The best iterate seen is returned
  infeasible = 7,      ///< solved but for contacts that cannot move (kFlagImmovable), which carry nothing
};

/// Number of EnvCode values; status counts are arrays of this length.
inline constexpr int kEnvCodeCount = 8;

/// Flags of one environment; any number of bits at once.
enum EnvFlag : std::uint32_t {
  kFlagNonFiniteInput = 1U << 0,      ///< NaN or infinity in A, b, R or mu, or NaN in a bound
  kFlagNegativeFriction = 1U << 1,    ///< some mu < 0
  kFlagCrossedBounds = 1U << 2,       ///< some lo > hi
  kFlagNegativeCompliance = 1U << 3,  ///< some R < 0
  kFlagBadDiagonal = 1U << 4,         ///< a non-free cone with a negative diagonal of A + R, or with a normal one of
                                      ///< zero in a row that is not zero
  kFlagWarmStartRejected = 1U << 5,   ///< the warm start or its square was not finite; started from zero
  kFlagAsymmetric = 1U << 6,          ///< A differs from its transpose by more than 1e-2 of its largest entry
  kFlagContactsDropped = 1U << 7,     ///< more contacts than there was room for; solved with those that are there
  kFlagBadMass = 1U << 8,             ///< a mass matrix that is not positive definite, or not finite
  kFlagOverCapacity = 1U << 9,        ///< larger than the solver's capacity allows; not solved (lambda = 0, w = b)
  kFlagBadStructure = 1U << 10,       ///< offsets, cones or columns out of order or range, found on the device; of
                                      ///< this environment nothing but the status is written
  kFlagUnsupportedCone = 1U << 11,    ///< a cone that the solver cannot treat: lemke and friction not boxed; apgd,
                                      ///< admm, newton, ipm and box_friction. Semidefinite and all but jacobi,
                                      ///< apgd and admm. Not solved
  kFlagRay = 1U << 12,                ///< lemke ended on a ray: it found no solution, and there may be none
  kFlagImmovable = 1U << 13,          ///< a row of A + R that is zero and that its law asks to move: nothing can push
                                      ///< it. Its contact carries nothing, all others are solved
};

/// Number of EnvFlag bits in use.
inline constexpr int kEnvFlagCount = 14;

/// The record every environment gets, on the device that solved it. 32 bytes, no padding.
struct EnvStatus {
  double residual;           ///< largest error of a contact over its island's scale (docs/math/residual.md)  [-]
  double residual_absolute;  ///< largest error of a contact  [w]
  std::uint32_t flags;       ///< EnvFlag bits
  std::int32_t iterations;   ///< iterations of the solver that answered
  EnvCode code;              ///< how it ended
  SolverKind solver;         ///< which solver answered
  std::uint8_t reserved[2];  ///< zero
  std::int32_t islands;      ///< islands that were solved apart (docs/howto/islands.md); 0: none was
};
static_assert(sizeof(EnvStatus) == 32);

/// Name of a code, as reports print it ("solved", "max_iterations", ...).
const char* to_string(EnvCode code) noexcept;
/// Name of one flag bit, as reports print it ("non_finite_input", ...).
const char* flag_name(EnvFlag flag) noexcept;
/// Name of a solver, as the command line takes it ("npgs", "auto", ...).
const char* to_string(SolverKind solver) noexcept;
/// Name of a law, as the command line takes it ("convex", "coulomb").
const char* to_string(Law law) noexcept;
/// Name of a precision, as reports print it ("f32", "f64").
const char* to_string(Precision precision) noexcept;
/// Name of a kind of cone, as reports print it ("friction", ...).
const char* to_string(ConeKind kind) noexcept;

/// The solver of that name. \throws Error(invalid_argument) that lists the names there are.
SolverKind solver_from_string(const std::string& name);

}  // namespace stiction
