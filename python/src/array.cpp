#include "python/src/array.hpp"

#include <nanobind/stl/string.h>

namespace nb = nanobind;

namespace stiction::python {

namespace {

std::string name_of(nb::dlpack::dtype type) {
  using Code = nb::dlpack::dtype_code;
  const std::string bits = std::to_string(static_cast<int>(type.bits));
  switch (static_cast<Code>(type.code)) {
    case Code::Int:
      return "int" + bits;
    case Code::UInt:
      return "uint" + bits;
    case Code::Float:
      return "float" + bits;
    case Code::Bfloat:
      return "bfloat" + bits;
    case Code::Complex:
      return "complex" + bits;
    case Code::Bool:
      return "bool";
    default:
      return "type " + std::to_string(static_cast<int>(type.code)) + " of " + bits + " bits";
  }
}

/// The last argument of a caster that may look and not convert.
constexpr bool kNoConversion = false;

}  // namespace

Array::Array(nb::handle object) {
  nb::ndarray<> writable;
  if (nb::try_cast(object, writable, kNoConversion) && writable.is_valid()) {
    writable_ = true;
    memory_ = nb::ndarray<nb::ro>(writable);
  } else if (!nb::try_cast(object, memory_, kNoConversion) || !memory_.is_valid()) {
    throw nb::type_error("expected an array (DLPack or the buffer protocol)");
  }
}

nb::tuple Array::shape() const {
  nb::list extents;
  for (std::size_t i = 0; i < memory_.ndim(); ++i) extents.append(memory_.shape(i));
  return nb::tuple(extents);
}

nb::tuple Array::strides() const {
  nb::list steps;
  for (std::size_t i = 0; i < memory_.ndim(); ++i) steps.append(memory_.stride(i));
  return nb::tuple(steps);
}

std::string Array::dtype() const {
  return name_of(memory_.dtype());
}

std::string Array::device() const {
  switch (memory_.device_type()) {
    case nb::device::cpu::value:
    case nb::device::cuda_host::value:
      return "cpu";
    case nb::device::cuda::value:
    case nb::device::cuda_managed::value:
      return "cuda:" + std::to_string(memory_.device_id());
    default:
      return "DLPack device " + std::to_string(memory_.device_type());
  }
}

bool Array::contiguous() const noexcept {
  if (memory_.size() == 0) return true;
  std::int64_t step = 1;
  for (std::size_t i = memory_.ndim(); i-- > 0;) {
    if (memory_.shape(i) != 1 && memory_.stride(i) != step) return false;
    step *= static_cast<std::int64_t>(memory_.shape(i));
  }
  return true;
}

void Array::require(const char* name, nb::dlpack::dtype expected, bool write) const {
  if (memory_.dtype() != expected)
    throw nb::type_error((std::string(name) + ": expected " + name_of(expected) + ", got " + dtype()).c_str());
  if (!contiguous()) throw nb::type_error((std::string(name) + ": expected C-contiguous memory").c_str());
  if (write && !writable_) throw nb::type_error((std::string(name) + ": expected a writable array").c_str());
}

void bind_array(nb::module_& module) {
  nb::class_<Array>(module, "Array", "An array of any framework as the module sees it: not copied, kept alive.")
      .def(nb::init<nb::handle>(), nb::arg("object"))
      .def_prop_ro("shape", &Array::shape, "Extents.")
      .def_prop_ro("strides", &Array::strides, "Steps between neighbours along each axis [elements].")
      .def_prop_ro("dtype", &Array::dtype, "Type of the numbers, as NumPy names it.")
      .def_prop_ro("device", &Array::device, "Where the memory is: \"cpu\", \"cuda:0\", ...")
      .def_prop_ro("writable", &Array::writable)
      .def_prop_ro("contiguous", &Array::contiguous, "Whether the memory is row-major without gaps.")
      .def_prop_ro("size", &Array::size, "Number of elements.")
      .def_prop_ro(
          "pointer", [](const Array& array) { return reinterpret_cast<std::uintptr_t>(array.data()); },
          "Address of the first element.");
}

}  // namespace stiction::python
