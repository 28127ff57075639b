#pragma once

#include <nanobind/nanobind.h>

#include <mutex>
#include <optional>
#include <variant>
#include <vector>

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
  bool fixed = false;  ///< its structure never changes, so one plan serves every solve

  /// The plan of every solve, made by the first one.
  template <class Real>
  Plan plan(const Solver& solver, const ContactBatchView<Real>& batch) const {
    const std::lock_guard lock(planning_);
    if (!plan_) plan_ = solver.plan(batch);
    return *plan_;
  }

 private:
  mutable std::mutex planning_;  ///< solvers in several threads may share a batch
  mutable std::optional<Plan> plan_;
};
struct JacobianView : Held<JacobianBatchView> {};
struct BodyView : Held<BodyBatchView> {};

/// A vector of the batch without the room between environments.
template <class Real>
std::vector<Real> rows_in_use(const JacobianBatchView<Real>& batch, const Real* values) {
  std::vector<Real> packed;
  for (Offset env = 0; env < batch.env_count; ++env) {
    const Real* first = values + batch.env_row_offsets[env];
    packed.insert(packed.end(), first, first + batch.env_rows(env));
  }
  return packed;
}

/// A view of arrays that this process can read, as host memory.
template <class View>
View on_host(View view) {
  view.space = MemorySpace::host;
  return view;
}

void bind_views(nanobind::module_& module);

}  // namespace stiction::python
