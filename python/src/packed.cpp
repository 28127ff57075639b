#include "python/src/packed.hpp"

#include <nanobind/stl/string.h>

#include <cmath>
#include <memory>
#include <span>

#include "python/src/as_numpy.hpp"
#include "python/src/names.hpp"
#include "python/src/solver.hpp"
#include "stiction/residual.hpp"

namespace nb = nanobind;

namespace stiction::python {

namespace {

ContactBatch<double> in_f64(ContactBatch<double> batch) {
  return batch;
}
ContactBatch<double> in_f64(const ContactBatch<float>& batch) {
  return convert<double>(batch);
}

/// A packed batch by which first guesses are weighed, and where its rows lie in the caller's arrays.
class PackedBatch {
 public:
  template <class View>
  explicit PackedBatch(const View& batch) : batch_(packed(batch)) {
    std::visit(
        [this](const auto& view) {
          for (Offset env = 0; env < view.env_count; ++env)
            for (Index row = 0; row < view.env_rows(env); ++row) place_.push_back(view.env_row_offsets[env] + row);
        },
        batch.view);
  }

  [[nodiscard]] nb::dict arrays(nb::handle owner) const {
    const auto& from = batch_.arrays();
    const auto put = [&](const auto& values) { return as_numpy(values, owner); };
    nb::dict to;
    to["env_row_offsets"] = put(from.env_row_offsets);
    to["env_cone_offsets"] = put(from.env_cone_offsets);
    to["cone_kind"] =
        as_numpy(std::span(reinterpret_cast<const std::uint8_t*>(from.cone_kind.data()), from.cone_kind.size()), owner);
    to["cone_row_offsets"] = put(from.cone_row_offsets);
    to["row_offsets"] = put(from.row_offsets);
    to["column"] = put(from.column);
    to["A"] = put(from.A);
    to["b"] = put(from.b);
    to["R"] = put(from.R);
    to["mu"] = put(from.mu);
    to["lo"] = put(from.lo);
    to["hi"] = put(from.hi);
    to["place"] = put(place_);
    return to;
  }

  /// (A + diag R) lambda + b of one set of reactions.
  void motion(const Array& lambda, const Array& to) const {
    const double* x = read(lambda, 1);
    double* const w = to.write<double>("w");
    const nb::gil_scoped_release unlocked;
    const ContactBatchView<double> view = batch_.view();
    for (Offset env = 0; env < view.env_count; ++env)
      for (Offset row = view.env_row_offsets[env]; row < view.env_row_offsets[env + 1]; ++row)
        w[row] = pushed(view, env, row, x) + view.b[row];
  }

  /// Mean of each environment's diagonal of A.
  void mean_diagonal(const Array& to) const {
    double* const mean = to.write<double>("mean");
    const ContactBatchView<double> view = batch_.view();
    for (Offset env = 0; env < view.env_count; ++env) {
      const Offset first = view.env_row_offsets[env], last = view.env_row_offsets[env + 1];
      double sum = 0.0;
      for (Offset row = first; row < last; ++row)
        for (Offset k = view.row_offsets[row]; k < view.row_offsets[row + 1]; ++k)
          if (first + view.column[k] == row) sum += std::abs(view.A[k]);
      mean[env] = last > first ? sum / static_cast<double>(last - first) : 0.0;
    }
  }

  /// Computes the worth of each of `count` sets of reactions in each environment, the less the better. It is the dual
  /// energy under the convex law, the natural residual [w] under Coulomb's.
  void weigh(const std::string& law, const Array& lambda, Offset count, const Array& to) const {
    const Law chosen = law_from(law);
    const double* const x = read(lambda, count);
    double* weights = to.write<double>("weights");
    const nb::gil_scoped_release unlocked;
    ContactBatchView<double> view = batch_.view();
    view.law = chosen;
    for (Offset set = 0; set < count; ++set) {
      const double* const own = x + set * view.row_count;
      if (chosen == Law::coulomb) {
        for (const Residual& residual : verify(view, std::span(own, static_cast<std::size_t>(view.row_count))))
          *weights++ = residual.absolute;
        continue;
      }
      for (Offset env = 0; env < view.env_count; ++env) *weights++ = energy(view, env, own);
    }
  }

 private:
  /// \throws nanobind::value_error if there is not a number for every row.
  const double* read(const Array& lambda, Offset count) const {
    if (lambda.size() != count * static_cast<Offset>(place_.size()))
      throw nb::value_error(("lambda_: expected " + std::to_string(count) + " times " + std::to_string(place_.size()) +
                             " numbers, got " + std::to_string(lambda.size()))
                                .c_str());
    return lambda.read<double>("lambda_");
  }

  /// One row of (A + diag R) lambda.
  static double pushed(const ContactBatchView<double>& view, Offset env, Offset row, const double* x) {
    double sum = view.R[row] * x[row];
    for (Offset k = view.row_offsets[row]; k < view.row_offsets[row + 1]; ++k)
      sum += view.A[k] * x[view.env_row_offsets[env] + view.column[k]];
    return sum;
  }

  static double energy(const ContactBatchView<double>& view, Offset env, const double* x) {
    double sum = 0.0;
    for (Offset row = view.env_row_offsets[env]; row < view.env_row_offsets[env + 1]; ++row)
      sum += x[row] * (0.5 * pushed(view, env, row, x) + view.b[row]);
    return sum;
  }

  ContactBatch<double> batch_;
  std::vector<Offset> place_;  ///< of each row in the caller's arrays
};

}  // namespace

ContactBatch<double> packed(const ContactView& batch) {
  return std::visit([](const auto& view) { return in_f64(Solver(Device::cpu(), {}).to_host(on_host(view))); },
                    batch.view);
}

ContactBatch<double> packed(const JacobianView& batch) {
  return std::visit([](const auto& view) { return in_f64(assemble(on_host(view), FactorUse::never)); }, batch.view);
}

void bind_packed(nb::module_& module) {
  nb::class_<PackedBatch>(module, "PackedBatch", "A packed batch, by which first guesses are weighed.")
      .def(
          "__init__",
          [](PackedBatch* self, const ContactView& batch) {
            const nb::gil_scoped_release unlocked;
            new (self) PackedBatch(batch);
          },
          nb::arg("batch"))
      .def(
          "__init__",
          [](PackedBatch* self, const JacobianView& batch) {
            const nb::gil_scoped_release unlocked;
            new (self) PackedBatch(batch);
          },
          nb::arg("batch"))
      .def("arrays", [](nb::handle_t<PackedBatch> self) { return nb::cast<const PackedBatch&>(self).arrays(self); })
      .def("motion", &PackedBatch::motion, nb::arg("lambda_"), nb::arg("w"))
      .def("mean_diagonal", &PackedBatch::mean_diagonal, nb::arg("mean"))
      .def("weigh", &PackedBatch::weigh, nb::arg("law"), nb::arg("lambda_"), nb::arg("count"), nb::arg("weights"));
}

}  // namespace stiction::python
