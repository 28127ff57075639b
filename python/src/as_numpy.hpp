#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <iterator>
#include <ranges>

namespace stiction::python {

/// Numbers that lie one after the other in memory of `owner`, as a NumPy array over that memory. It keeps the owner
/// alive and cannot be written.
template <std::ranges::contiguous_range Values>
nanobind::object as_numpy(const Values& values, nanobind::handle owner) {
  namespace nb = nanobind;
  using Number = std::ranges::range_value_t<Values>;
  return nb::cast(nb::ndarray<nb::numpy, const Number, nb::ndim<1>>(std::data(values), {std::size(values)}, owner));
}

}  // namespace stiction::python
