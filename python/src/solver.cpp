#include "python/src/solver.hpp"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>

#include <type_traits>

#include "python/src/names.hpp"
#include "stiction/trace.hpp"

namespace nb = nanobind;

namespace stiction::python {

namespace {

/// Rules by name, of types that the package has checked; missing ones have the default.
SpectrumRules rules_from(const nb::dict& given) {
  SpectrumRules rules;
  const auto take = [&]<class T>(const char* name, T& to) {
    if (!given.contains(name)) return;
    if constexpr (std::is_same_v<T, SolverKind>)
      to = solver_from_string(nb::cast<std::string>(given[name]));
    else
      to = nb::cast<T>(given[name]);
  };
  take("steps", rules.steps);
  take("direct_condition", rules.direct_condition);
  take("direct_rows", rules.direct_rows);
  take("preconditioned_condition", rules.preconditioned_condition);
  take("sparse_density", rules.sparse_density);
  take("keep", rules.keep);
  take("direct", rules.direct);
  take("preconditioned", rules.preconditioned);
  take("decomposed", rules.decomposed);
  take("otherwise", rules.otherwise);
  return rules;
}

SolverOptions options_from(const std::string& solver, const std::optional<std::string>& law, double tolerance,
                           Index max_iterations, Index stall_window, double omega, int threads, bool isolate,
                           const std::string& islands, Index direct_rows, const std::string& choose,
                           const nb::dict& spectrum) {
  SolverOptions options;
  options.solver = solver_from_string(solver);
  if (law) options.law = law_from(*law);
  options.tolerance = tolerance;
  options.max_iterations = max_iterations;
  options.stall_window = stall_window;
  options.omega = omega;
  options.threads = threads;
  options.invalid = isolate ? InvalidPolicy::isolate : InvalidPolicy::reject;
  options.islands = island_mode_from_string(islands);
  options.direct_rows = direct_rows;
  options.choose = solver_choice_from_string(choose);
  options.spectrum = rules_from(spectrum);
  return options;
}

bool fits(const JacobianCapacity& need, const JacobianCapacity& room) {
  return need.envs <= room.envs && need.rows <= room.rows && need.cones <= room.cones &&
         need.env_rows <= room.env_rows && need.env_dofs <= room.env_dofs && need.matrix <= room.matrix &&
         need.factor <= room.factor && (!need.semidefinite || room.semidefinite);
}

Outputs outputs(const Array* lambda, const Array* w, const Array* velocity, const Array* status) {
  return {lambda, w, velocity, status};
}

}  // namespace

Capacity larger_of(const Capacity& a, const Capacity& b) {
  const auto larger = [](auto x, auto y) { return x < y ? y : x; };
  return {larger(a.envs, b.envs),         larger(a.rows, b.rows),           larger(a.cones, b.cones),
          larger(a.nonzeros, b.nonzeros), larger(a.env_rows, b.env_rows),   larger(a.env_nonzeros, b.env_nonzeros),
          larger(a.env_dofs, b.env_dofs), larger(a.precision, b.precision), a.semidefinite || b.semidefinite};
}

bool same(const Capacity& a, const Capacity& b) {
  return a.envs == b.envs && a.rows == b.rows && a.cones == b.cones && a.nonzeros == b.nonzeros &&
         a.env_rows == b.env_rows && a.env_nonzeros == b.env_nonzeros && a.env_dofs == b.env_dofs &&
         a.precision == b.precision && a.semidefinite == b.semidefinite;
}

template <class Real>
SolutionView<Real> solution_view(const Outputs& out, Offset row_count, Offset env_count) {
  const auto bytes = env_count * static_cast<Offset>(sizeof(EnvStatus));
  return {room_for<Real>(out.lambda, "lambda_", row_count), room_for<Real>(out.w, "w", row_count),
          reinterpret_cast<EnvStatus*>(room_for<std::uint8_t>(out.status, "status", bytes))};
}

template <class Real>
const Real* guess_of(const Array* array, Offset count, const char* name) {
  if (array == nullptr) return nullptr;
  if (array->size() < count)
    throw nb::value_error(
        (std::string(name) + ": expected " + std::to_string(count) + " numbers, got " + std::to_string(array->size()))
            .c_str());
  return array->read<Real>(name);
}

FormSolver::FormSolver(Device device, const SolverOptions& options, const Capacity& capacity)
    : capacity_(capacity), contact_(std::make_shared<Solver>(device, options, capacity)) {}

void FormSolver::reserve(const Capacity& need, StreamRef stream) {
  const Capacity room = larger_of(need, capacity_);
  if (same(room, capacity_)) return;
  contact_->synchronize(stream);
  contact_ = std::make_shared<Solver>(contact_->device(), contact_->options(), room);
  capacity_ = room;
}

void FormSolver::solve(const ContactView& batch, const Outputs& out, const Array* warm_start, StreamRef stream,
                       const std::optional<Capacity>& room) {
  std::visit(
      [&]<class Real>(const ContactBatchView<Real>& view) {
        const auto solution = solution_view<Real>(out, view.row_count, view.env_count);
        const Real* guess = guess_of<Real>(warm_start, view.row_count);
        const nb::gil_scoped_release unlocked;
        const std::lock_guard lock(mutex_);
        if (view.space != MemorySpace::host) reserve(room ? *room : Capacity::of(view), stream);
        if (!batch.fixed || view.space != MemorySpace::host) {
          captured_.call(contact_, [&](const Solver& solver) { solver.solve(view, solution, guess, stream); });
          return;
        }
        contact_->solve(batch.plan(*contact_, view), view, solution, guess, stream);
      },
      batch.view);
}

template <class Real>
std::shared_ptr<JacobianSolver<Real>> FormSolver::jacobian(const JacobianBatchView<Real>& batch,
                                                           const std::optional<JacobianCapacity>& room) {
  auto& solver = [this]() -> auto& {
    if constexpr (std::is_same_v<Real, float>)
      return jacobian_f32_;
    else
      return jacobian_f64_;
  }();
  const bool on_cpu = contact_->device().kind == DeviceKind::cpu;
  const JacobianCapacity need = on_cpu ? JacobianCapacity{} : room ? *room : JacobianCapacity::of(on_host(batch));
  if (!solver || !fits(need, solver->capacity()))
    solver = std::make_shared<JacobianSolver<Real>>(contact_->device(), contact_->options(), need);
  return solver;
}

void FormSolver::solve(const JacobianView& batch, const Outputs& out, const Start& start, StreamRef stream,
                       const std::optional<JacobianCapacity>& room) {
  std::visit(
      [&]<class Real>(const JacobianBatchView<Real>& view) {
        const auto contact = solution_view<Real>(out, view.row_count, view.env_count);
        Real* velocity = room_for<Real>(out.velocity, "velocities", view.dof_count);
        const JacobianStart<Real> guess{guess_of<Real>(start.reactions, view.row_count),
                                        guess_of<Real>(start.velocities, view.dof_count, "warm_velocities")};
        const nb::gil_scoped_release unlocked;
        const std::lock_guard lock(mutex_);
        captured_.call(jacobian(view, room), [&](JacobianSolver<Real>& solver) {
          solver.solve(view, {contact.lambda, contact.w, velocity, contact.status}, guess, stream);
        });
      },
      batch.view);
}

void FormSolver::synchronize(StreamRef stream) {
  const nb::gil_scoped_release unlocked;
  const std::lock_guard lock(mutex_);
  contact_->synchronize(stream);
}

void bind_solver(nb::module_& module) {
  nb::class_<Capacity>(module, "Capacity", "Room that a solver on a GPU takes when it is made.")
      .def(
          "__init__",
          [](Capacity* self, Offset envs, Offset rows, Offset cones, Offset nonzeros, Index env_rows,
             Offset env_nonzeros, Index env_dofs, bool wide, bool semidefinite) {
            new (self) Capacity{envs,        rows,         cones,    nonzeros,
                                env_rows,    env_nonzeros, env_dofs, wide ? Precision::f64 : Precision::f32,
                                semidefinite};
          },
          nb::arg("envs") = 0, nb::arg("rows") = 0, nb::arg("cones") = 0, nb::arg("nonzeros") = 0,
          nb::arg("env_rows") = 0, nb::arg("env_nonzeros") = 0, nb::arg("env_dofs") = 0, nb::arg("wide") = true,
          nb::arg("semidefinite") = false);
  nb::class_<JacobianCapacity>(module, "JacobianCapacity", "Room that a Jacobian solver on a GPU takes.")
      .def_static(
          "of_largest",
          [](Offset envs, Index env_rows, Index env_cones, Index env_dofs) {
            return JacobianCapacity::of_largest(envs, env_rows, env_cones, env_dofs);
          },
          nb::arg("envs"), nb::arg("env_rows"), nb::arg("env_cones"), nb::arg("env_dofs"))
      .def_rw("semidefinite", &JacobianCapacity::semidefinite);
  nb::class_<Tracer>(module, "Tracer", "Collects where the time of solves goes.")
      .def(nb::init<>())
      .def(
          "spans",
          [](const Tracer& tracer) {
            nb::list spans;
            for (const Span& span : tracer.spans())
              spans.append(nb::make_tuple(span.name, span.detail == nullptr ? "" : span.detail,
                                          span.place == SpanPlace::host ? "host" : "device", span.environments,
                                          span.duration));
            return spans;
          },
          "(name, detail, place, environments, duration [us]) of every span.")
      .def_prop_ro("left_out", &Tracer::left_out, "Spans for which there was no room.")
      .def("chrome_json", &Tracer::chrome_json, "The spans as Perfetto and chrome://tracing read them.");
  nb::class_<SolverOptions>(module, "Options", "Options of a solver, checked when the solver is made.")
      .def(
          "__init__",
          [](SolverOptions* self, const std::string& solver, const std::optional<std::string>& law, double tolerance,
             Index max_iterations, Index stall_window, double omega, int threads, bool isolate,
             const std::string& islands, Index direct_rows, Tracer* tracer, double absolute_tolerance,
             const std::string& choose, const nb::dict& spectrum, const std::string& blocks) {
            new (self) SolverOptions(options_from(solver, law, tolerance, max_iterations, stall_window, omega, threads,
                                                  isolate, islands, direct_rows, choose, spectrum));
            self->tracer = tracer;
            self->absolute_tolerance = absolute_tolerance;
            self->blocks = block_mode_from_string(blocks);
          },
          nb::arg("solver"), nb::arg("law").none(), nb::arg("tolerance"), nb::arg("max_iterations"),
          nb::arg("stall_window"), nb::arg("omega"), nb::arg("threads"), nb::arg("isolate"), nb::arg("islands"),
          nb::arg("direct_rows"), nb::arg("tracer").none(), nb::arg("absolute_tolerance") = 0.0,
          nb::arg("choose") = "named", nb::arg("spectrum") = nb::dict(), nb::arg("blocks") = "cones",
          nb::keep_alive<1, 12>());
  nb::class_<FormSolver>(module, "FormSolver", "Solvers of one device and one set of options, for every form.")
      .def(
          "__init__",
          [](FormSolver* self, const std::string& device, const SolverOptions& options, const Capacity& capacity) {
            new (self) FormSolver(Device::from_string(device), options, capacity);
          },
          nb::arg("device"), nb::arg("options"), nb::arg("capacity"), nb::keep_alive<1, 3>())
      .def(
          "solve_contacts",
          [](FormSolver& self, const ContactView& batch, const Array* lambda, const Array* w, const Array* status,
             const Array* warm_start, std::uintptr_t stream, const std::optional<Capacity>& room) {
            self.solve(batch, outputs(lambda, w, nullptr, status), warm_start, stream_from(stream), room);
          },
          nb::arg("batch"), nb::arg("lambda_"), nb::arg("w").none(), nb::arg("status"), nb::arg("warm_start").none(),
          nb::arg("stream"), nb::arg("room").none())
      .def(
          "solve_jacobian",
          [](FormSolver& self, const JacobianView& batch, const Array* lambda, const Array* w, const Array* velocity,
             const Array* status, const Array* warm_start, const Array* warm_velocities, std::uintptr_t stream,
             const std::optional<JacobianCapacity>& room) {
            self.solve(batch, outputs(lambda, w, velocity, status), Start{warm_start, warm_velocities},
                       stream_from(stream), room);
          },
          nb::arg("batch"), nb::arg("lambda_"), nb::arg("w").none(), nb::arg("velocities").none(), nb::arg("status"),
          nb::arg("warm_start").none(), nb::arg("warm_velocities").none(), nb::arg("stream"), nb::arg("room").none())
      .def(
          "synchronize", [](FormSolver& self, std::uintptr_t stream) { self.synchronize(stream_from(stream)); },
          nb::arg("stream"))
      .def_prop_ro(
          "device", [](const FormSolver& self) { return name_of(self.contact().device()); },
          "The device that \"auto\" became.");
}

template SolutionView<float> solution_view(const Outputs&, Offset, Offset);
template SolutionView<double> solution_view(const Outputs&, Offset, Offset);
template const float* guess_of(const Array*, Offset, const char*);
template const double* guess_of(const Array*, Offset, const char*);
template const std::uint8_t* guess_of(const Array*, Offset, const char*);

}  // namespace stiction::python
