#include <nanobind/stl/string.h>

#include <span>
#include <vector>

#include "python/src/names.hpp"
#include "python/src/solver.hpp"
#include "stiction/error.hpp"
#include "stiction/hash.hpp"
#include "stiction/jacobian.hpp"
#include "stiction/preset.hpp"
#include "stiction/residual.hpp"
#include "stiction/status.hpp"

namespace nb = nanobind;

namespace stiction::python {

Law law_from(const std::string& name) {
  for (const Law law : {Law::convex, Law::coulomb})
    if (name == to_string(law)) return law;
  throw Error(ErrorCode::invalid_argument, "law \"" + name + "\" is not known: use \"convex\" or \"coulomb\"");
}

std::string name_of(Device device) {
  if (device.kind == DeviceKind::cuda) return "cuda:" + std::to_string(device.ordinal);
  return device.kind == DeviceKind::emulated ? "emulated" : "cpu";
}

namespace {

nb::list device_list() {
  nb::list all;
  for (const DeviceReport& report : devices()) {
    nb::dict entry;
    entry["device"] = name_of(report.device);
    entry["usable"] = report.usable;
    entry["name"] = report.name;
    entry["reason"] = report.reason;
    all.append(entry);
  }
  return all;
}

nb::dict preset_options(const std::string& name) {
  const SolverOptions options = options_for(preset_from_string(name));
  nb::dict out;
  out["solver"] = to_string(options.solver);
  out["tolerance"] = options.tolerance;
  out["max_iterations"] = options.max_iterations;
  return out;
}

nb::list names_of_codes() {
  nb::list names;
  for (int code = 0; code < kEnvCodeCount; ++code) names.append(to_string(static_cast<EnvCode>(code)));
  return names;
}

nb::list names_of_flags() {
  nb::list names;
  for (int bit = 0; bit < kEnvFlagCount; ++bit) names.append(flag_name(static_cast<EnvFlag>(1U << bit)));
  return names;
}

nb::list names_of_solvers() {
  nb::list names;
  for (int kind = 0; kind < kSolverKindCount; ++kind) names.append(to_string(static_cast<SolverKind>(kind)));
  return names;
}

nb::list tuples_of(const std::vector<Residual>& residuals) {
  nb::list out;
  for (const Residual& residual : residuals) {
    out.append(
        nb::make_tuple(residual.relative, residual.absolute, worst_error(residual), residual.scale, residual.cone));
  }
  return out;
}

nb::list verify_contacts(const ContactView& batch, const Array& lambda) {
  return std::visit(
      [&]<class Real>(const ContactBatchView<Real>& view) {
        const std::span<const Real> rows(lambda.read<Real>("lambda_"), static_cast<std::size_t>(lambda.size()));
        std::vector<Residual> residuals;
        {
          const nb::gil_scoped_release unlocked;
          residuals = verify(on_host(view), rows);
        }
        return tuples_of(residuals);
      },
      batch.view);
}

nb::list verify_jacobian(const JacobianView& batch, const Array& lambda) {
  return std::visit(
      [&]<class Real>(const JacobianBatchView<Real>& view) {
        const Real* rows = lambda.read<Real>("lambda_");
        std::vector<Residual> residuals;
        {
          const nb::gil_scoped_release unlocked;
          const ContactBatch<Real> contacts = assemble(on_host(view), FactorUse::never);
          const std::vector<Real> packed = rows_in_use(view, rows);
          residuals = verify(contacts.view(), std::span<const Real>(packed));
        }
        return tuples_of(residuals);
      },
      batch.view);
}

std::uint64_t hash_of(const Array& values) {
  const auto count = static_cast<std::size_t>(values.size());
  if (values.dtype() == "float32") return hash_bits(std::span(values.read<float>("values"), count));
  return hash_bits(std::span(values.read<double>("values"), count));
}

}  // namespace

void bind_reports(nb::module_& module) {
  module.def("devices", &device_list, "One dict for each device: device, usable, name, reason.");
  module.def("preset", &preset_options, nb::arg("name"), "solver, tolerance and max_iterations of a preset.");
  module.def("preset_names", [] {
    nb::list names;
    for (int preset = 0; preset < kPresetCount; ++preset) names.append(to_string(static_cast<Preset>(preset)));
    return names;
  });
  module.def("code_names", &names_of_codes, "Names of status codes, by number.");
  module.def("flag_names", &names_of_flags, "Names of status flags, by bit.");
  module.def("solver_names", &names_of_solvers, "Names of solvers, by number.");
  module.def(
      "solver_name", [](std::uint8_t number) { return to_string(static_cast<SolverKind>(number)); }, nb::arg("number"),
      "Name of the solver that a status names.");
  module.def("hash_bits", &hash_of, nb::arg("values"), "Hash of the bits of an array of float32 or float64.");
  const char* verify_text = "(relative, absolute) residual of each environment, recomputed in double.";
  module.def("verify", &verify_contacts, nb::arg("batch"), nb::arg("lambda_"), verify_text);
  module.def("verify", &verify_jacobian, nb::arg("batch"), nb::arg("lambda_"), verify_text);
  module.attr("version") = kVersion;
  module.attr("numerics_epoch") = kNumericsEpoch;
}

}  // namespace stiction::python
