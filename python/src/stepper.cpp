#include <nanobind/stl/string.h>

#include <vector>

#include "python/src/names.hpp"
#include "python/src/solver.hpp"
#include "stiction/error.hpp"
#include "stiction/stepping.hpp"

namespace nb = nanobind;

namespace stiction::python {

namespace {

StepScaling scaling_from(const std::string& name) {
  if (name == "capped") return StepScaling::capped;
  if (name == "none") return StepScaling::none;
  if (name == "proportional") return StepScaling::proportional;
  throw Error(ErrorCode::invalid_argument,
              "scaling \"" + name + "\" is not known: use \"capped\", \"none\" or \"proportional\"");
}

/// Ids are any 64 bits.
const std::uint64_t* ids_of(const Array& ids) {
  if (ids.dtype() == "int64") return reinterpret_cast<const std::uint64_t*>(ids.read<std::int64_t>("ids"));
  return ids.read<std::uint64_t>("ids");
}

/// Truth is a byte.
const std::uint8_t* bytes_of(const Array& mask) {
  if (mask.dtype() == "bool") return reinterpret_cast<const std::uint8_t*>(mask.read<bool>("mask"));
  return mask.read<std::uint8_t>("mask");
}

/// A stepping solver of one form of batches, in their precision.
class Stepper {
 public:
  Stepper(Device device, const SolverOptions& options, const Capacity& capacity, const WarmStartOptions& warm_start) {
    make<SteppingSolver>(capacity.precision == Precision::f64, device, options, capacity, warm_start);
  }
  Stepper(Device device, const SolverOptions& options, const JacobianCapacity& capacity, bool wide,
          const WarmStartOptions& warm_start) {
    make<JacobianSteppingSolver>(wide, device, options, capacity, warm_start);
  }
  Stepper(Device device, const BodyOptions& options, Offset envs, Offset contacts, bool wide,
          const WarmStartOptions& warm_start) {
    make<BodySteppingSolver>(wide, device, options.stepping, options.solver, envs, contacts, warm_start);
  }

  void step(const ContactView& batch, const Array& ids, double dt, const Outputs& out, StreamRef stream) {
    run<SteppingSolver>(batch.view, [&]<class Real>(SteppingSolver<Real>& solver, const ContactBatchView<Real>& view) {
      const auto solution = solution_view<Real>(out, view.row_count, view.env_count);
      const std::uint64_t* id = ids_of(ids);
      return [=, &solver] { solver.solve(view, id, dt, solution, stream); };
    });
  }
  void step(const JacobianView& batch, const Array& ids, double dt, const Outputs& out, StreamRef stream) {
    run<JacobianSteppingSolver>(
        batch.view, [&]<class Real>(JacobianSteppingSolver<Real>& solver, const JacobianBatchView<Real>& view) {
          const auto contact = solution_view<Real>(out, view.row_count, view.env_count);
          Real* velocity = room_for<Real>(out.velocity, "velocities", view.dof_count);
          const std::uint64_t* id = ids_of(ids);
          return [=, &solver] {
            solver.solve(view, id, dt, {contact.lambda, contact.w, velocity, contact.status}, stream);
          };
        });
  }
  void step(const BodyView& batch, const Array& ids, const Outputs& out, StreamRef stream) {
    run<BodySteppingSolver>(batch.view, [&]<class Real>(BodySteppingSolver<Real>& solver, BodyBatchView<Real> view) {
      const auto contact = solution_view<Real>(out, 3 * view.contact_count, view.env_count);
      Real* twist = room_for<Real>(out.velocity, "velocities", 6 * view.body_count);
      view.contact_id = ids_of(ids);
      return [=, &solver] { solver.solve(view, {contact.lambda, twist, contact.w, contact.status}, stream); };
    });
  }
  /// Other time stepping from the next step on.
  void change(const BodyOptions& options) {
    visit([&](auto& solver) {
      if constexpr (requires { solver.change(options.stepping, options.solver); })
        solver.change(options.stepping, options.solver);
      else
        throw nb::type_error("change: expected a stepper of bodies");
    });
  }

  void reset(const std::vector<Offset>& envs, StreamRef stream) {
    visit([&](auto& solver) { solver.reset(envs, stream); });
  }
  void reset_where(const Array& mask, StreamRef stream) {
    const std::uint8_t* bytes = bytes_of(mask);
    visit([&](auto& solver) { solver.reset_where(bytes, stream); });
  }
  void reset_all(StreamRef stream) {
    visit([&](auto& solver) { solver.reset_all(stream); });
  }
  void synchronize(StreamRef stream) {
    visit([&](auto& solver) { solver.synchronize(stream); });
  }

  [[nodiscard]] Device device() const {
    return std::visit(
        [](const auto& solver) {
          if constexpr (requires { solver->solver().device(); })
            return solver->solver().device();
          else
            return solver->solver().solver().device();
        },
        solver_);
  }

  /// (hits, misses) of the last step, over all environments.
  std::pair<Offset, Offset> warm_start_counts(StreamRef stream) {
    std::pair<Offset, Offset> sum{0, 0};
    visit([&](auto& solver) {
      std::vector<WarmStartRecord> records(static_cast<std::size_t>(solver.store().capacity().envs));
      solver.store().records(records, stream);
      for (const WarmStartRecord& record : records) {
        sum.first += record.hits;
        sum.second += record.misses;
      }
    });
    return sum;
  }

 private:
  template <template <class> class Form, class... Arguments>
  void make(bool wide, const Arguments&... arguments) {
    if (wide)
      solver_ = std::make_unique<Form<double>>(arguments...);
    else
      solver_ = std::make_unique<Form<float>>(arguments...);
  }

  /// Reads arrays while Python waits, by prepare(solver, view), and lets Python go on while the returned work runs.
  template <template <class> class Form, class Views, class Prepare>
  void run(const Views& views, const Prepare& prepare) {
    std::visit(
        [&]<template <class> class View, class Real>(const View<Real>& view) {
          const auto* solver = std::get_if<std::unique_ptr<Form<Real>>>(&solver_);
          if (solver == nullptr) throw nb::type_error("batch: expected the form and precision of the solver");
          const auto solve = prepare(**solver, view);
          const nb::gil_scoped_release unlocked;
          const std::lock_guard lock(mutex_);
          solve();
        },
        views);
  }

  template <class Call>
  void visit(const Call& call) {
    const nb::gil_scoped_release unlocked;
    const std::lock_guard lock(mutex_);
    std::visit([&](auto& solver) { call(*solver); }, solver_);
  }

  std::mutex mutex_;
  std::variant<std::unique_ptr<SteppingSolver<float>>, std::unique_ptr<SteppingSolver<double>>,
               std::unique_ptr<JacobianSteppingSolver<float>>, std::unique_ptr<JacobianSteppingSolver<double>>,
               std::unique_ptr<BodySteppingSolver<float>>, std::unique_ptr<BodySteppingSolver<double>>>
      solver_;
};

std::vector<Offset> offsets_of(const nb::sequence& numbers) {
  std::vector<Offset> out;
  for (const nb::handle number : numbers) out.push_back(nb::cast<Offset>(number));
  return out;
}

}  // namespace

void bind_stepper(nb::module_& module) {
  nb::class_<Stepper>(module, "Stepper", "A solver and a store of reactions for one simulation loop.")
      .def(
          "__init__",
          [](Stepper* self, const std::string& device, const SolverOptions& options, const Capacity& capacity,
             double beta, const std::string& scaling) {
            new (self)
                Stepper(Device::from_string(device), options, capacity, {beta, scaling_from(scaling), options.threads});
          },
          nb::arg("device"), nb::arg("options"), nb::arg("capacity"), nb::arg("beta"), nb::arg("scaling"),
          nb::keep_alive<1, 3>())
      .def(
          "__init__",
          [](Stepper* self, const std::string& device, const SolverOptions& options, const JacobianCapacity& capacity,
             bool wide, double beta, const std::string& scaling) {
            new (self) Stepper(Device::from_string(device), options, capacity, wide,
                               {beta, scaling_from(scaling), options.threads});
          },
          nb::arg("device"), nb::arg("options"), nb::arg("capacity"), nb::arg("wide"), nb::arg("beta"),
          nb::arg("scaling"), nb::keep_alive<1, 3>())
      .def(
          "__init__",
          [](Stepper* self, const std::string& device, const BodyOptions& options, Offset envs, Offset contacts,
             bool wide, double beta, const std::string& scaling) {
            new (self) Stepper(Device::from_string(device), options, envs, contacts, wide,
                               {beta, scaling_from(scaling), options.solver.threads});
          },
          nb::arg("device"), nb::arg("options"), nb::arg("envs"), nb::arg("contacts"), nb::arg("wide"), nb::arg("beta"),
          nb::arg("scaling"))
      .def(
          "step",
          [](Stepper& self, const ContactView& batch, const Array& ids, double dt, const Array* lambda, const Array* w,
             const Array*, const Array* status,
             std::uintptr_t stream) { self.step(batch, ids, dt, {lambda, w, nullptr, status}, stream_from(stream)); },
          nb::arg("batch"), nb::arg("ids"), nb::arg("dt"), nb::arg("lambda_"), nb::arg("w").none(),
          nb::arg("velocities").none(), nb::arg("status"), nb::arg("stream"))
      .def(
          "step",
          [](Stepper& self, const JacobianView& batch, const Array& ids, double dt, const Array* lambda, const Array* w,
             const Array* velocities, const Array* status, std::uintptr_t stream) {
            self.step(batch, ids, dt, {lambda, w, velocities, status}, stream_from(stream));
          },
          nb::arg("batch"), nb::arg("ids"), nb::arg("dt"), nb::arg("lambda_"), nb::arg("w").none(),
          nb::arg("velocities").none(), nb::arg("status"), nb::arg("stream"))
      .def(
          "step",
          [](Stepper& self, const BodyView& batch, const Array& ids, double, const Array* lambda, const Array* w,
             const Array* velocities, const Array* status,
             std::uintptr_t stream) { self.step(batch, ids, {lambda, w, velocities, status}, stream_from(stream)); },
          nb::arg("batch"), nb::arg("ids"), nb::arg("dt"), nb::arg("lambda_"), nb::arg("w").none(),
          nb::arg("velocities"), nb::arg("status"), nb::arg("stream"))
      .def(
          "change", [](Stepper& self, const BodyOptions& options) { self.change(options); }, nb::arg("options"),
          "Other time stepping of bodies, from the next step on.")
      .def(
          "reset",
          [](Stepper& self, const nb::sequence& envs, std::uintptr_t stream) {
            self.reset(offsets_of(envs), stream_from(stream));
          },
          nb::arg("envs"), nb::arg("stream"))
      .def(
          "reset_where",
          [](Stepper& self, const Array& mask, std::uintptr_t stream) { self.reset_where(mask, stream_from(stream)); },
          nb::arg("mask"), nb::arg("stream"))
      .def(
          "reset_all", [](Stepper& self, std::uintptr_t stream) { self.reset_all(stream_from(stream)); },
          nb::arg("stream"))
      .def(
          "synchronize", [](Stepper& self, std::uintptr_t stream) { self.synchronize(stream_from(stream)); },
          nb::arg("stream"))
      .def_prop_ro(
          "device", [](const Stepper& self) { return name_of(self.device()); }, "The device that \"auto\" became.")
      .def(
          "warm_start_counts",
          [](Stepper& self, std::uintptr_t stream) {
            const auto [hits, misses] = self.warm_start_counts(stream_from(stream));
            return nb::make_tuple(hits, misses);
          },
          nb::arg("stream"), "(hits, misses) of the last step.");
}

}  // namespace stiction::python
