#include "stiction/solver.hpp"

#include <optional>

#include "c_api/handles.hpp"
#include "c_api/judge.hpp"
#include "c_api/structs.hpp"
#include "c_api/views.hpp"

namespace stiction::c {

namespace {

struct PlannedSolver {
  Solver solver;
  std::optional<Plan> plan;
};

auto& solvers() {
  static auto& table =
      *new HandleTable<::stiction_solver, PlannedSolver>({"solver", "stiction_solver", "stiction_solver_create"});
  return table;
}

/// Calls f with the C++ views of a batch and of its solution.
template <class F>
void with_views(const stiction_batch_view* batch, const stiction_solution* solution, F&& f) {
  const stiction_batch_view given = read_struct(batch, "batch");
  const stiction_solution answer = read_struct(solution, "solution");
  with_real(precision_of("batch.precision", given.precision), [&](auto zero) {
    using Real = decltype(zero);
    f(to_cpp<Real>(given), to_cpp<Real>(answer));
  });
}

}  // namespace

}  // namespace stiction::c

namespace c = stiction::c;

stiction_code stiction_capacity_of(const stiction_batch_view* batch, stiction_capacity* capacity) {
  return c::guarded([&] {
    const stiction_batch_view given = c::read_struct(batch, "batch");
    stiction_capacity full = c::read_struct(capacity, "capacity");
    c::with_real(c::precision_of("batch.precision", given.precision), [&](auto zero) {
      using Real = decltype(zero);
      const auto view = c::to_cpp<Real>(given);
      c::need_host(view.space);
      c::need_sound(view);
      const stiction::Capacity need = stiction::Capacity::of(view);
      full.envs = need.envs;
      full.rows = need.rows;
      full.cones = need.cones;
      full.nonzeros = need.nonzeros;
      full.env_nonzeros = need.env_nonzeros;
      full.env_rows = need.env_rows;
      full.env_dofs = need.env_dofs;
      full.precision = given.precision;
      full.semidefinite = need.semidefinite ? 1 : 0;
    });
    c::write_struct(capacity, full, capacity->size);
  });
}

stiction_code stiction_solver_create(const char* device, const stiction_solver_options* options,
                                     const stiction_capacity* capacity, stiction_solver** solver) {
  return c::guarded([&] {
    c::need(device, "device", "choose auto, cpu, cuda, cuda:N or emulated");
    c::need(solver, "solver", "give it room for a handle");
    const auto made = stiction::Device::from_string(device);
    const auto chosen = c::to_cpp(c::read_optional(options, "options"));
    const auto room = c::to_cpp(c::read_optional(capacity, "capacity"));
    *solver = c::solvers().add(
        std::make_shared<c::PlannedSolver>(c::PlannedSolver{stiction::Solver(made, chosen, room), std::nullopt}));
  });
}

stiction_code stiction_solver_destroy(stiction_solver* solver) {
  return c::guarded([&] { c::solvers().remove(solver); });
}

stiction_code stiction_solver_solve(stiction_solver* solver, const stiction_batch_view* batch,
                                    const stiction_solution* solution, const void* warm_start, void* stream) {
  return c::guarded([&] {
    const auto object = c::solvers().get(solver);
    c::with_views(batch, solution, [&]<class Real>(const stiction::ContactBatchView<Real>& view, const auto& answer) {
      object->solver.solve(view, answer, c::numbers<Real>(warm_start), stiction::StreamRef(stream));
    });
  });
}

stiction_code stiction_solver_plan(stiction_solver* solver, const stiction_batch_view* batch, void* stream) {
  return c::guarded([&] {
    const auto object = c::solvers().get(solver);
    const stiction_batch_view given = c::read_struct(batch, "batch");
    c::with_real(c::precision_of("batch.precision", given.precision), [&](auto zero) {
      object->plan = object->solver.plan(c::to_cpp<decltype(zero)>(given), stiction::StreamRef(stream));
    });
  });
}

stiction_code stiction_solver_solve_planned(stiction_solver* solver, const stiction_batch_view* batch,
                                            const stiction_solution* solution, const void* warm_start, void* stream) {
  return c::guarded([&] {
    const auto object = c::solvers().get(solver);
    if (!object->plan.has_value()) c::refuse("solver has no plan: call stiction_solver_plan first");
    c::with_views(batch, solution, [&]<class Real>(const stiction::ContactBatchView<Real>& view, const auto& answer) {
      object->solver.solve(*object->plan, view, answer, c::numbers<Real>(warm_start), stiction::StreamRef(stream));
    });
  });
}

stiction_code stiction_solver_synchronize(stiction_solver* solver, void* stream) {
  return c::guarded([&] { c::solvers().get(solver)->solver.synchronize(stiction::StreamRef(stream)); });
}
