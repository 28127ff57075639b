#include <nanobind/stl/string.h>

#include "python/src/names.hpp"
#include "python/src/solver.hpp"
#include "stiction/bodies.hpp"
#include "stiction/error.hpp"

namespace nb = nanobind;

namespace stiction::python {

namespace {

/// "newton" and "multigrid" are Newton's method, "pgs" plain sequential impulses, any other name those with momentum.
BodySolverOptions body_options(const SolverOptions& options, const std::string& solver) {
  BodySolverOptions body;
  body.blocks = options.blocks;
  const bool newton = solver == "newton" || solver == "multigrid";
  body.method = newton ? BodyMethod::newton : BodyMethod::impulses;
  body.momentum = solver != "pgs";
  if (solver == "newton") body.space.preconditioner = BodyPreconditioner::block_diagonal;
  body.iterations = options.max_iterations;
  body.tolerance = options.tolerance;
  body.absolute_tolerance = options.absolute_tolerance;
  body.omega = options.omega;
  body.threads = options.threads;
  body.invalid = options.invalid;
  return body;
}

/// A BodySolver whose calls wait for one another.
class SharedBodySolver {
 public:
  SharedBodySolver(Device device, const BodyOptions& options) : solver_(device, options.stepping, options.solver) {}

  void solve(const BodyView& batch, const Outputs& out, const Array* velocity, const Array* warm_start,
             StreamRef stream) {
    std::visit(
        [&]<class Real>(const BodyBatchView<Real>& view) {
          const auto contact = solution_view<Real>(out, 3 * view.contact_count, view.env_count);
          Real* twist = room_for<Real>(velocity, "velocities", 6 * view.body_count);
          const Real* guess = guess_of<Real>(warm_start, 3 * view.contact_count);
          const nb::gil_scoped_release unlocked;
          const std::lock_guard lock(mutex_);
          solver_.solve(view, {contact.lambda, twist, contact.w, contact.status}, guess, stream);
        },
        batch.view);
  }

 private:
  std::mutex mutex_;
  BodySolver solver_;
};

}  // namespace

void bind_body_solver(nb::module_& module) {
  nb::class_<BodyOptions>(module, "BodyOptions", "How bodies are stepped and solved.")
      .def(
          "__init__",
          [](BodyOptions* self, const SolverOptions& options, const std::string& solver, const std::string& law,
             double dt, double erp, double slop, double cfm, double restitution_threshold, Index substeps,
             Index max_contacts, bool asynchronous) {
            BodySolverOptions body = body_options(options, solver);
            body.box_friction = !options.law && law == "boxed";
            if (!body.box_friction) body.law = options.law ? *options.law : law_from(law);
            body.substeps = substeps;
            body.max_contacts_per_env = max_contacts;
            body.asynchronous = asynchronous;
            new (self) BodyOptions{{dt, erp, slop, cfm, restitution_threshold}, body};
          },
          nb::arg("options"), nb::arg("solver"), nb::arg("law"), nb::arg("dt"), nb::arg("erp"), nb::arg("slop"),
          nb::arg("cfm"), nb::arg("restitution_threshold"), nb::arg("substeps"), nb::arg("max_contacts"),
          nb::arg("asynchronous") = false);
  nb::class_<SharedBodySolver>(module, "BodySolver", "A solver of bodies on one device, with one set of options.")
      .def(
          "__init__",
          [](SharedBodySolver* self, const std::string& device, const BodyOptions& options) {
            new (self) SharedBodySolver(Device::from_string(device), options);
          },
          nb::arg("device"), nb::arg("options"))
      .def(
          "solve",
          [](SharedBodySolver& self, const BodyView& batch, const Array* lambda, const Array* w, const Array* velocity,
             const Array* status, const Array* warm_start, std::uintptr_t stream) {
            self.solve(batch, {lambda, w, nullptr, status}, velocity, warm_start, stream_from(stream));
          },
          nb::arg("batch"), nb::arg("lambda_"), nb::arg("w").none(), nb::arg("velocities"), nb::arg("status"),
          nb::arg("warm_start").none(), nb::arg("stream"));
}

}  // namespace stiction::python
