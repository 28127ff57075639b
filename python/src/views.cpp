#include "python/src/views.hpp"

#include <nanobind/stl/string.h>

#include <string>
#include <type_traits>

#include "python/src/array.hpp"
#include "python/src/names.hpp"
#include "stiction/batch_arrays.hpp"

namespace nb = nanobind;

namespace stiction::python {

namespace {

/// Arrays by name; missing ones are null.
class Fields {
 public:
  explicit Fields(const nb::dict& arrays) : arrays_(arrays) {}

  /// Points one of a view's arrays at that of its name. An enumeration lies in memory as its number. Bits are kept in
  /// signed integers by frameworks without others.
  template <class T>
  void operator()(const BatchArray& what, const T*& target) const {
    const Array* const array = find(what.name);
    if (array == nullptr) return;
    if constexpr (std::is_enum_v<T>)
      target = reinterpret_cast<const T*>(array->read<std::underlying_type_t<T>>(what.name));
    else if constexpr (std::is_same_v<T, std::uint32_t>)
      target = array->dtype() == "int32" ? reinterpret_cast<const T*>(array->read<std::int32_t>(what.name))
                                         : array->read<T>(what.name);
    else
      target = array->template read<T>(what.name);
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

void count_rows(const Fields& fields, BatchLayout& view) {
  view.env_count = parts(fields, "env_row_offsets");
  view.cone_count = fields.length("cone_kind");
  view.row_count = parts(fields, "row_offsets");
}

template <class Real>
ContactBatchView<Real> contact_view(const Fields& fields, Law law, MemorySpace space) {
  ContactBatchView<Real> view;
  count_rows(fields, view);
  view.nonzero_count = fields.length("A");
  view.column_count = fields.length("column");
  view.factor_count = fields.length("factor");
  view.mu_count = fields.length("mu");
  for_each_array(view, fields, view);
  view.law = law;
  view.space = space;
  return view;
}

template <class Real>
JacobianBatchView<Real> jacobian_view(const Fields& fields, Law law, MassForm form, Index mass_block,
                                      MemorySpace space) {
  JacobianBatchView<Real> view;
  count_rows(fields, view);
  view.dof_count = fields.length("v_free");
  view.entry_count = fields.length("J");
  view.mass_count = fields.length("M");
  for_each_array(view, fields, view);
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
  for_each_array(view, fields, view);
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
