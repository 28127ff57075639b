#include <nanobind/nanobind.h>

#include "python/src/array.hpp"
#include "python/src/solver.hpp"
#include "python/src/views.hpp"
#include "stiction/error.hpp"

namespace nb = nanobind;

namespace {

/// The Python class of stiction::Error, made once and kept by the module.
PyObject* error_class = nullptr;

const char* name_of(stiction::ErrorCode code) {
  using stiction::ErrorCode;
  switch (code) {
    case ErrorCode::invalid_argument:
      return "invalid_argument";
    case ErrorCode::bad_file:
      return "bad_file";
    case ErrorCode::io:
      return "io";
    case ErrorCode::out_of_memory:
      return "out_of_memory";
    case ErrorCode::no_device:
      return "no_device";
    case ErrorCode::device_failure:
      return "device_failure";
    case ErrorCode::unsupported:
      return "unsupported";
  }
  return "?";
}

void translate(const std::exception_ptr& thrown, void*) {
  try {
    std::rethrow_exception(thrown);
  } catch (const stiction::Error& error) {
    const nb::object instance = nb::borrow(error_class)(error.what());
    instance.attr("code") = name_of(error.code());
    PyErr_SetObject(error_class, instance.ptr());
  }
}

}  // namespace

NB_MODULE(_core, module) {
  // An array that lives until the interpreter ends keeps its memory: nothing is lost, and no warning is due.
  nb::set_leak_warnings(false);
  module.doc() = "The C++ interface of stiction, as the Python package uses it.";
  error_class = PyErr_NewExceptionWithDoc(
      "stiction.Error",
      "Misuse or device failure that the library reports; `code` says which: \"invalid_argument\", \"bad_file\", "
      "\"io\", \"out_of_memory\", \"no_device\", \"device_failure\" or \"unsupported\".",
      PyExc_RuntimeError, nullptr);
  module.attr("Error") = nb::borrow(error_class);
  nb::register_exception_translator(translate);

  stiction::python::bind_array(module);
  stiction::python::bind_views(module);
  stiction::python::bind_solver(module);
  stiction::python::bind_body_solver(module);
  stiction::python::bind_stepper(module);
  stiction::python::bind_derivative(module);
  stiction::python::bind_jacobian_bodies(module);
  stiction::python::bind_world(module);
  stiction::python::bind_articulated(module);
  stiction::python::bind_packed(module);
  stiction::python::bind_reports(module);
  stiction::python::bind_files(module);
  stiction::python::bind_mujoco(module);
  stiction::python::bind_jax(module);
}
