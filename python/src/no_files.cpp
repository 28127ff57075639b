#include <nanobind/stl/string.h>

#include "python/src/solver.hpp"
#include "stiction/error.hpp"

namespace nb = nanobind;

namespace stiction::python {

namespace {

[[noreturn]] void refuse() {
  throw Error(ErrorCode::unsupported,
              "this build cannot read or write files: install HDF5 (Debian: libhdf5-dev) and build again");
}

}  // namespace

void bind_files(nb::module_& module) {
  module.def("read", [](const nb::args&, const nb::kwargs&) { refuse(); });
  module.def("write", [](const nb::args&, const nb::kwargs&) { refuse(); });
  module.def("FailureFile", [](const nb::args&, const nb::kwargs&) { refuse(); });
}

}  // namespace stiction::python
