#include "c_api/enums.hpp"

#include <span>

#include "c_api/errors.hpp"
#include "c_api/named_values.hpp"

namespace stiction::c {

namespace {

constexpr int kCodeShift = 1;  ///< STICTION_OK stands before the errors

constexpr bool same(stiction_code code, ErrorCode error) {
  return static_cast<int>(code) == static_cast<int>(error) + kCodeShift;
}
static_assert(same(STICTION_INVALID_ARGUMENT, ErrorCode::invalid_argument));
static_assert(same(STICTION_BAD_FILE, ErrorCode::bad_file));
static_assert(same(STICTION_IO, ErrorCode::io));
static_assert(same(STICTION_OUT_OF_MEMORY, ErrorCode::out_of_memory));
static_assert(same(STICTION_NO_DEVICE, ErrorCode::no_device));
static_assert(same(STICTION_DEVICE_FAILURE, ErrorCode::device_failure));
static_assert(same(STICTION_UNSUPPORTED, ErrorCode::unsupported));

constexpr bool same(stiction_env_code code, EnvCode cpp) {
  return static_cast<int>(code) == static_cast<int>(cpp);
}
static_assert(same(STICTION_ENV_SOLVED, EnvCode::solved));
static_assert(same(STICTION_ENV_MAX_ITERATIONS, EnvCode::max_iterations));
static_assert(same(STICTION_ENV_STALLED, EnvCode::stalled));
static_assert(same(STICTION_ENV_NUMERICAL, EnvCode::numerical));
static_assert(same(STICTION_ENV_INVALID_INPUT, EnvCode::invalid_input));
static_assert(same(STICTION_ENV_UNSUPPORTED, EnvCode::unsupported));
static_assert(same(STICTION_ENV_ROUNDING, EnvCode::rounding));
static_assert(same(STICTION_ENV_INFEASIBLE, EnvCode::infeasible) && kEnvCodeCount == 8);

constexpr bool same(stiction_env_flag flag, EnvFlag cpp) {
  return static_cast<std::uint32_t>(flag) == static_cast<std::uint32_t>(cpp);
}
static_assert(same(STICTION_FLAG_NON_FINITE_INPUT, kFlagNonFiniteInput));
static_assert(same(STICTION_FLAG_NEGATIVE_FRICTION, kFlagNegativeFriction));
static_assert(same(STICTION_FLAG_CROSSED_BOUNDS, kFlagCrossedBounds));
static_assert(same(STICTION_FLAG_NEGATIVE_COMPLIANCE, kFlagNegativeCompliance));
static_assert(same(STICTION_FLAG_BAD_DIAGONAL, kFlagBadDiagonal));
static_assert(same(STICTION_FLAG_WARM_START_REJECTED, kFlagWarmStartRejected));
static_assert(same(STICTION_FLAG_ASYMMETRIC, kFlagAsymmetric));
static_assert(same(STICTION_FLAG_CONTACTS_DROPPED, kFlagContactsDropped));
static_assert(same(STICTION_FLAG_BAD_MASS, kFlagBadMass));
static_assert(same(STICTION_FLAG_OVER_CAPACITY, kFlagOverCapacity));
static_assert(same(STICTION_FLAG_BAD_STRUCTURE, kFlagBadStructure));
static_assert(same(STICTION_FLAG_UNSUPPORTED_CONE, kFlagUnsupportedCone));
static_assert(same(STICTION_FLAG_RAY, kFlagRay));
static_assert(same(STICTION_FLAG_IMMOVABLE, kFlagImmovable) && kEnvFlagCount == 14);

constexpr bool same(stiction_cone_kind kind, ConeKind cpp) {
  return static_cast<int>(kind) == static_cast<int>(cpp);
}
static_assert(same(STICTION_CONE_FREE, ConeKind::free) && same(STICTION_CONE_UNILATERAL, ConeKind::unilateral));
static_assert(same(STICTION_CONE_BOX, ConeKind::box) && same(STICTION_CONE_FRICTION, ConeKind::friction));
static_assert(same(STICTION_CONE_BOX_FRICTION, ConeKind::box_friction));
static_assert(same(STICTION_CONE_SEMIDEFINITE, ConeKind::semidefinite));

}  // namespace

std::int32_t checked(const char* field, std::int32_t value, std::span<const Named> known) {
  std::string names;
  for (const Named& one : known) {
    if (one.value == value) return value;
    names += (names.empty() ? "" : ", ") + std::string(one.name) + " (" + std::to_string(one.value) + ")";
  }
  refuse(std::string(field) + " = " + std::to_string(value) + " is none of its values; use one of: " + names);
}

stiction_code code_of(ErrorCode code) noexcept {
  return static_cast<stiction_code>(static_cast<int>(code) + kCodeShift);
}

Precision precision_of(const char* field, std::int32_t value) {
  return checked_as<Precision>(
      field, value, {STICTION_SAME(STICTION_F32, Precision::f32), STICTION_SAME(STICTION_F64, Precision::f64)});
}

MemorySpace space_of(const char* field, std::int32_t value) {
  return checked_as<MemorySpace>(
      field, value,
      {STICTION_SAME(STICTION_SPACE_HOST, MemorySpace::host), STICTION_SAME(STICTION_SPACE_CUDA, MemorySpace::cuda)});
}

Law law_of(const char* field, std::int32_t value) {
  return checked_as<Law>(
      field, value,
      {STICTION_SAME(STICTION_LAW_CONVEX, Law::convex), STICTION_SAME(STICTION_LAW_COULOMB, Law::coulomb)});
}

std::optional<Law> law_or_batch(const char* field, std::int32_t value) {
  if (value == STICTION_LAW_OF_BATCH) return std::nullopt;
  return law_of(field, value);
}

InvalidPolicy invalid_of(const char* field, std::int32_t value) {
  return checked_as<InvalidPolicy>(field, value,
                                   {STICTION_SAME(STICTION_INVALID_REJECT, InvalidPolicy::reject),
                                    STICTION_SAME(STICTION_INVALID_ISOLATE, InvalidPolicy::isolate)});
}

IslandMode islands_of(const char* field, std::int32_t value) {
  return checked_as<IslandMode>(field, value,
                                {STICTION_SAME(STICTION_ISLANDS_TOGETHER, IslandMode::together),
                                 STICTION_SAME(STICTION_ISLANDS_APART, IslandMode::apart)});
}

SolverChoice choice_of(const char* field, std::int32_t value) {
  return checked_as<SolverChoice>(field, value,
                                  {STICTION_SAME(STICTION_CHOICE_NAMED, SolverChoice::named),
                                   STICTION_SAME(STICTION_CHOICE_SPECTRUM, SolverChoice::spectrum)});
}

MassForm mass_form_of(const char* field, std::int32_t value) {
  return checked_as<MassForm>(
      field, value,
      {STICTION_SAME(STICTION_MASS_MATRIX, MassForm::matrix), STICTION_SAME(STICTION_MASS_FACTOR, MassForm::factor)});
}

FactorUse factor_use_of(const char* field, std::int32_t value) {
  return checked_as<FactorUse>(field, value,
                               {STICTION_SAME(STICTION_FACTOR_NEVER, FactorUse::never),
                                STICTION_SAME(STICTION_FACTOR_BY_SIZE, FactorUse::by_size),
                                STICTION_SAME(STICTION_FACTOR_ALWAYS, FactorUse::always)});
}

BodyMethod body_method_of(const char* field, std::int32_t value) {
  return checked_as<BodyMethod>(field, value,
                                {STICTION_SAME(STICTION_BODY_IMPULSES, BodyMethod::impulses),
                                 STICTION_SAME(STICTION_BODY_NEWTON, BodyMethod::newton)});
}

BodyPreconditioner preconditioner_of(const char* field, std::int32_t value) {
  return checked_as<BodyPreconditioner>(
      field, value,
      {STICTION_SAME(STICTION_PRECONDITIONER_DIAGONAL, BodyPreconditioner::diagonal),
       STICTION_SAME(STICTION_PRECONDITIONER_BLOCK_DIAGONAL, BodyPreconditioner::block_diagonal),
       STICTION_SAME(STICTION_PRECONDITIONER_INCOMPLETE_CHOLESKY, BodyPreconditioner::incomplete_cholesky),
       STICTION_SAME(STICTION_PRECONDITIONER_SPARSE_INVERSE, BodyPreconditioner::sparse_inverse),
       STICTION_SAME(STICTION_PRECONDITIONER_FACTOR, BodyPreconditioner::factor),
       STICTION_SAME(STICTION_PRECONDITIONER_MULTIGRID, BodyPreconditioner::multigrid)});
}
static_assert(kBodyPreconditionerCount == 6);

Prolongation prolongation_of(const char* field, std::int32_t value) {
  return checked_as<Prolongation>(field, value,
                                  {STICTION_SAME(STICTION_PROLONGATION_PLAIN, Prolongation::plain),
                                   STICTION_SAME(STICTION_PROLONGATION_SMOOTHED, Prolongation::smoothed)});
}

Cycle cycle_of(const char* field, std::int32_t value) {
  return checked_as<Cycle>(field, value,
                           {STICTION_SAME(STICTION_CYCLE_V, Cycle::v), STICTION_SAME(STICTION_CYCLE_W, Cycle::w)});
}

Ordering ordering_of(const char* field, std::int32_t value) {
  return checked_as<Ordering>(
      field, value,
      {STICTION_SAME(STICTION_ORDERING_NATURAL, Ordering::natural),
       STICTION_SAME(STICTION_ORDERING_REVERSE_CUTHILL_MCKEE, Ordering::reverse_cuthill_mckee),
       STICTION_SAME(STICTION_ORDERING_MINIMUM_DEGREE, Ordering::minimum_degree),
       STICTION_SAME(STICTION_ORDERING_SUITESPARSE_MINIMUM_DEGREE, Ordering::suitesparse_minimum_degree),
       STICTION_SAME(STICTION_ORDERING_NESTED_DISSECTION, Ordering::nested_dissection)});
}
static_assert(kOrderingCount == 5);

StepScaling step_scaling_of(const char* field, std::int32_t value) {
  return checked_as<StepScaling>(
      field, value,
      {STICTION_SAME(STICTION_STEP_CAPPED, StepScaling::capped), STICTION_SAME(STICTION_STEP_NONE, StepScaling::none),
       STICTION_SAME(STICTION_STEP_PROPORTIONAL, StepScaling::proportional)});
}

void need_zero(const char* field, std::int32_t value) {
  if (value != 0)
    refuse(std::string(field) + " = " + std::to_string(value) + ": must be 0, as the struct's init sets it");
}

bool yes_or_no(const char* field, std::int32_t value) {
  if (value != 0 && value != 1) refuse(std::string(field) + " = " + std::to_string(value) + ": must be 0 or 1");
  return value == 1;
}

}  // namespace stiction::c
