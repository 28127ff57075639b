#pragma once

#include <nanobind/nanobind.h>

#include <memory>
#include <mutex>
#include <optional>
#include <variant>

#include "python/src/array.hpp"
#include "python/src/captured_objects.hpp"
#include "python/src/views.hpp"
#include "stiction/bodies.hpp"
#include "stiction/jacobian_solver.hpp"
#include "stiction/solver.hpp"

namespace stiction::python {

/// Arrays that a solve writes; those that may be left out are null.
struct Outputs {
  const Array* lambda = nullptr;
  const Array* w = nullptr;
  const Array* velocity = nullptr;
  const Array* status = nullptr;
};

/// Start of a solve of J and M; arrays that are not given are null.
struct Start {
  const Array* reactions = nullptr;
  const Array* velocities = nullptr;
};

/// Options of steps and solves of bodies.
struct BodyOptions {
  TimeStepping stepping;
  BodySolverOptions solver;
};

/// The C++ solvers of one device and one set of options for matrices and for Jacobians. Calls from several threads wait
/// for one another.
class FormSolver {
 public:
  FormSolver(Device device, const SolverOptions& options, const Capacity& capacity);

  /// A batch in device memory takes `room`, or its own need where its structure can be read here.
  void solve(const ContactView& batch, const Outputs& out, const Array* warm_start, StreamRef stream,
             const std::optional<Capacity>& room);
  void solve(const JacobianView& batch, const Outputs& out, const Start& start, StreamRef stream,
             const std::optional<JacobianCapacity>& room);
  void synchronize(StreamRef stream);

  [[nodiscard]] const Solver& contact() const noexcept { return *contact_; }

 private:
  /// Makes the solver anew where it has too little room.
  void reserve(const Capacity& need, StreamRef stream);
  template <class Real>
  std::shared_ptr<JacobianSolver<Real>> jacobian(const JacobianBatchView<Real>& batch,
                                                 const std::optional<JacobianCapacity>& room);

  std::mutex mutex_;
  Capacity capacity_;
  std::shared_ptr<Solver> contact_;
  std::shared_ptr<JacobianSolver<float>> jacobian_f32_;
  std::shared_ptr<JacobianSolver<double>> jacobian_f64_;
  CapturedObjects captured_;
};

/// Room for both capacities, and whether both have the same.
Capacity larger_of(const Capacity& a, const Capacity& b);
bool same(const Capacity& a, const Capacity& b);

/// Outputs of a solve, as the C++ interface takes them. \throws nanobind errors if an array has another type or is
/// short.
template <class Real>
SolutionView<Real> solution_view(const Outputs& out, Offset row_count, Offset env_count);

/// Memory for `length` numbers, or null for None. \throws nanobind::value_error if the array is shorter.
template <class T>
T* room_for(const Array* array, const char* name, Offset length) {
  if (array == nullptr) return nullptr;
  if (array->size() < length)
    throw nanobind::value_error((std::string(name) + ": expected room for " + std::to_string(length) +
                                 " numbers, got " + std::to_string(array->size()))
                                    .c_str());
  return array->write<T>(name);
}

/// A warm start, or null. \throws as room_for
template <class Real>
const Real* guess_of(const Array* array, Offset count, const char* name = "warm_start");

inline StreamRef stream_from(std::uintptr_t handle) {
  return StreamRef(reinterpret_cast<void*>(handle));
}

/// A solver keeps its options alive: they hold the tracer that it writes to until it ends.
void bind_solver(nanobind::module_& module);
void bind_body_solver(nanobind::module_& module);
void bind_stepper(nanobind::module_& module);
void bind_derivative(nanobind::module_& module);
void bind_jacobian_bodies(nanobind::module_& module);
void bind_world(nanobind::module_& module);
void bind_articulated(nanobind::module_& module);
void bind_packed(nanobind::module_& module);
void bind_reports(nanobind::module_& module);
void bind_files(nanobind::module_& module);
void bind_mujoco(nanobind::module_& module);
void bind_jax(nanobind::module_& module);

}  // namespace stiction::python
