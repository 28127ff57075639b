#include "stiction/jacobian_solver.hpp"

#include <type_traits>
#include <variant>

#include "c_api/handles.hpp"
#include "c_api/judge.hpp"
#include "c_api/structs.hpp"
#include "c_api/typed.hpp"
#include "c_api/views.hpp"

namespace stiction::c {

namespace {

using AnyJacobianSolver = std::variant<JacobianSolver<float>, JacobianSolver<double>>;

auto& jacobian_solvers() {
  static auto& table = *new HandleTable<::stiction_jacobian_solver, AnyJacobianSolver>(
      {"solver", "stiction_jacobian_solver", "stiction_jacobian_solver_create"});
  return table;
}

/// A caller's capacity with its batches' needs filled in.
void set_need(stiction_jacobian_capacity& capacity, const JacobianCapacity& need) {
  capacity.envs = need.envs;
  capacity.rows = need.rows;
  capacity.cones = need.cones;
  capacity.matrix = need.matrix;
  capacity.factor = need.factor;
  capacity.env_rows = need.env_rows;
  capacity.env_dofs = need.env_dofs;
  capacity.semidefinite = need.semidefinite ? 1 : 0;
}

}  // namespace

}  // namespace stiction::c

namespace c = stiction::c;

stiction_code stiction_jacobian_capacity_of(const stiction_jacobian_view* batch, stiction_jacobian_capacity* capacity) {
  return c::guarded([&] {
    const stiction_jacobian_view given = c::read_struct(batch, "batch");
    stiction_jacobian_capacity full = c::read_struct(capacity, "capacity");
    const auto use = c::factor_use_of("capacity.factor_use", full.factor_use);
    c::with_real(c::precision_of("batch.precision", given.precision), [&](auto zero) {
      const auto view = c::to_cpp<decltype(zero)>(given);
      c::need_host(view.space);
      c::set_need(full, stiction::JacobianCapacity::of(view, use));
    });
    full.precision = given.precision;
    c::write_struct(capacity, full, capacity->size);
  });
}

stiction_code stiction_jacobian_capacity_of_largest(int64_t envs, int32_t env_rows, int32_t env_cones, int32_t env_dofs,
                                                    stiction_jacobian_capacity* capacity) {
  return c::guarded([&] {
    stiction_jacobian_capacity full = c::read_struct(capacity, "capacity");
    const auto use = c::factor_use_of("capacity.factor_use", full.factor_use);
    c::set_need(full, stiction::JacobianCapacity::of_largest(envs, env_rows, env_cones, env_dofs, use));
    c::write_struct(capacity, full, capacity->size);
  });
}

stiction_code stiction_jacobian_solver_create(const char* device, const stiction_solver_options* options,
                                              const stiction_jacobian_capacity* capacity,
                                              stiction_jacobian_solver** solver) {
  return c::guarded([&] {
    c::need(device, "device", "choose auto, cpu, cuda, cuda:N or emulated");
    c::need(solver, "solver", "give it room for a handle");
    const auto made = stiction::Device::from_string(device);
    const auto chosen = c::to_cpp(c::read_optional(options, "options"));
    const stiction_jacobian_capacity given = c::read_struct(capacity, "capacity");
    const auto room = c::to_cpp(given);
    const auto use = c::factor_use_of("capacity.factor_use", given.factor_use);
    c::with_real(c::precision_of("capacity.precision", given.precision), [&](auto zero) {
      using Made = stiction::JacobianSolver<decltype(zero)>;
      *solver = c::jacobian_solvers().add(
          std::make_shared<c::AnyJacobianSolver>(std::in_place_type<Made>, made, chosen, room, use));
    });
  });
}

stiction_code stiction_jacobian_solver_destroy(stiction_jacobian_solver* solver) {
  return c::guarded([&] { c::jacobian_solvers().remove(solver); });
}

stiction_code stiction_jacobian_solver_solve(stiction_jacobian_solver* solver, const stiction_jacobian_view* batch,
                                             const stiction_jacobian_solution* solution, const void* warm_start,
                                             void* stream) {
  return stiction_jacobian_solver_solve_from(solver, batch, solution, warm_start, nullptr, stream);
}

stiction_code stiction_jacobian_solver_solve_from(stiction_jacobian_solver* solver, const stiction_jacobian_view* batch,
                                                  const stiction_jacobian_solution* solution, const void* warm_start,
                                                  const void* warm_velocities, void* stream) {
  return c::guarded([&] {
    const auto object = c::jacobian_solvers().get(solver);
    const stiction_jacobian_view given = c::read_struct(batch, "batch");
    const stiction_jacobian_solution answer = c::read_struct(solution, "solution");
    const auto precision = c::precision_of("batch.precision", given.precision);
    c::with_typed(*object, precision, [&]<class Real>(stiction::JacobianSolver<Real>& typed) {
      const stiction::JacobianStart<Real> start{c::numbers<Real>(warm_start), c::numbers<Real>(warm_velocities)};
      typed.solve(c::to_cpp<Real>(given), c::to_cpp<Real>(answer), start, stiction::StreamRef(stream));
    });
  });
}

stiction_code stiction_jacobian_solver_synchronize(stiction_jacobian_solver* solver, void* stream) {
  return c::guarded([&] {
    const auto object = c::jacobian_solvers().get(solver);
    std::visit([&](const auto& typed) { typed.synchronize(stiction::StreamRef(stream)); }, *object);
  });
}
