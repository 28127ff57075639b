#include <string>

#include "stiction/body_space.hpp"
#include "stiction/derivative.hpp"
#include "stiction/error.hpp"
#include "stiction/status.hpp"

namespace stiction {
namespace {

/// Text for a value that no enumerator has, for instance of a record read back from a damaged file.
constexpr const char* kUnknown = "unknown";

}  // namespace

const char* to_string(EnvCode code) noexcept {
  switch (code) {
    case EnvCode::solved:
      return "solved";
    case EnvCode::max_iterations:
      return "max_iterations";
    case EnvCode::stalled:
      return "stalled";
    case EnvCode::numerical:
      return "numerical";
    case EnvCode::invalid_input:
      return "invalid_input";
    case EnvCode::unsupported:
      return "unsupported";
    case EnvCode::rounding:
      return "rounding";
    case EnvCode::infeasible:
      return "infeasible";
  }
  return kUnknown;
}

const char* flag_name(EnvFlag flag) noexcept {
  switch (flag) {
    case kFlagNonFiniteInput:
      return "non_finite_input";
    case kFlagNegativeFriction:
      return "negative_friction";
    case kFlagCrossedBounds:
      return "crossed_bounds";
    case kFlagNegativeCompliance:
      return "negative_compliance";
    case kFlagBadDiagonal:
      return "bad_diagonal";
    case kFlagWarmStartRejected:
      return "warm_start_rejected";
    case kFlagAsymmetric:
      return "asymmetric";
    case kFlagContactsDropped:
      return "contacts_dropped";
    case kFlagBadMass:
      return "bad_mass";
    case kFlagOverCapacity:
      return "over_capacity";
    case kFlagBadStructure:
      return "bad_structure";
    case kFlagUnsupportedCone:
      return "unsupported_cone";
    case kFlagRay:
      return "ray";
    case kFlagImmovable:
      return "immovable";
  }
  return kUnknown;
}

const char* flag_name(GradientFlag flag) noexcept {
  switch (flag) {
    case kGradientInvalidInput:
      return "invalid_input";
    case kGradientUnconverged:
      return "unconverged";
    case kGradientNonFinite:
      return "non_finite";
    case kGradientSingular:
      return "singular";
    case kGradientOverCapacity:
      return "over_capacity";
    case kGradientUnstableBranch:
      return "unstable_branch";
    case kGradientSubgradient:
      return "subgradient";
    case kGradientBadStructure:
      return "bad_structure";
  }
  return kUnknown;
}

const char* to_string(BodyMethod method) noexcept {
  switch (method) {
    case BodyMethod::impulses:
      return "impulses";
    case BodyMethod::newton:
      return "newton";
  }
  return kUnknown;
}

const char* to_string(BodyPreconditioner preconditioner) noexcept {
  switch (preconditioner) {
    case BodyPreconditioner::diagonal:
      return "diagonal";
    case BodyPreconditioner::block_diagonal:
      return "block_diagonal";
    case BodyPreconditioner::incomplete_cholesky:
      return "incomplete_cholesky";
    case BodyPreconditioner::sparse_inverse:
      return "sparse_inverse";
    case BodyPreconditioner::factor:
      return "factor";
    case BodyPreconditioner::multigrid:
      return "multigrid";
  }
  return kUnknown;
}

BodyPreconditioner body_preconditioner_from_string(const std::string& name) {
  std::string names;
  for (int kind = 0; kind < kBodyPreconditionerCount; ++kind) {
    const auto preconditioner = static_cast<BodyPreconditioner>(kind);
    if (name == to_string(preconditioner)) return preconditioner;
    names += std::string(kind == 0 ? "" : ", ") + to_string(preconditioner);
  }
  throw Error(ErrorCode::invalid_argument, "preconditioner '" + name + "' is not known; use one of: " + names);
}

const char* to_string(Law law) noexcept {
  switch (law) {
    case Law::convex:
      return "convex";
    case Law::coulomb:
      return "coulomb";
  }
  return kUnknown;
}

const char* to_string(Precision precision) noexcept {
  switch (precision) {
    case Precision::f32:
      return "f32";
    case Precision::f64:
      return "f64";
  }
  return kUnknown;
}

const char* to_string(ConeKind kind) noexcept {
  switch (kind) {
    case ConeKind::free:
      return "free";
    case ConeKind::unilateral:
      return "unilateral";
    case ConeKind::box:
      return "box";
    case ConeKind::friction:
      return "friction";
    case ConeKind::box_friction:
      return "box_friction";
    case ConeKind::semidefinite:
      return "semidefinite";
  }
  return kUnknown;
}

SolverKind solver_from_string(const std::string& name) {
  std::string names = to_string(SolverKind::automatic);
  if (name == names) return SolverKind::automatic;
  for (int kind = 0; kind < kSolverKindCount; ++kind) {
    const auto solver = static_cast<SolverKind>(kind);
    if (name == to_string(solver)) return solver;
    names += std::string(", ") + to_string(solver);
  }
  if (name == to_string(SolverKind::multigrid))
    throw Error(ErrorCode::invalid_argument,
                "solver 'multigrid' works on bodies, not on contact batches: give the bodies to a BodySolver with "
                "BodyMethod::newton (docs/howto/bodies.md); for a contact batch use one of: " +
                    names);
  if (name == to_string(SolverKind::velocity_newton))
    throw Error(ErrorCode::invalid_argument,
                "solver 'velocity_newton' works on J and M: give those (Batch.from_jacobian, JacobianSolver) to solver "
                "auto, which takes it there; for a contact batch use one of: " +
                    names);
  throw Error(ErrorCode::invalid_argument, "solver '" + name + "' is not known; use one of: " + names);
}

}  // namespace stiction
