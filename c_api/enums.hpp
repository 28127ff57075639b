#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "stiction.h"
#include "stiction/bodies.hpp"
#include "stiction/error.hpp"
#include "stiction/jacobian.hpp"
#include "stiction/solver.hpp"
#include "stiction/warm_start.hpp"

/// Enumerators of the C interface as those of C++, whose numbers are the same (asserted in enums.cpp). A number of no
/// enumerator is refused with the field's name and the existing names.
namespace stiction::c {

stiction_code code_of(ErrorCode code) noexcept;

Precision precision_of(const char* field, std::int32_t value);
MemorySpace space_of(const char* field, std::int32_t value);
Law law_of(const char* field, std::int32_t value);
/// Law of options; without a value it is that of the batch.
std::optional<Law> law_or_batch(const char* field, std::int32_t value);
SolverKind solver_of(const char* field, std::int32_t value);
InvalidPolicy invalid_of(const char* field, std::int32_t value);
IslandMode islands_of(const char* field, std::int32_t value);
SolverChoice choice_of(const char* field, std::int32_t value);
MassForm mass_form_of(const char* field, std::int32_t value);
FactorUse factor_use_of(const char* field, std::int32_t value);
BodyMethod body_method_of(const char* field, std::int32_t value);
BodyPreconditioner preconditioner_of(const char* field, std::int32_t value);
Prolongation prolongation_of(const char* field, std::int32_t value);
Cycle cycle_of(const char* field, std::int32_t value);
Ordering ordering_of(const char* field, std::int32_t value);
StepScaling step_scaling_of(const char* field, std::int32_t value);

/// A field that a later version may give a meaning. \throws Error(invalid_argument) if it is not zero.
void need_zero(const char* field, std::int32_t value);
/// \throws Error(invalid_argument) if it is neither 0 nor 1.
bool yes_or_no(const char* field, std::int32_t value);

}  // namespace stiction::c
