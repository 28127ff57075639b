#include "stiction/jacobian_bodies.hpp"

#include <algorithm>
#include <span>
#include <variant>

#include "python/src/as_numpy.hpp"
#include "python/src/solver.hpp"
#include "stiction/batch_arrays.hpp"

namespace nb = nanobind;

namespace stiction::python {

namespace {

/// The bodies of a Jacobian batch, in its precision.
struct FoundBodies {
  std::variant<JacobianBodies<float>, JacobianBodies<double>> found;
};

template <class T>
auto numbers(const T* first, Offset count) {
  return std::span(first, static_cast<std::size_t>(count));
}

/// Arguments of Batch.from_bodies(), over the memory of `owner`.
template <class Real>
nb::dict arrays_of(const JacobianBodies<Real>& bodies, nb::handle owner) {
  const BodyBatchView<Real> from = bodies.batch.view();
  nb::dict to;
  to["body_offsets"] = as_numpy(numbers(from.env_body_offsets, from.env_count + 1), owner);
  to["contact_offsets"] = as_numpy(numbers(from.env_contact_offsets, from.env_count + 1), owner);
  const auto put = [&](const BatchArray& what, const auto* array) {
    to[what.name] = as_numpy(numbers(array, what.length), owner);
  };
  for_each_body_array(from.body_count, put, from);
  for_each_contact_array(from.contact_count, put, from);
  return to;
}

/// Writes turn(from) into `to`: three numbers a contact each.
template <class Turn>
void turn_into(const FoundBodies& self, const Array& from, const Array& to, const Turn& turn) {
  std::visit(
      [&]<class Real>(const JacobianBodies<Real>& bodies) {
        const auto* first = from.template read<Real>("values");
        const std::vector<Real> turned =
            turn(bodies, std::span<const Real>(first, static_cast<std::size_t>(from.size())));
        std::copy(turned.begin(), turned.end(), room_for<Real>(&to, "out", static_cast<Offset>(turned.size())));
      },
      self.found);
}

}  // namespace

void bind_jacobian_bodies(nb::module_& module) {
  nb::class_<FoundBodies>(module, "JacobianBodies", "Bodies and contacts of a batch that was given as J and M.")
      .def(
          "__init__",
          [](FoundBodies* self, const JacobianView& batch) {
            std::visit([self](const auto& view) { new (self) FoundBodies{as_bodies(view)}; }, batch.view);
          },
          nb::arg("batch"))
      .def("arrays",
           [](const nb::object& self) {
             return std::visit([&self](const auto& bodies) { return arrays_of(bodies, self); },
                               nb::cast<const FoundBodies&>(self).found);
           })
      .def_prop_ro("stepping",
                   [](const FoundBodies& self) {
                     const TimeStepping stepping =
                         std::visit([](const auto& found) { return found.stepping; }, self.found);
                     return nb::make_tuple(stepping.dt, stepping.erp, stepping.cfm);
                   })
      .def(
          "to_rows",
          [](const FoundBodies& self, const Array& values, const Array& out) {
            turn_into(self, values, out, [](const auto& bodies, auto from) { return to_rows(bodies, from); });
          },
          nb::arg("values"), nb::arg("out"))
      .def(
          "to_contacts",
          [](const FoundBodies& self, const Array& values, const Array& out) {
            turn_into(self, values, out, [](const auto& bodies, auto from) { return to_contacts(bodies, from); });
          },
          nb::arg("values"), nb::arg("out"));
}

}  // namespace stiction::python
