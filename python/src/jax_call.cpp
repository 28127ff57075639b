#include <nanobind/nanobind.h>

#include <map>
#include <memory>
#include <mutex>
#include <numeric>
#include <string>
#include <tuple>

#include "python/src/names.hpp"
#include "python/src/solver.hpp"
#include "stiction/padded.hpp"
#include "stiction/status.hpp"
#include "xla/ffi/api/ffi.h"

namespace nb = nanobind;
namespace ffi = xla::ffi;

namespace stiction::python {

namespace {

using Integers = ffi::Span<const std::int64_t>;

/// One solver for each set of options, for as long as the process lives. XLA calls from its threads and keeps nothing
/// between calls.
const Solver& solver_of(std::string_view solver, double tolerance, std::int64_t max_iterations) {
  static std::mutex mutex;
  static std::map<std::tuple<std::string, double, std::int64_t>, std::unique_ptr<Solver>> solvers;
  const std::lock_guard lock(mutex);
  auto& entry = solvers[{std::string(solver), tolerance, max_iterations}];
  if (!entry) {
    SolverOptions options;
    options.solver = solver_from_string(std::string(solver));
    options.tolerance = tolerance;
    options.max_iterations = static_cast<Index>(max_iterations);
    options.invalid = InvalidPolicy::isolate;
    entry = std::make_unique<Solver>(Device::cpu(), options);
  }
  return *entry;
}

/// The buffers of one call, in the order of its arguments.
struct Buffers {
  ffi::AnyBuffer A, b, mu, R, lo, hi;
  ffi::Result<ffi::AnyBuffer> lambda, w, status;

  /// Returns true if all are of A's precision, and have its environments.
  [[nodiscard]] bool fit() {
    const ffi::DataType precision = A.element_type();
    if (precision != ffi::DataType::F32 && precision != ffi::DataType::F64) return false;
    const std::size_t rows = b.element_count();
    for (const ffi::AnyBuffer& each : {b, mu, R, lo, hi, *lambda, *w})
      if (each.element_type() != precision || each.element_count() != rows) return false;
    return A.element_count() == rows * static_cast<std::size_t>(b.dimensions().back()) &&
           status->element_count() * static_cast<std::size_t>(b.dimensions().back()) == rows * sizeof(EnvStatus);
  }
};

template <class Real>
void solve(Buffers& buffers, const Solver& solver, Law law, Integers kinds, Integers dims) {
  const auto extents = buffers.b.dimensions();
  const auto room = static_cast<Index>(extents.back());
  const Offset envs = std::accumulate(extents.begin(), extents.end() - 1, Offset{1}, std::multiplies<>());
  std::vector<typename Environment<Real>::Cone> cones;
  for (std::size_t i = 0; i < kinds.size(); ++i)
    cones.push_back({static_cast<ConeKind>(kinds.begin()[i]), static_cast<Index>(dims.begin()[i])});
  PaddedLayout<Real> layout(MatrixRows::by_room);
  for (Offset env = 0; env < envs; ++env) layout.add(room, cones);
  const auto numbers = [](const ffi::AnyBuffer& buffer) { return static_cast<const Real*>(buffer.untyped_data()); };
  const ContactBatchView<Real> view = layout.view({numbers(buffers.A), numbers(buffers.b), numbers(buffers.R),
                                                   numbers(buffers.mu), numbers(buffers.lo), numbers(buffers.hi)},
                                                  law);
  solver.solve(view, SolutionView<Real>{static_cast<Real*>(buffers.lambda->untyped_data()),
                                        static_cast<Real*>(buffers.w->untyped_data()),
                                        static_cast<EnvStatus*>(buffers.status->untyped_data())});
}

ffi::Error call(ffi::AnyBuffer A, ffi::AnyBuffer b, ffi::AnyBuffer mu, ffi::AnyBuffer R, ffi::AnyBuffer lo,
                ffi::AnyBuffer hi, ffi::Result<ffi::AnyBuffer> lambda, ffi::Result<ffi::AnyBuffer> w,
                ffi::Result<ffi::AnyBuffer> status, Integers kinds, Integers dims, std::string_view law,
                std::string_view solver, double tolerance, std::int64_t max_iterations) {
  try {
    Buffers buffers{A, b, mu, R, lo, hi, lambda, w, status};
    if (!buffers.fit())
      return ffi::Error(ffi::ErrorCode::kInvalidArgument, "A, b, mu, R, lo, hi do not fit each other");
    const Solver& with = solver_of(solver, tolerance, max_iterations);
    if (A.element_type() == ffi::DataType::F64)
      solve<double>(buffers, with, law_from(std::string(law)), kinds, dims);
    else
      solve<float>(buffers, with, law_from(std::string(law)), kinds, dims);
    return ffi::Error::Success();
  } catch (const std::exception& error) {
    return ffi::Error(ffi::ErrorCode::kInvalidArgument, error.what());
  }
}

XLA_FFI_DEFINE_HANDLER(kSolve, call,
                       ffi::Ffi::Bind()
                           .Arg<ffi::AnyBuffer>()
                           .Arg<ffi::AnyBuffer>()
                           .Arg<ffi::AnyBuffer>()
                           .Arg<ffi::AnyBuffer>()
                           .Arg<ffi::AnyBuffer>()
                           .Arg<ffi::AnyBuffer>()
                           .Ret<ffi::AnyBuffer>()
                           .Ret<ffi::AnyBuffer>()
                           .Ret<ffi::AnyBuffer>()
                           .Attr<Integers>("kinds")
                           .Attr<Integers>("dims")
                           .Attr<std::string_view>("law")
                           .Attr<std::string_view>("solver")
                           .Attr<double>("tolerance")
                           .Attr<std::int64_t>("max_iterations"));

}  // namespace

void bind_jax(nb::module_& module) {
  module.attr("jax_solve") = nb::capsule(reinterpret_cast<void*>(kSolve));
}

}  // namespace stiction::python
