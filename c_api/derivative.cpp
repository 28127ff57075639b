#include "stiction/derivative.hpp"

#include <cstddef>

#include "c_api/handles.hpp"
#include "c_api/structs.hpp"
#include "c_api/views.hpp"
#include "stiction/batch_arrays.hpp"

namespace stiction::c {

static_assert(sizeof(stiction_gradient_status) == sizeof(GradientStatus) &&
              offsetof(stiction_gradient_status, forward_residual) == offsetof(GradientStatus, forward_residual) &&
              offsetof(stiction_gradient_status, flags) == offsetof(GradientStatus, flags) &&
              offsetof(stiction_gradient_status, unknowns) == offsetof(GradientStatus, unknowns) &&
              offsetof(stiction_gradient_status, degenerate) == offsetof(GradientStatus, degenerate));
constexpr bool same(stiction_gradient_flag c, GradientFlag cpp) {
  return static_cast<std::uint32_t>(c) == static_cast<std::uint32_t>(cpp);
}
static_assert(same(STICTION_GRADIENT_INVALID_INPUT, kGradientInvalidInput) &&
              same(STICTION_GRADIENT_UNCONVERGED, kGradientUnconverged) &&
              same(STICTION_GRADIENT_NON_FINITE, kGradientNonFinite) &&
              same(STICTION_GRADIENT_SINGULAR, kGradientSingular) &&
              same(STICTION_GRADIENT_OVER_CAPACITY, kGradientOverCapacity) &&
              same(STICTION_GRADIENT_UNSTABLE_BRANCH, kGradientUnstableBranch) &&
              same(STICTION_GRADIENT_SUBGRADIENT, kGradientSubgradient) &&
              same(STICTION_GRADIENT_BAD_STRUCTURE, kGradientBadStructure));

namespace {

auto& derivatives() {
  static auto& table = *new HandleTable<::stiction_derivative, Derivative>(
      {"derivative", "stiction_derivative", "stiction_derivative_create"});
  return table;
}

DerivativeOptions options_of(const stiction_derivative_options& options) {
  need_zero("options.reserved", options.reserved);
  DerivativeOptions cpp;
  cpp.law = law_or_batch("options.law", options.law);
  cpp.residual_limit = options.residual_limit;
  cpp.tie_tolerance = options.tie_tolerance;
  cpp.max_unknowns = options.max_unknowns;
  cpp.threads = options.threads;
  cpp.kappa = options.kappa;
  return cpp;
}

template <class Real>
ReactionView<Real> reactions(const void* lambda, const stiction_status* status) {
  return {numbers<Real>(lambda), reinterpret_cast<const EnvStatus*>(status)};
}

GradientStatus* records(stiction_gradient_status* status) {
  return reinterpret_cast<GradientStatus*>(status);
}

template <class Real>
Real* room(void* array) {
  return static_cast<Real*>(array);
}

/// Cotangents or tangents of a batch's numbers, whose arrays have no type in C.
template <class Numbers, class Batch, class C>
Numbers numbers_of(const Batch& batch, const C& from) {
  Numbers numbers;
  for_each_change_array(
      batch, []<class Number>(const BatchArray&, Number*& to, void* array) { to = static_cast<Number*>(array); },
      numbers, from);
  return numbers;
}

/// Cotangents or tangents of the solved unknowns, of a batch without velocities.
template <class Number>
SolutionNumbers<Number> solution_numbers(const stiction_solution_numbers& from) {
  return {static_cast<Number*>(from.lambda), static_cast<Number*>(from.w)};
}
template <class Number>
JacobianSolutionNumbers<Number> jacobian_solution_numbers(const stiction_solution_numbers& from) {
  return {static_cast<Number*>(from.lambda), static_cast<Number*>(from.w), static_cast<Number*>(from.velocity)};
}
void need_no_velocity(const stiction_solution_numbers& from) {
  if (from.velocity != nullptr) refuse("cotangents.velocity is not null: a contact batch has no velocities");
}

/// Calls f with a null pointer to the batch's type of number.
template <class View, class F>
void with_numbers(const View& batch, F&& f) {
  with_real(precision_of("batch.precision", batch.precision), f);
}

}  // namespace

void set_defaults(stiction_derivative_options& options) {
  const DerivativeOptions cpp;
  options = {};
  options.size = sizeof options;
  options.residual_limit = cpp.residual_limit;
  options.tie_tolerance = cpp.tie_tolerance;
  options.law = STICTION_LAW_OF_BATCH;
  options.max_unknowns = cpp.max_unknowns;
  options.threads = cpp.threads;
  options.kappa = cpp.kappa;
}
void set_defaults(stiction_solution_numbers& numbers) {
  numbers = {};
  numbers.size = sizeof numbers;
}
void set_defaults(stiction_sweeps& sweeps) {
  const SweepsView<double> cpp;
  sweeps = {};
  sweeps.size = sizeof sweeps;
  sweeps.omega = cpp.omega;
  sweeps.count = cpp.count;
}
void set_defaults(stiction_batch_numbers& numbers) {
  numbers = {};
  numbers.size = sizeof numbers;
}
void set_defaults(stiction_jacobian_numbers& numbers) {
  numbers = {};
  numbers.size = sizeof numbers;
}

}  // namespace stiction::c

namespace c = stiction::c;

stiction_code stiction_derivative_options_init(stiction_derivative_options* options, size_t size) {
  return c::init_struct(options, size, "options");
}
stiction_code stiction_solution_numbers_init(stiction_solution_numbers* numbers, size_t size) {
  return c::init_struct(numbers, size, "numbers");
}
stiction_code stiction_sweeps_init(stiction_sweeps* sweeps, size_t size) {
  return c::init_struct(sweeps, size, "sweeps");
}
stiction_code stiction_batch_numbers_init(stiction_batch_numbers* numbers, size_t size) {
  return c::init_struct(numbers, size, "numbers");
}
stiction_code stiction_jacobian_numbers_init(stiction_jacobian_numbers* numbers, size_t size) {
  return c::init_struct(numbers, size, "numbers");
}

const char* stiction_gradient_flag_name(uint32_t flag) {
  return stiction::flag_name(static_cast<stiction::GradientFlag>(flag));
}

stiction_code stiction_derivative_create(const char* device, const stiction_derivative_options* options,
                                         const stiction_capacity* capacity, stiction_derivative** derivative) {
  return c::guarded([&] {
    c::need(device, "device", "choose auto, cpu, cuda, cuda:N or emulated");
    c::need(derivative, "derivative", "give it room for a handle");
    const auto made = stiction::Device::from_string(device);
    const auto chosen = c::options_of(c::read_optional(options, "options"));
    const auto room = c::to_cpp(c::read_optional(capacity, "capacity"));
    *derivative = c::derivatives().add(std::make_shared<stiction::Derivative>(made, chosen, room));
  });
}

stiction_code stiction_derivative_destroy(stiction_derivative* derivative) {
  return c::guarded([&] { c::derivatives().remove(derivative); });
}

stiction_code stiction_derivative_vjp(stiction_derivative* derivative, const stiction_batch_view* batch,
                                      const void* lambda, const stiction_status* status,
                                      const stiction_solution_numbers* cotangents,
                                      const stiction_batch_numbers* gradients,
                                      stiction_gradient_status* gradient_status, int64_t count, void* stream) {
  return c::guarded([&] {
    const auto object = c::derivatives().get(derivative);
    const auto given = c::read_struct(batch, "batch");
    const auto from = c::read_struct(cotangents, "cotangents");
    const auto to = c::read_struct(gradients, "gradients");
    c::need_no_velocity(from);
    c::with_numbers(given, [&](auto zero) {
      using Real = decltype(zero);
      const auto view = c::to_cpp<Real>(given);
      object->vjp(view, c::reactions<Real>(lambda, status), c::solution_numbers<const Real>(from),
                  c::numbers_of<stiction::BatchCotangentView<Real>>(view, to), c::records(gradient_status), count,
                  stiction::StreamRef(stream));
    });
  });
}

stiction_code stiction_derivative_unrolled_vjp(stiction_derivative* derivative, const stiction_batch_view* batch,
                                               const stiction_sweeps* sweeps,
                                               const stiction_solution_numbers* cotangents,
                                               const stiction_batch_numbers* gradients,
                                               stiction_gradient_status* gradient_status, int64_t count, void* stream) {
  return c::guarded([&] {
    const auto object = c::derivatives().get(derivative);
    const auto given = c::read_struct(batch, "batch");
    const auto of = c::read_struct(sweeps, "sweeps");
    const auto from = c::read_struct(cotangents, "cotangents");
    const auto to = c::read_struct(gradients, "gradients");
    c::need_zero("sweeps.reserved", of.reserved);
    c::need_no_velocity(from);
    c::with_numbers(given, [&](auto zero) {
      using Real = decltype(zero);
      const auto view = c::to_cpp<Real>(given);
      object->unrolled_vjp(view,
                           stiction::SweepsView<Real>{c::numbers<Real>(of.warm_start), of.count, of.omega,
                                                      c::room<Real>(of.lambda), c::room<Real>(of.by_warm_start)},
                           c::solution_numbers<const Real>(from),
                           c::numbers_of<stiction::BatchCotangentView<Real>>(view, to), c::records(gradient_status),
                           count, stiction::StreamRef(stream));
    });
  });
}

stiction_code stiction_derivative_jvp(stiction_derivative* derivative, const stiction_batch_view* batch,
                                      const void* lambda, const stiction_status* status,
                                      const stiction_batch_numbers* tangents, const stiction_solution_numbers* changes,
                                      stiction_gradient_status* gradient_status, int64_t count, void* stream) {
  return c::guarded([&] {
    const auto object = c::derivatives().get(derivative);
    const auto given = c::read_struct(batch, "batch");
    const auto from = c::read_struct(tangents, "tangents");
    const auto to = c::read_struct(changes, "changes");
    if (to.velocity != nullptr) c::refuse("changes.velocity is not null: a contact batch has no velocities");
    c::with_numbers(given, [&](auto zero) {
      using Real = decltype(zero);
      const auto view = c::to_cpp<Real>(given);
      object->jvp(view, c::reactions<Real>(lambda, status), c::numbers_of<stiction::BatchTangentView<Real>>(view, from),
                  c::solution_numbers<Real>(to), c::records(gradient_status), count, stiction::StreamRef(stream));
    });
  });
}

stiction_code stiction_derivative_vjp_jacobian(stiction_derivative* derivative, const stiction_jacobian_view* batch,
                                               const void* lambda, const stiction_status* status,
                                               const stiction_solution_numbers* cotangents,
                                               const stiction_jacobian_numbers* gradients,
                                               stiction_gradient_status* gradient_status, int64_t count, void* stream) {
  return c::guarded([&] {
    const auto object = c::derivatives().get(derivative);
    const auto given = c::read_struct(batch, "batch");
    const auto from = c::read_struct(cotangents, "cotangents");
    const auto to = c::read_struct(gradients, "gradients");
    c::with_numbers(given, [&](auto zero) {
      using Real = decltype(zero);
      const auto view = c::to_cpp<Real>(given);
      object->vjp(view, c::reactions<Real>(lambda, status), c::jacobian_solution_numbers<const Real>(from),
                  c::numbers_of<stiction::JacobianBatchCotangentView<Real>>(view, to), c::records(gradient_status),
                  count, stiction::StreamRef(stream));
    });
  });
}

stiction_code stiction_derivative_jvp_jacobian(stiction_derivative* derivative, const stiction_jacobian_view* batch,
                                               const void* lambda, const stiction_status* status,
                                               const stiction_jacobian_numbers* tangents,
                                               const stiction_solution_numbers* changes,
                                               stiction_gradient_status* gradient_status, int64_t count, void* stream) {
  return c::guarded([&] {
    const auto object = c::derivatives().get(derivative);
    const auto given = c::read_struct(batch, "batch");
    const auto from = c::read_struct(tangents, "tangents");
    const auto to = c::read_struct(changes, "changes");
    c::with_numbers(given, [&](auto zero) {
      using Real = decltype(zero);
      const auto view = c::to_cpp<Real>(given);
      object->jvp(
          view, c::reactions<Real>(lambda, status), c::numbers_of<stiction::JacobianBatchTangentView<Real>>(view, from),
          c::jacobian_solution_numbers<Real>(to), c::records(gradient_status), count, stiction::StreamRef(stream));
    });
  });
}

stiction_code stiction_derivative_synchronize(stiction_derivative* derivative, void* stream) {
  return c::guarded([&] { c::derivatives().get(derivative)->synchronize(stiction::StreamRef(stream)); });
}
