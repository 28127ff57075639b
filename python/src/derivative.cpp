#include "stiction/derivative.hpp"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>

#include <memory>
#include <mutex>
#include <type_traits>

#include "python/src/captured_objects.hpp"
#include "python/src/names.hpp"
#include "python/src/solver.hpp"
#include "stiction/batch_arrays.hpp"

namespace nb = nanobind;

namespace stiction::python {

namespace {

/// Derivatives on one device, which takes its memory beforehand: made anew where it has too little room.
class FormDerivative {
 public:
  FormDerivative(Device device, const DerivativeOptions& options) : device_(device), options_(options) {
    if (device.kind != DeviceKind::cpu) room_.env_rows = 1;
    derivative_ = std::make_shared<Derivative>(device_, options_, room_);
  }

  /// f(derivative), with one that has room for the batch: for the given room, or its own need where its structure can
  /// be read here.
  template <class Batch, class Room, class F>
  void call(const Batch& batch, const std::optional<Room>& room, const F& f) {
    captured_.call(of(batch, room), f);
  }
  void synchronize(StreamRef stream) {
    std::shared_ptr<Derivative> last;
    {
      const std::lock_guard lock(mutex_);
      last = derivative_;
    }
    last->synchronize(stream);
  }
  [[nodiscard]] Device device() const noexcept { return device_; }

 private:
  template <class Real>
  std::shared_ptr<Derivative> of(const ContactBatchView<Real>& batch, const std::optional<Capacity>& room) {
    if (batch.space == MemorySpace::host) return derivative_;
    return with(room ? *room : Capacity::of(batch));
  }
  template <class Real>
  std::shared_ptr<Derivative> of(const JacobianBatchView<Real>& batch, const std::optional<JacobianCapacity>& room) {
    if (batch.space == MemorySpace::host) return derivative_;
    const JacobianCapacity own = room ? *room : JacobianCapacity::of(batch);
    Capacity need;
    need.envs = own.envs;
    need.rows = own.rows;
    need.env_rows = own.env_rows;
    need.env_dofs = own.env_dofs;
    return with(need);
  }
  std::shared_ptr<Derivative> with(const Capacity& need) {
    const std::lock_guard lock(mutex_);
    const Capacity room = larger_of(need, room_);
    if (!same(room, room_)) {
      derivative_ = std::make_shared<Derivative>(device_, options_, room);
      room_ = room;
    }
    return derivative_;
  }

  std::mutex mutex_;
  Device device_;
  DerivativeOptions options_;
  Capacity room_;
  std::shared_ptr<Derivative> derivative_;
  CapturedObjects captured_;
};

using ContactRoom = std::optional<Capacity>;
using JacobianRoom = std::optional<JacobianCapacity>;

/// Arrays by name; None and missing ones are null.
const Array* find(const nb::dict& arrays, const char* name) {
  if (!arrays.contains(name) || nb::object(arrays[name]).is_none()) return nullptr;
  return nb::cast<const Array*>(arrays[name]);
}
template <class Real>
const Real* input(const nb::dict& arrays, const char* name, Offset length) {
  return guess_of<Real>(find(arrays, name), length, name);
}
template <class Real>
Real* output(const nb::dict& arrays, const char* name, Offset length) {
  return room_for<Real>(find(arrays, name), name, length);
}

template <class Real>
ReactionView<Real> reactions(const Array& lambda, const Array* status, Offset rows, Offset envs) {
  const auto bytes = envs * static_cast<Offset>(sizeof(EnvStatus));
  return {guess_of<Real>(&lambda, rows, "lambda_"),
          reinterpret_cast<const EnvStatus*>(guess_of<std::uint8_t>(status, bytes, "status"))};
}
GradientStatus* records(const Array& status, Offset envs) {
  return reinterpret_cast<GradientStatus*>(
      room_for<std::uint8_t>(&status, "gradient_status", envs * static_cast<Offset>(sizeof(GradientStatus))));
}

/// Numbers of a batch by name, in so many sets: cotangents, each where it is asked for, or tangents.
template <class Numbers, class Batch>
Numbers numbers_of(const Batch& view, const nb::dict& arrays, Offset sets) {
  Numbers numbers;
  for_each_change_array(
      view,
      [&]<class Number>(const BatchArray& what, Number*& array) {
        using Real = std::remove_const_t<Number>;
        if constexpr (std::is_const_v<Number>)
          array = input<Real>(arrays, what.name, sets * what.length);
        else
          array = output<Real>(arrays, what.name, sets * what.length);
      },
      numbers);
  return numbers;
}

void vjp_contacts(FormDerivative& self, const ContactView& batch, const Array& lambda, const Array* status,
                  const nb::dict& cotangents, const nb::dict& gradients, const Array& gradient_status, Offset count,
                  std::uintptr_t stream, const ContactRoom& room) {
  std::visit(
      [&]<class Real>(const ContactBatchView<Real>& view) {
        const Offset rows = count * view.row_count;
        const auto at = reactions<Real>(lambda, status, view.row_count, view.env_count);
        const SolutionCotangentView<Real> from{input<Real>(cotangents, "lambda_", rows),
                                               input<Real>(cotangents, "w", rows)};
        const auto to = numbers_of<BatchCotangentView<Real>>(view, gradients, count);
        GradientStatus* const record = records(gradient_status, view.env_count);
        const nb::gil_scoped_release unlocked;
        self.call(view, room, [&](const Derivative& derivative) {
          derivative.vjp(view, at, from, to, record, count, stream_from(stream));
        });
      },
      batch.view);
}

void unrolled_contacts(FormDerivative& self, const ContactView& batch, const Array* warm_start, Index sweeps,
                       double omega, const nb::dict& cotangents, const nb::dict& gradients,
                       const Array& gradient_status, Offset count, std::uintptr_t stream, const ContactRoom& room) {
  std::visit(
      [&]<class Real>(const ContactBatchView<Real>& view) {
        const Offset rows = count * view.row_count;
        const SolutionCotangentView<Real> from{input<Real>(cotangents, "lambda_", rows),
                                               input<Real>(cotangents, "w", rows)};
        const auto to = numbers_of<BatchCotangentView<Real>>(view, gradients, count);
        const SweepsView<Real> of{guess_of<Real>(warm_start, view.row_count, "warm_start"), sweeps, omega,
                                  output<Real>(gradients, "lambda_", view.row_count),
                                  output<Real>(gradients, "warm_start", rows)};
        GradientStatus* const record = records(gradient_status, view.env_count);
        const nb::gil_scoped_release unlocked;
        self.call(view, room, [&](const Derivative& derivative) {
          derivative.unrolled_vjp(view, of, from, to, record, count, stream_from(stream));
        });
      },
      batch.view);
}

void jvp_contacts(FormDerivative& self, const ContactView& batch, const Array& lambda, const Array* status,
                  const nb::dict& tangents, const nb::dict& changes, const Array& gradient_status, Offset count,
                  std::uintptr_t stream, const ContactRoom& room) {
  std::visit(
      [&]<class Real>(const ContactBatchView<Real>& view) {
        const Offset rows = count * view.row_count;
        const auto at = reactions<Real>(lambda, status, view.row_count, view.env_count);
        const auto from = numbers_of<BatchTangentView<Real>>(view, tangents, count);
        const SolutionTangentView<Real> to{output<Real>(changes, "lambda_", rows), output<Real>(changes, "w", rows)};
        GradientStatus* const record = records(gradient_status, view.env_count);
        const nb::gil_scoped_release unlocked;
        self.call(view, room, [&](const Derivative& derivative) {
          derivative.jvp(view, at, from, to, record, count, stream_from(stream));
        });
      },
      batch.view);
}

void vjp_jacobian(FormDerivative& self, const JacobianView& batch, const Array& lambda, const Array* status,
                  const nb::dict& cotangents, const nb::dict& gradients, const Array& gradient_status, Offset count,
                  std::uintptr_t stream, const JacobianRoom& room) {
  std::visit(
      [&]<class Real>(const JacobianBatchView<Real>& view) {
        const Offset rows = count * view.row_count, dofs = count * view.dof_count;
        const auto at = reactions<Real>(lambda, status, view.row_count, view.env_count);
        const JacobianSolutionCotangentView<Real> from{input<Real>(cotangents, "lambda_", rows),
                                                       input<Real>(cotangents, "w", rows),
                                                       input<Real>(cotangents, "velocities", dofs)};
        const auto to = numbers_of<JacobianBatchCotangentView<Real>>(view, gradients, count);
        GradientStatus* const record = records(gradient_status, view.env_count);
        const nb::gil_scoped_release unlocked;
        self.call(view, room, [&](const Derivative& derivative) {
          derivative.vjp(view, at, from, to, record, count, stream_from(stream));
        });
      },
      batch.view);
}

void jvp_jacobian(FormDerivative& self, const JacobianView& batch, const Array& lambda, const Array* status,
                  const nb::dict& tangents, const nb::dict& changes, const Array& gradient_status, Offset count,
                  std::uintptr_t stream, const JacobianRoom& room) {
  std::visit(
      [&]<class Real>(const JacobianBatchView<Real>& view) {
        const Offset rows = count * view.row_count, dofs = count * view.dof_count;
        const auto at = reactions<Real>(lambda, status, view.row_count, view.env_count);
        const auto from = numbers_of<JacobianBatchTangentView<Real>>(view, tangents, count);
        const JacobianSolutionTangentView<Real> to{output<Real>(changes, "lambda_", rows),
                                                   output<Real>(changes, "w", rows),
                                                   output<Real>(changes, "velocities", dofs)};
        GradientStatus* const record = records(gradient_status, view.env_count);
        const nb::gil_scoped_release unlocked;
        self.call(view, room, [&](const Derivative& derivative) {
          derivative.jvp(view, at, from, to, record, count, stream_from(stream));
        });
      },
      batch.view);
}

}  // namespace

void bind_derivative(nb::module_& module) {
  nb::class_<FormDerivative>(module, "Derivative", "Derivatives of solutions on one device.")
      .def(
          "__init__",
          [](FormDerivative* self, const std::string& device, const std::optional<std::string>& law,
             double residual_limit, double tie_tolerance, Index max_unknowns, int threads, double kappa) {
            DerivativeOptions options;
            if (law) options.law = law_from(*law);
            options.residual_limit = residual_limit;
            options.tie_tolerance = tie_tolerance;
            options.max_unknowns = max_unknowns;
            options.threads = threads;
            options.kappa = kappa;
            new (self) FormDerivative(Device::from_string(device), options);
          },
          nb::arg("device"), nb::arg("law").none(), nb::arg("residual_limit"), nb::arg("tie_tolerance"),
          nb::arg("max_unknowns"), nb::arg("threads"), nb::arg("kappa"))
      .def("vjp_contacts", vjp_contacts, nb::arg("batch"), nb::arg("lambda_"), nb::arg("status").none(),
           nb::arg("cotangents"), nb::arg("gradients"), nb::arg("gradient_status"), nb::arg("count"),
           nb::arg("stream") = 0, nb::arg("room").none() = nb::none())
      .def("jvp_contacts", jvp_contacts, nb::arg("batch"), nb::arg("lambda_"), nb::arg("status").none(),
           nb::arg("tangents"), nb::arg("changes"), nb::arg("gradient_status"), nb::arg("count"), nb::arg("stream") = 0,
           nb::arg("room").none() = nb::none())
      .def("unrolled_contacts", unrolled_contacts, nb::arg("batch"), nb::arg("warm_start").none(), nb::arg("sweeps"),
           nb::arg("omega"), nb::arg("cotangents"), nb::arg("gradients"), nb::arg("gradient_status"), nb::arg("count"),
           nb::arg("stream") = 0, nb::arg("room").none() = nb::none())
      .def("vjp_jacobian", vjp_jacobian, nb::arg("batch"), nb::arg("lambda_"), nb::arg("status").none(),
           nb::arg("cotangents"), nb::arg("gradients"), nb::arg("gradient_status"), nb::arg("count"),
           nb::arg("stream") = 0, nb::arg("room").none() = nb::none())
      .def("jvp_jacobian", jvp_jacobian, nb::arg("batch"), nb::arg("lambda_"), nb::arg("status").none(),
           nb::arg("tangents"), nb::arg("changes"), nb::arg("gradient_status"), nb::arg("count"), nb::arg("stream") = 0,
           nb::arg("room").none() = nb::none())
      .def_prop_ro(
          "device", [](const FormDerivative& self) { return name_of(self.device()); }, "Its name: \"cpu\", \"cuda:0\".")
      .def(
          "synchronize",
          [](FormDerivative& self, std::uintptr_t stream) {
            const nb::gil_scoped_release unlocked;
            self.synchronize(stream_from(stream));
          },
          nb::arg("stream"));
  module.def(
      "gradient_flag_names",
      [] {
        nb::list names;
        for (std::uint32_t bit = 1; bit <= kGradientBadStructure; bit <<= 1U)
          names.append(flag_name(static_cast<GradientFlag>(bit)));
        return names;
      },
      "Names of a gradient's flags, by bit.");
}

}  // namespace stiction::python
