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

using AnySteppingSolver = std::variant<SteppingSolver<float>, SteppingSolver<double>>;

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
    std::visit(f, *object);
  });
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
    c::need(device, "device", "choose auto, cpu, cuda, cuda:N or emulated");
    c::need(solver, "solver", "give it room for a handle");
    const auto made = stiction::Device::from_string(device);
    const auto chosen = c::to_cpp(c::read_optional(options, "options"));
    const auto room = c::to_cpp(c::read_struct(capacity, "capacity"));
    const auto memory = c::to_cpp(c::read_optional(warm_start, "warm_start"));
    c::with_real(room.precision, [&](auto zero) {
      using Made = stiction::SteppingSolver<decltype(zero)>;
      *solver = c::stepping_solvers().add(
          std::make_shared<c::AnySteppingSolver>(std::in_place_type<Made>, made, chosen, room, memory));
    });
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
    c::with_typed(*object, precision, [&]<class Real>(stiction::SteppingSolver<Real>& typed) {
      typed.solve(c::to_cpp<Real>(given), cone_id, dt, c::to_cpp<Real>(answer), stiction::StreamRef(stream));
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
  return c::with_solver(solver, [&](auto& typed) { typed.solver().synchronize(stiction::StreamRef(stream)); });
}
