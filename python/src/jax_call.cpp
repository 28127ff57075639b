#include <nanobind/nanobind.h>

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <numeric>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <vector>

#include "python/src/names.hpp"
#include "python/src/solver.hpp"
#include "stiction/derivative.hpp"
#include "stiction/error.hpp"
#include "stiction/padded.hpp"
#include "stiction/status.hpp"
#include "xla/ffi/api/ffi.h"

namespace nb = nanobind;
namespace ffi = xla::ffi;

namespace stiction::python {

namespace {

template <class T>
constexpr ffi::DataType kTypeOf = std::is_same_v<T, double>  ? ffi::DataType::F64
                                  : std::is_same_v<T, float> ? ffi::DataType::F32
                                                             : ffi::DataType::U8;

/// Buffers and options of one call. Arguments begin with the numbers A, b, mu, R, lo, hi of all environments.
class Call {
 public:
  Call(ffi::RemainingArgs arguments, ffi::RemainingRets results, ffi::Dictionary options)
      : arguments_(arguments), results_(results), options_(options) {
    const ffi::AnyBuffer b = buffer(1);
    const auto extents = b.dimensions();
    room = static_cast<Index>(extents.back());
    envs = std::accumulate(extents.begin(), extents.end() - 1, Offset{1}, std::multiplies<>());
    rows = envs * room;
    entries = rows * room;
    records = envs * static_cast<Offset>(sizeof(EnvStatus));
  }

  Index room = 0;      ///< rows of an environment
  Offset envs = 0;     ///< environments
  Offset rows = 0;     ///< rows of all
  Offset entries = 0;  ///< entries of A of all
  Offset records = 0;  ///< bytes of the records of all

  [[nodiscard]] bool is_double() const { return buffer(0).element_type() == ffi::DataType::F64; }

  /// An argument of that many numbers. \throws Error if there is none, or one of another type or length.
  template <class T>
  [[nodiscard]] const T* argument(std::size_t index, Offset length) const {
    return memory<T>(buffer(index), "argument", index, length);
  }
  /// A result, as argument().
  template <class T>
  [[nodiscard]] T* result(std::size_t index, Offset length) const {
    auto found = results_.get<ffi::AnyBuffer>(index);
    if (!found.has_value()) throw Error(ErrorCode::invalid_argument, found.error().message());
    return memory<T>(**found, "result", index, length);
  }
  template <class T>
  [[nodiscard]] T option(std::string_view name) const {
    const auto found = options_.get<T>(name);
    if (!found.has_value()) throw Error(ErrorCode::invalid_argument, std::string(name) + ": expected an option");
    return *found;
  }

 private:
  [[nodiscard]] ffi::AnyBuffer buffer(std::size_t index) const {
    auto found = arguments_.get<ffi::AnyBuffer>(index);
    if (!found.has_value()) throw Error(ErrorCode::invalid_argument, found.error().message());
    return *found;
  }
  template <class T>
  static T* memory(const ffi::AnyBuffer& buffer, const char* which, std::size_t index, Offset length) {
    if (buffer.element_type() != kTypeOf<T> || static_cast<Offset>(buffer.element_count()) != length)
      throw Error(ErrorCode::invalid_argument, std::string(which) + " " + std::to_string(index) + ": expected " +
                                                   std::to_string(length) + " numbers of A's precision, got " +
                                                   std::to_string(buffer.element_count()));
    return static_cast<T*>(buffer.untyped_data());
  }

  ffi::RemainingArgs arguments_;
  ffi::RemainingRets results_;
  ffi::Dictionary options_;
};

/// The problems of a call, which all have the same cones.
template <class Real>
class Problems {
 public:
  explicit Problems(const Call& call) : layout_(MatrixRows::by_room) {
    using Integers = ffi::Span<const std::int64_t>;
    const auto kinds = call.option<Integers>("kinds"), dims = call.option<Integers>("dims");
    std::vector<typename Environment<Real>::Cone> cones;
    for (std::size_t i = 0; i < kinds.size(); ++i)
      cones.push_back({static_cast<ConeKind>(kinds.begin()[i]), static_cast<Index>(dims.begin()[i])});
    for (Offset env = 0; env < call.envs; ++env) layout_.add(call.room, cones);
    const auto numbers = [&](std::size_t index) { return call.argument<Real>(index, call.rows); };
    view =
        layout_.view({call.argument<Real>(0, call.entries), numbers(1), numbers(3), numbers(2), numbers(4), numbers(5)},
                     law_from(std::string(call.option<std::string_view>("law"))));
  }

  ContactBatchView<Real> view;

 private:
  PaddedLayout<Real> layout_;
};

template <class Real>
SolutionView<Real> solution_of(const Call& call) {
  return {call.result<Real>(0, call.rows), call.result<Real>(1, call.rows),
          reinterpret_cast<EnvStatus*>(call.result<std::uint8_t>(2, call.records))};
}

/// The first six results: derivatives by the numbers, in their order.
template <class Real>
BatchCotangentView<Real> gradients_of(const Call& call) {
  BatchCotangentView<Real> gradients;
  gradients.A = call.result<Real>(0, call.entries);
  gradients.b = call.result<Real>(1, call.rows);
  gradients.mu = call.result<Real>(2, call.rows);
  gradients.R = call.result<Real>(3, call.rows);
  gradients.lo = call.result<Real>(4, call.rows);
  gradients.hi = call.result<Real>(5, call.rows);
  return gradients;
}

/// One solver for each set of options, for as long as the process lives. XLA calls from its threads and keeps nothing
/// between calls.
const Solver& solver_of(const Call& call, bool runs_all) {
  const std::tuple key{std::string(call.option<std::string_view>("solver")), call.option<double>("tolerance"),
                       call.option<std::int64_t>("max_iterations"), runs_all};
  static std::mutex mutex;
  static std::map<std::remove_const_t<decltype(key)>, std::unique_ptr<Solver>> solvers;
  const std::lock_guard lock(mutex);
  auto& entry = solvers[key];
  if (!entry) {
    SolverOptions options;
    options.solver = solver_from_string(std::get<0>(key));
    options.tolerance = std::get<1>(key);
    options.max_iterations = static_cast<Index>(std::get<2>(key));
    if (runs_all) options.stall_window = 0;
    options.invalid = InvalidPolicy::isolate;
    entry = std::make_unique<Solver>(Device::cpu(), options);
  }
  return *entry;
}

struct Solve {
  template <class Real>
  static void run(const Call& call) {
    const Problems<Real> problems(call);
    solver_of(call, false).solve(problems.view, solution_of<Real>(call));
  }
};

/// Sweeps, all of them, from the reactions of argument 6.
struct Sweep {
  template <class Real>
  static void run(const Call& call) {
    const Problems<Real> problems(call);
    solver_of(call, true).solve(problems.view, solution_of<Real>(call), call.argument<Real>(6, call.rows));
  }
};

/// Derivatives of the relaxed problem. Arguments 6 to 9: reactions, records, and derivatives by lambda and w.
struct RelaxedVjp {
  template <class Real>
  static void run(const Call& call) {
    const Problems<Real> problems(call);
    DerivativeOptions options;
    options.kappa = call.option<double>("kappa");
    std::vector<GradientStatus> records(static_cast<std::size_t>(call.envs));
    Derivative(Device::cpu(), options)
        .vjp(problems.view,
             ReactionView<Real>{call.argument<Real>(6, call.rows),
                                reinterpret_cast<const EnvStatus*>(call.argument<std::uint8_t>(7, call.records))},
             SolutionCotangentView<Real>{call.argument<Real>(8, call.rows), call.argument<Real>(9, call.rows)},
             gradients_of<Real>(call), records.data());
  }
};

/// Derivatives of sweeps. Arguments 6 to 8: their beginning, and derivatives by lambda and w. Result 6: by the
/// beginning.
struct SweepVjp {
  template <class Real>
  static void run(const Call& call) {
    const Problems<Real> problems(call);
    SweepsView<Real> sweeps;
    sweeps.warm_start = call.argument<Real>(6, call.rows);
    sweeps.count = static_cast<Index>(call.option<std::int64_t>("max_iterations"));
    sweeps.by_warm_start = call.result<Real>(6, call.rows);
    std::vector<GradientStatus> records(static_cast<std::size_t>(call.envs));
    Derivative(Device::cpu())
        .unrolled_vjp(problems.view, sweeps,
                      SolutionCotangentView<Real>{call.argument<Real>(7, call.rows), call.argument<Real>(8, call.rows)},
                      gradients_of<Real>(call), records.data());
  }
};

/// Runs one of these in A's precision.
template <class Function>
ffi::Error handle(ffi::RemainingArgs arguments, ffi::RemainingRets results, ffi::Dictionary options) {
  try {
    const Call call(arguments, results, options);
    if (call.is_double())
      Function::template run<double>(call);
    else
      Function::template run<float>(call);
    return ffi::Error::Success();
  } catch (const std::exception& error) {
    return ffi::Error(ffi::ErrorCode::kInvalidArgument, error.what());
  }
}

template <class Function>
nb::capsule handler() {
  XLA_FFI_DEFINE_HANDLER(kHandler, handle<Function>, ffi::Ffi::Bind().RemainingArgs().RemainingRets().Attrs());
  nb::capsule found(reinterpret_cast<void*>(kHandler));
  return found;
}

}  // namespace

void bind_jax(nb::module_& module) {
  nb::dict calls;
  calls["solve"] = handler<Solve>();
  calls["sweep"] = handler<Sweep>();
  calls["relaxed_vjp"] = handler<RelaxedVjp>();
  calls["sweep_vjp"] = handler<SweepVjp>();
  module.attr("jax_calls") = calls;
}

}  // namespace stiction::python
