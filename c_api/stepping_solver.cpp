#include <span>
#include <variant>

#include "c_api/handles.hpp"
#include "c_api/structs.hpp"
#include "c_api/typed.hpp"
#include "c_api/views.hpp"
#include "stiction/stepping.hpp"

namespace stiction::c {

static_assert(sizeof(stiction_warm_start_record) == sizeof(WarmStartRecord));

namespace {

using ContactSteps = std::variant<SteppingSolver<float>, SteppingSolver<double>>;
using JacobianSteps = std::variant<JacobianSteppingSolver<float>, JacobianSteppingSolver<double>>;
using BodySteps = std::variant<BodySteppingSolver<float>, BodySteppingSolver<double>>;
/// One kind of handle for every form of a batch: a loop resets, reports and waits alike.
using AnySteppingSolver = std::variant<ContactSteps, JacobianSteps, BodySteps>;

auto& stepping_solvers() {
  static auto& table = *new HandleTable<::stiction_stepping_solver, AnySteppingSolver>(
      {"solver", "stiction_stepping_solver", "stiction_stepping_solver_create"});
  return table;
}

/// Calls f with the solver behind a handle.
template <class F>
stiction_code with_solver(stiction_stepping_solver* solver, F&& f) {
  return guarded([&] {
    const auto object = stepping_solvers().get(solver);
    std::visit([&](auto& form) { std::visit(f, form); }, *object);
  });
}

/// The solver of a form, in either precision. \throws Error(invalid_argument) if the handle's is of another form.
template <class Steps>
Steps& of_form(AnySteppingSolver& any, const char* maker) {
  auto* const steps = std::get_if<Steps>(&any);
  if (steps == nullptr)
    refuse(std::string("solver is of another form of batches: make it with ") + maker + ", or call its own solve");
  return *steps;
}

/// Makes a solver of a form in that precision.
template <class Steps, template <class> class Made, class... Arguments>
stiction_stepping_solver* make(Precision precision, const Arguments&... arguments) {
  return with_real(precision, [&](auto zero) {
    using Solver = Made<decltype(zero)>;
    return stepping_solvers().add(
        std::make_shared<AnySteppingSolver>(std::in_place_type<Steps>, std::in_place_type<Solver>, arguments...));
  });
}

/// Returns the device that a new solver is for.
Device device_for(const char* device, stiction_stepping_solver** solver) {
  need(device, "device", "choose auto, cpu, cuda, cuda:N or emulated");
  need(solver, "solver", "give it room for a handle");
  return Device::from_string(device);
}

/// A list of the caller's. \throws Error(invalid_argument) for a negative count or no list.
template <class T>
std::span<T> list_of(T* list, const char* name, std::int64_t count) {
  if (count < 0) refuse("count = " + std::to_string(count) + ": give a number of environments >= 0");
  if (count > 0) need(list, name, "give one entry per environment");
  return {list, static_cast<std::size_t>(count)};
}

}  // namespace

}  // namespace stiction::c

namespace c = stiction::c;

stiction_code stiction_stepping_solver_create(const char* device, const stiction_solver_options* options,
                                              const stiction_capacity* capacity,
                                              const stiction_warm_start_options* warm_start,
                                              stiction_stepping_solver** solver) {
  return c::guarded([&] {
    const auto made = c::device_for(device, solver);
    const auto room = c::to_cpp(c::read_struct(capacity, "capacity"));
    *solver = c::make<c::ContactSteps, stiction::SteppingSolver>(room.precision, made,
                                                                 c::to_cpp(c::read_optional(options, "options")), room,
                                                                 c::to_cpp(c::read_optional(warm_start, "warm_start")));
  });
}

stiction_code stiction_stepping_solver_create_jacobian(const char* device, const stiction_solver_options* options,
                                                       const stiction_jacobian_capacity* capacity,
                                                       const stiction_warm_start_options* warm_start,
                                                       stiction_stepping_solver** solver) {
  return c::guarded([&] {
    const auto made = c::device_for(device, solver);
    const stiction_jacobian_capacity given = c::read_struct(capacity, "capacity");
    *solver = c::make<c::JacobianSteps, stiction::JacobianSteppingSolver>(
        c::precision_of("capacity.precision", given.precision), made, c::to_cpp(c::read_optional(options, "options")),
        c::to_cpp(given), c::to_cpp(c::read_optional(warm_start, "warm_start")),
        c::factor_use_of("capacity.factor_use", given.factor_use));
  });
}

stiction_code stiction_stepping_solver_create_bodies(const char* device, const stiction_time_stepping* stepping,
                                                     const stiction_body_options* options,
                                                     const stiction_capacity* capacity,
                                                     const stiction_warm_start_options* warm_start,
                                                     stiction_stepping_solver** solver) {
  return c::guarded([&] {
    const auto made = c::device_for(device, solver);
    const auto room = c::to_cpp(c::read_struct(capacity, "capacity"));
    *solver = c::make<c::BodySteps, stiction::BodySteppingSolver>(
        room.precision, made, c::to_cpp(c::read_optional(stepping, "stepping")),
        c::to_cpp(c::read_optional(options, "options")), room.envs, room.cones,
        c::to_cpp(c::read_optional(warm_start, "warm_start")));
  });
}

stiction_code stiction_stepping_solver_destroy(stiction_stepping_solver* solver) {
  return c::guarded([&] { c::stepping_solvers().remove(solver); });
}

stiction_code stiction_stepping_solver_solve(stiction_stepping_solver* solver, const stiction_batch_view* batch,
                                             const uint64_t* cone_id, double dt, const stiction_solution* solution,
                                             void* stream) {
  return c::guarded([&] {
    const auto object = c::stepping_solvers().get(solver);
    const stiction_batch_view given = c::read_struct(batch, "batch");
    const stiction_solution answer = c::read_struct(solution, "solution");
    const auto precision = c::precision_of("batch.precision", given.precision);
    auto& steps = c::of_form<c::ContactSteps>(*object, "stiction_stepping_solver_create");
    c::with_typed(steps, precision, [&]<class Real>(stiction::SteppingSolver<Real>& typed) {
      typed.solve(c::to_cpp<Real>(given), cone_id, dt, c::to_cpp<Real>(answer), stiction::StreamRef(stream));
    });
  });
}

stiction_code stiction_stepping_solver_solve_jacobian(stiction_stepping_solver* solver,
                                                      const stiction_jacobian_view* batch, const uint64_t* cone_id,
                                                      double dt, const stiction_jacobian_solution* solution,
                                                      void* stream) {
  return c::guarded([&] {
    const auto object = c::stepping_solvers().get(solver);
    const stiction_jacobian_view given = c::read_struct(batch, "batch");
    const stiction_jacobian_solution answer = c::read_struct(solution, "solution");
    const auto precision = c::precision_of("batch.precision", given.precision);
    auto& steps = c::of_form<c::JacobianSteps>(*object, "stiction_stepping_solver_create_jacobian");
    c::with_typed(steps, precision, [&]<class Real>(stiction::JacobianSteppingSolver<Real>& typed) {
      typed.solve(c::to_cpp<Real>(given), cone_id, dt, c::to_cpp<Real>(answer), stiction::StreamRef(stream));
    });
  });
}

stiction_code stiction_stepping_solver_solve_bodies(stiction_stepping_solver* solver, const stiction_body_view* batch,
                                                    const uint64_t* contact_id, const stiction_body_solution* solution,
                                                    void* stream) {
  return c::guarded([&] {
    const auto object = c::stepping_solvers().get(solver);
    const stiction_body_view given = c::read_struct(batch, "batch");
    const stiction_body_solution answer = c::read_struct(solution, "solution");
    const auto precision = c::precision_of("batch.precision", given.precision);
    auto& steps = c::of_form<c::BodySteps>(*object, "stiction_stepping_solver_create_bodies");
    c::with_typed(steps, precision, [&]<class Real>(stiction::BodySteppingSolver<Real>& typed) {
      stiction::BodyBatchView<Real> view = c::to_cpp<Real>(given);
      view.contact_id = contact_id;
      typed.solve(view, c::to_cpp<Real>(answer), stiction::StreamRef(stream));
    });
  });
}

stiction_code stiction_stepping_solver_reset(stiction_stepping_solver* solver, const int64_t* envs, int64_t count,
                                             void* stream) {
  return c::with_solver(
      solver, [&](auto& typed) { typed.reset(c::list_of(envs, "envs", count), stiction::StreamRef(stream)); });
}

stiction_code stiction_stepping_solver_reset_where(stiction_stepping_solver* solver, const uint8_t* mask,
                                                   void* stream) {
  return c::with_solver(solver, [&](auto& typed) { typed.reset_where(mask, stiction::StreamRef(stream)); });
}

stiction_code stiction_stepping_solver_reset_all(stiction_stepping_solver* solver, void* stream) {
  return c::with_solver(solver, [&](auto& typed) { typed.reset_all(stiction::StreamRef(stream)); });
}

stiction_code stiction_stepping_solver_records(stiction_stepping_solver* solver, stiction_warm_start_record* records,
                                               int64_t count, void* stream) {
  return c::with_solver(solver, [&](auto& typed) {
    const auto asked = c::list_of(records, "records", count);
    const auto same = std::span(reinterpret_cast<stiction::WarmStartRecord*>(asked.data()), asked.size());
    typed.store().records(same, stiction::StreamRef(stream));
  });
}

stiction_code stiction_stepping_solver_synchronize(stiction_stepping_solver* solver, void* stream) {
  return c::with_solver(solver, [&](auto& typed) { typed.synchronize(stiction::StreamRef(stream)); });
}
