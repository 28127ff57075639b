#pragma once

#include <nanobind/nanobind.h>

#include <optional>
#include <variant>

#include "stiction/batch.hpp"
#include "stiction/bodies.hpp"
#include "stiction/jacobian.hpp"
#include "stiction/solver.hpp"

namespace stiction::python {

/// A view over arrays that it keeps alive, in either precision.
template <template <class> class View>
struct Held {
  nanobind::dict arrays;  ///< name -> Array
  std::variant<View<float>, View<double>> view;
};

struct ContactView : Held<ContactBatchView> {
  bool fixed = false;                ///< its structure never changes, so one plan serves every solve
  mutable std::optional<Plan> plan;  ///< made by the first solve that may keep it
};
struct JacobianView : Held<JacobianBatchView> {};
struct BodyView : Held<BodyBatchView> {};

void bind_views(nanobind::module_& module);

}  // namespace stiction::python
