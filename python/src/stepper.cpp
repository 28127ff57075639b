#include <nanobind/stl/string.h>

#include <vector>

#include "python/src/names.hpp"
#include "python/src/solver.hpp"
#include "stiction/error.hpp"
#include "stiction/stepping.hpp"

namespace nb = nanobind;

namespace stiction::python {

namespace {

StepScaling scaling_from(const std::string& name) {
  if (name == "capped") return StepScaling::capped;
  if (name == "none") return StepScaling::none;
  if (name == "proportional") return StepScaling::proportional;
  throw Error(ErrorCode::invalid_argument,
              "scaling \"" + name + "\" is not known: use \"capped\", \"none\" or \"proportional\"");
}

/// Ids are any 64 bits.
const std::uint64_t* ids_of(const Array& ids) {
  if (ids.dtype() == "int64") return reinterpret_cast<const std::uint64_t*>(ids.read<std::int64_t>("ids"));
  return ids.read<std::uint64_t>("ids");
}

/// Truth is a byte.
const std::uint8_t* bytes_of(const Array& mask) {
  if (mask.dtype() == "bool") return reinterpret_cast<const std::uint8_t*>(mask.read<bool>("mask"));
  return mask.read<std::uint8_t>("mask");
}

/// A SteppingSolver in the precision of its batches.
class Stepper {
 public:
  Stepper(Device device, const SolverOptions& options, const Capacity& capacity, const WarmStartOptions& warm_start) {
    if (capacity.precision == Precision::f64)
      solver_ = std::make_unique<SteppingSolver<double>>(device, options, capacity, warm_start);
    else
      solver_ = std::make_unique<SteppingSolver<float>>(device, options, capacity, warm_start);
  }

  void step(const ContactView& batch, const Array& ids, double dt, const Outputs& out, StreamRef stream) {
    std::visit(
        [&]<class Real>(const std::unique_ptr<SteppingSolver<Real>>& solver) {
          const auto* view = std::get_if<ContactBatchView<Real>>(&batch.view);
          if (view == nullptr) throw nb::type_error("batch: expected the precision that the solver was made for");
          const auto solution = solution_view<Real>(out, view->row_count, view->env_count);
          const std::uint64_t* id = ids_of(ids);
          const nb::gil_scoped_release unlocked;
          const std::lock_guard lock(mutex_);
          solver->solve(*view, id, dt, solution, stream);
        },
        solver_);
  }

  void reset(const std::vector<Offset>& envs, StreamRef stream) {
    visit([&](auto& solver) { solver.reset(envs, stream); });
  }
  void reset_where(const Array& mask, StreamRef stream) {
    const std::uint8_t* bytes = bytes_of(mask);
    visit([&](auto& solver) { solver.reset_where(bytes, stream); });
  }
  void reset_all(StreamRef stream) {
    visit([&](auto& solver) { solver.reset_all(stream); });
  }
  void synchronize(StreamRef stream) {
    visit([&](auto& solver) { solver.solver().synchronize(stream); });
  }

  [[nodiscard]] Device device() const {
    return std::visit([](const auto& solver) { return solver->solver().device(); }, solver_);
  }

  /// (hits, misses) of the last step, over all environments.
  std::pair<Offset, Offset> recalled(StreamRef stream) {
    std::pair<Offset, Offset> sum{0, 0};
    visit([&](auto& solver) {
      std::vector<WarmStartRecord> records(static_cast<std::size_t>(solver.store().capacity().envs));
      solver.store().records(records, stream);
      for (const WarmStartRecord& record : records) {
        sum.first += record.hits;
        sum.second += record.misses;
      }
    });
    return sum;
  }

 private:
  template <class Call>
  void visit(const Call& call) {
    const nb::gil_scoped_release unlocked;
    const std::lock_guard lock(mutex_);
    std::visit([&](auto& solver) { call(*solver); }, solver_);
  }

  std::mutex mutex_;
  std::variant<std::unique_ptr<SteppingSolver<float>>, std::unique_ptr<SteppingSolver<double>>> solver_;
};

std::vector<Offset> offsets_of(const nb::sequence& numbers) {
  std::vector<Offset> out;
  for (const nb::handle number : numbers) out.push_back(nb::cast<Offset>(number));
  return out;
}

}  // namespace

void bind_stepper(nb::module_& module) {
  nb::class_<Stepper>(module, "Stepper", "A solver and a store of reactions for one simulation loop.")
      .def(
          "__init__",
          [](Stepper* self, const std::string& device, const SolverOptions& options, const Capacity& capacity,
             double beta, const std::string& scaling) {
            new (self)
                Stepper(Device::from_string(device), options, capacity, {beta, scaling_from(scaling), options.threads});
          },
          nb::arg("device"), nb::arg("options"), nb::arg("capacity"), nb::arg("beta"), nb::arg("scaling"),
          nb::keep_alive<1, 3>())
      .def(
          "step",
          [](Stepper& self, const ContactView& batch, const Array& ids, double dt, const Array* lambda, const Array* w,
             const Array* status, std::uintptr_t stream) {
            self.step(batch, ids, dt, {lambda, w, nullptr, status}, stream_from(stream));
          },
          nb::arg("batch"), nb::arg("ids"), nb::arg("dt"), nb::arg("lambda_"), nb::arg("w").none(), nb::arg("status"),
          nb::arg("stream"))
      .def(
          "reset",
          [](Stepper& self, const nb::sequence& envs, std::uintptr_t stream) {
            self.reset(offsets_of(envs), stream_from(stream));
          },
          nb::arg("envs"), nb::arg("stream"))
      .def(
          "reset_where",
          [](Stepper& self, const Array& mask, std::uintptr_t stream) { self.reset_where(mask, stream_from(stream)); },
          nb::arg("mask"), nb::arg("stream"))
      .def(
          "reset_all", [](Stepper& self, std::uintptr_t stream) { self.reset_all(stream_from(stream)); },
          nb::arg("stream"))
      .def(
          "synchronize", [](Stepper& self, std::uintptr_t stream) { self.synchronize(stream_from(stream)); },
          nb::arg("stream"))
      .def_prop_ro(
          "device", [](const Stepper& self) { return name_of(self.device()); }, "The device that \"auto\" became.")
      .def(
          "recalled",
          [](Stepper& self, std::uintptr_t stream) {
            const auto [hits, misses] = self.recalled(stream_from(stream));
            return nb::make_tuple(hits, misses);
          },
          nb::arg("stream"), "(hits, misses) of the last step.");
}

}  // namespace stiction::python
