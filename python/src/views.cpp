#include "python/src/views.hpp"

#include <nanobind/stl/string.h>

#include <string>
#include <type_traits>

#include "python/src/array.hpp"
#include "python/src/names.hpp"

namespace nb = nanobind;

namespace stiction::python {

namespace {

/// Arrays by name; what is not there is null.
class Fields {
 public:
  explicit Fields(const nb::dict& arrays) : arrays_(arrays) {}

  template <class T>
  void take(const char* name, const T*& target) const {
    if (const Array* array = find(name)) target = array->template read<T>(name);
  }
  /// An enumeration lies in memory as its number.
  void take_kinds(const char* name, const ConeKind*& target) const {
    if (const Array* array = find(name)) target = reinterpret_cast<const ConeKind*>(array->read<std::uint8_t>(name));
  }
  /// Bits, which frameworks without unsigned integers keep in signed ones.
  void take_flags(const char* name, const std::uint32_t*& target) const {
    const Array* array = find(name);
    if (array == nullptr) return;
    target = array->dtype() == "int32" ? reinterpret_cast<const std::uint32_t*>(array->read<std::int32_t>(name))
                                       : array->read<std::uint32_t>(name);
  }
  [[nodiscard]] Offset length(const char* name) const {
    const Array* array = find(name);
    return array == nullptr ? 0 : array->size();
  }

 private:
  [[nodiscard]] const Array* find(const char* name) const {
    return arrays_.contains(name) ? nb::cast<const Array*>(arrays_[name]) : nullptr;
  }

  const nb::dict& arrays_;
};

Offset parts(const Fields& fields, const char* offsets) {
  const Offset length = fields.length(offsets);
  return length > 0 ? length - 1 : 0;
}

template <class View>
void take_environments(const Fields& fields, View& view) {
  view.env_count = parts(fields, "env_row_offsets");
  view.cone_count = fields.length("cone_kind");
  view.row_count = parts(fields, "row_offsets");
  fields.take("env_row_offsets", view.env_row_offsets);
  fields.take("env_cone_offsets", view.env_cone_offsets);
  fields.take("env_row_counts", view.env_row_counts);
  fields.take("env_cone_counts", view.env_cone_counts);
  fields.take_flags("env_flags", view.env_flags);
  fields.take("env_tolerance", view.env_tolerance);
  fields.take("env_max_iterations", view.env_max_iterations);
  fields.take_kinds("cone_kind", view.cone_kind);
  fields.take("cone_row_offsets", view.cone_row_offsets);
  fields.take("cone_group", view.cone_group);
  fields.take("row_offsets", view.row_offsets);
  fields.take("column", view.column);
  fields.take("R", view.R);
  fields.take("mu", view.mu);
  fields.take("lo", view.lo);
  fields.take("hi", view.hi);
}

template <class Real>
ContactBatchView<Real> contact_view(const Fields& fields, Law law, MemorySpace space) {
  ContactBatchView<Real> view;
  take_environments(fields, view);
  view.nonzero_count = fields.length("A");
  fields.take("row_counts", view.row_counts);
  fields.take("column_offsets", view.column_offsets);
  view.column_count = fields.length("column");
  fields.take("A", view.A);
  fields.take("factor_offsets", view.factor_offsets);
  fields.take("factor", view.factor);
  view.factor_count = fields.length("factor");
  fields.take("b", view.b);
  fields.take("mu_offsets", view.mu_offsets);
  view.mu_count = fields.length("mu");
  view.law = law;
  view.space = space;
  return view;
}

template <class Real>
JacobianBatchView<Real> jacobian_view(const Fields& fields, Law law, MassForm form, Index mass_block,
                                      MemorySpace space) {
  JacobianBatchView<Real> view;
  take_environments(fields, view);
  view.dof_count = fields.length("v_free");
  view.entry_count = fields.length("J");
  view.mass_count = fields.length("M");
  fields.take("env_dof_offsets", view.env_dof_offsets);
  fields.take("env_mass_offsets", view.env_mass_offsets);
  fields.take("J", view.J);
  fields.take("M", view.M);
  fields.take("v_free", view.v_free);
  fields.take("target", view.target);
  view.mass_form = form;
  view.mass_block = mass_block;
  view.law = law;
  view.space = space;
  return view;
}

template <class Real>
BodyBatchView<Real> body_view(const Fields& fields, MemorySpace space) {
  BodyBatchView<Real> view;
  view.env_count = parts(fields, "env_body_offsets");
  view.body_count = fields.length("inv_mass");
  view.contact_count = fields.length("body_a");
  fields.take("env_body_offsets", view.env_body_offsets);
  fields.take("env_contact_offsets", view.env_contact_offsets);
  fields.take("inv_mass", view.inv_mass);
  fields.take("inv_inertia", view.inv_inertia);
  fields.take("twist", view.twist);
  fields.take("twist_change", view.twist_change);
  fields.take("kinematic", view.kinematic);
  fields.take("body_a", view.body_a);
  fields.take("body_b", view.body_b);
  fields.take("arm_a", view.arm_a);
  fields.take("arm_b", view.arm_b);
  fields.take("normal", view.normal);
  fields.take("mu", view.mu);
  fields.take("depth", view.depth);
  fields.take("restitution", view.restitution);
  view.space = space;
  return view;
}

MemorySpace space_of(bool on_device) {
  return on_device ? MemorySpace::cuda : MemorySpace::host;
}

}  // namespace

void bind_views(nb::module_& module) {
  nb::class_<ContactView>(module, "ContactView")
      .def(
          "__init__",
          [](ContactView* self, const nb::dict& arrays, bool wide, const std::string& law, bool on_device, bool fixed) {
            const Fields fields(arrays);
            new (self) ContactView;
            self->arrays = arrays;
            self->fixed = fixed;
            if (wide)
              self->view = contact_view<double>(fields, law_from(law), space_of(on_device));
            else
              self->view = contact_view<float>(fields, law_from(law), space_of(on_device));
          },
          nb::arg("arrays"), nb::arg("wide"), nb::arg("law"), nb::arg("on_device"), nb::arg("fixed"));
  nb::class_<JacobianView>(module, "JacobianView")
      .def(
          "__init__",
          [](JacobianView* self, const nb::dict& arrays, bool wide, const std::string& law, bool factored,
             Index mass_block, bool on_device) {
            const Fields fields(arrays);
            new (self) JacobianView{{arrays, {}}};
            const MassForm form = factored ? MassForm::factor : MassForm::matrix;
            if (wide)
              self->view = jacobian_view<double>(fields, law_from(law), form, mass_block, space_of(on_device));
            else
              self->view = jacobian_view<float>(fields, law_from(law), form, mass_block, space_of(on_device));
          },
          nb::arg("arrays"), nb::arg("wide"), nb::arg("law"), nb::arg("factored"), nb::arg("mass_block"),
          nb::arg("on_device"));
  nb::class_<BodyView>(module, "BodyView")
      .def(
          "__init__",
          [](BodyView* self, const nb::dict& arrays, bool wide, bool on_device) {
            const Fields fields(arrays);
            new (self) BodyView{{arrays, {}}};
            if (wide)
              self->view = body_view<double>(fields, space_of(on_device));
            else
              self->view = body_view<float>(fields, space_of(on_device));
          },
          nb::arg("arrays"), nb::arg("wide"), nb::arg("on_device"));
}

}  // namespace stiction::python
