#include <optional>

#include "c_api/body_structure.hpp"
#include "c_api/handles.hpp"
#include "c_api/structs.hpp"
#include "c_api/views.hpp"
#include "stiction/bodies.hpp"

namespace stiction::c {

namespace {

/// A solver with its latest plans: of a host batch with its structure, and of a batch in device memory.
struct PlannedBodies {
  struct HostPlan {
    BodyPlan plan;
    BodyStructure structure;
  };
  BodySolver solver;
  std::optional<HostPlan> on_host;
  std::optional<BodyPlan> on_device;

  template <class Real>
  const BodyPlan& make_plan(const BodyBatchView<Real>& batch, StreamRef stream) {
    BodyPlan plan = solver.plan(batch, stream);
    if (batch.space != MemorySpace::host) return on_device.emplace(std::move(plan));
    BodyStructure structure(batch, solver.options().max_contacts_per_env > 0);
    return on_host.emplace(HostPlan{std::move(plan), std::move(structure)}).plan;
  }

  template <class Real>
  const BodyPlan& plan_of(const BodyBatchView<Real>& batch, StreamRef stream) {
    if (batch.space == MemorySpace::host) {
      if (on_host.has_value() && on_host->structure.is_of(batch)) return on_host->plan;
      return make_plan(batch, stream);
    }
    if (!on_device.has_value())
      refuse(
          "batch.space is cuda and the solver has no plan: call stiction_body_solver_plan before the first solve and "
          "whenever the structure changes");
    return *on_device;
  }
};

auto& body_solvers() {
  static auto& table = *new HandleTable<::stiction_body_solver, PlannedBodies>(
      {"solver", "stiction_body_solver", "stiction_body_solver_create"});
  return table;
}

}  // namespace

}  // namespace stiction::c

namespace c = stiction::c;

stiction_code stiction_body_solver_create(const char* device, const stiction_time_stepping* stepping,
                                          const stiction_body_options* options, stiction_body_solver** solver) {
  return c::guarded([&] {
    c::need(device, "device", "choose auto, cpu, cuda, cuda:N or emulated");
    c::need(solver, "solver", "give it room for a handle");
    const auto made = stiction::Device::from_string(device);
    const auto step = c::to_cpp(c::read_optional(stepping, "stepping"));
    const auto chosen = c::to_cpp(c::read_optional(options, "options"));
    *solver = c::body_solvers().add(std::make_shared<c::PlannedBodies>(
        c::PlannedBodies{stiction::BodySolver(made, step, chosen), std::nullopt, std::nullopt}));
  });
}

stiction_code stiction_body_solver_destroy(stiction_body_solver* solver) {
  return c::guarded([&] { c::body_solvers().remove(solver); });
}

stiction_code stiction_body_solver_plan(stiction_body_solver* solver, const stiction_body_view* batch, void* stream) {
  return c::guarded([&] {
    const auto object = c::body_solvers().get(solver);
    const stiction_body_view given = c::read_struct(batch, "batch");
    c::with_real(c::precision_of("batch.precision", given.precision),
                 [&](auto zero) { object->make_plan(c::to_cpp<decltype(zero)>(given), stiction::StreamRef(stream)); });
  });
}

stiction_code stiction_body_solver_solve(stiction_body_solver* solver, const stiction_body_view* batch,
                                         const stiction_body_solution* solution, const void* warm_start, void* stream) {
  return c::guarded([&] {
    const auto object = c::body_solvers().get(solver);
    const stiction_body_view given = c::read_struct(batch, "batch");
    const stiction_body_solution answer = c::read_struct(solution, "solution");
    c::with_real(c::precision_of("batch.precision", given.precision), [&](auto zero) {
      using Real = decltype(zero);
      const auto view = c::to_cpp<Real>(given);
      const stiction::StreamRef queue(stream);
      object->solver.solve(object->plan_of(view, queue), view, c::to_cpp<Real>(answer), c::numbers<Real>(warm_start),
                           queue);
    });
  });
}
