#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <memory>
#include <string>

#include "python/src/as_numpy.hpp"
#include "python/src/mujoco_simulations.hpp"
#include "python/src/signal_check.hpp"
#include "python/src/solver.hpp"

namespace nb = nanobind;

namespace stiction::python {

namespace {

MujocoLayout layout_from(const nb::dict& fields) {
  MujocoLayout layout{};
  const auto take = [&fields](const char* name, auto& target) {
    target = nb::cast<std::remove_reference_t<decltype(target)>>(fields[name]);
  };
  take("time", layout.time);
  take("nefc", layout.nefc);
  take("flg_rnepost", layout.flg_rnepost);
  take("qpos", layout.qpos);
  take("qvel", layout.qvel);
  take("ctrl", layout.ctrl);
  take("qacc", layout.qacc);
  take("qacc_smooth", layout.qacc_smooth);
  take("qacc_warmstart", layout.qacc_warmstart);
  take("qfrc_constraint", layout.qfrc_constraint);
  take("qLD", layout.qLD);
  take("M", layout.mass);
  take("efc_type", layout.efc_type);
  take("efc_id", layout.efc_id);
  take("efc_R", layout.efc_R);
  take("efc_aref", layout.efc_aref);
  take("efc_frictionloss", layout.efc_frictionloss);
  take("efc_force", layout.efc_force);
  take("efc_state", layout.efc_state);
  take("efc_J", layout.efc_J);
  take("efc_J_rownnz", layout.efc_J_rownnz);
  take("efc_J_rowadr", layout.efc_J_rowadr);
  take("efc_J_colind", layout.efc_J_colind);
  take("contact", layout.contact);
  take("simulation_bytes", layout.simulation_bytes);
  take("contact_bytes", layout.contact_bytes);
  take("contact_dim", layout.contact_dim);
  take("contact_friction", layout.contact_friction);
  take("contact_geom", layout.contact_geom);
  take("nq", layout.nq);
  take("nv", layout.nv);
  take("nu", layout.nu);
  take("sparse", layout.sparse);
  take("M_rownnz", layout.mass_rownnz);
  take("M_colind", layout.mass_colind);
  take("row_kind", layout.row_kind);
  take("rotations", layout.rotations);
  take("timestep", layout.timestep);
  return layout;
}

template <class Function>
Function function_at(std::uintptr_t address) {
  return reinterpret_cast<Function>(address);
}

/// By address; numbers that are less than OwnStage::end, where no function can be, are our own.
MujocoStage stage_at(std::uintptr_t address) {
  if (address < static_cast<std::uintptr_t>(OwnStage::end)) return {nullptr, static_cast<OwnStage>(address)};
  return {function_at<MujocoFunction>(address)};
}

/// Numbers of our own stages by their names.
nb::dict own_stages() {
  nb::dict stages;
  std::uintptr_t number = 0;
  for (const char* name : {"count", "write_back", "renew_forces", "rk4_begin", "rk4_enter_1", "rk4_enter_2",
                           "rk4_enter_3", "rk4_leave_1", "rk4_leave_2", "rk4_leave_3", "rk4_end"})
    stages[name] = nb::int_(number++);
  return stages;
}

std::vector<MujocoStage> stages_at(const std::vector<std::uintptr_t>& addresses) {
  std::vector<MujocoStage> stages;
  stages.reserve(addresses.size());
  for (const std::uintptr_t address : addresses) stages.push_back(stage_at(address));
  return stages;
}

nb::bytes bytes_of(const std::vector<EnvStatus>& status) {
  return nb::bytes(reinterpret_cast<const char*>(status.data()), status.size() * sizeof(EnvStatus));
}

/// work() without the interpreter's lock.
template <class Work>
auto unlocked(const Work& work) {
  const nb::gil_scoped_release released;
  return work();
}

/// Returns copies of the last solve's arrays.
nb::dict arrays_of(const MujocoSimulations& simulations) {
  auto kept = std::make_unique<MujocoSystem>(unlocked([&] { return simulations.system(); }));
  const MujocoSystem& system = *kept;
  const nb::capsule self(kept.release(), [](void* memory) noexcept { delete static_cast<MujocoSystem*>(memory); });
  nb::dict out;
  out["offsets"] = as_numpy(system.env_row_offsets, self);
  out["cone_offsets"] = as_numpy(system.env_cone_offsets, self);
  out["dof_offsets"] = as_numpy(system.env_dof_offsets, self);
  out["cone_row_offsets"] = as_numpy(system.cone_row_offsets, self);
  out["kinds"] = as_numpy(system.cone_kind, self);
  out["ids"] = as_numpy(system.cone_id, self);
  out["J"] = as_numpy(system.J, self);
  out["M"] = as_numpy(system.M, self);
  out["factored"] = nb::bool_(system.mass_form == MassForm::factor);
  out["v_free"] = as_numpy(system.v_free, self);
  out["target"] = as_numpy(system.target, self);
  out["R"] = as_numpy(system.R, self);
  out["mu"] = as_numpy(system.mu, self);
  out["lo"] = as_numpy(system.lo, self);
  out["hi"] = as_numpy(system.hi, self);
  out["lambda_"] = as_numpy(system.lambda, self);
  out["velocities"] = as_numpy(system.velocity, self);
  return out;
}

}  // namespace

void bind_mujoco(nb::module_& module) {
  using Unlocked = nb::call_guard<nb::gil_scoped_release>;
  nb::class_<MujocoSolve>(module, "MujocoSolve", "A solve of a step, and what comes before and after it.")
      .def(
          "__init__",
          [](MujocoSolve* self, const std::vector<std::uintptr_t>& before, const std::vector<std::uintptr_t>& after,
             std::uintptr_t constraint) {
            new (self) MujocoSolve{stages_at(before), stages_at(after), function_at<MujocoFunction>(constraint)};
          },
          nb::arg("before"), nb::arg("after"), nb::arg("constraint"));
  nb::class_<MujocoSimulations>(module, "MujocoSimulations", "Many simulations of one MuJoCo model (stiction.mujoco).")
      .def(
          "__init__",
          [](MujocoSimulations* self, const nb::dict& layout, std::uintptr_t mul_jac_t_vec,
             std::uintptr_t integrate_pos, const std::vector<std::uintptr_t>& handlers, std::uintptr_t model,
             const std::vector<std::uintptr_t>& data, const SolverOptions& options, double warm_start) {
            MujocoFunctions functions{};
            functions.mul_jac_t_vec = function_at<decltype(functions.mul_jac_t_vec)>(mul_jac_t_vec);
            functions.integrate_pos = function_at<decltype(functions.integrate_pos)>(integrate_pos);
            functions.handlers.set_of_thread = function_at<decltype(MujocoHandlers::set_of_thread)>(handlers.at(0));
            functions.handlers.of_all = function_at<decltype(MujocoHandlers::of_all)>(handlers.at(1));
            std::vector<void*> simulations;
            for (const std::uintptr_t address : data) simulations.push_back(reinterpret_cast<void*>(address));
            new (self) MujocoSimulations(layout_from(layout), functions, reinterpret_cast<const void*>(model),
                                         simulations, options, warm_start);
          },
          nb::arg("layout"), nb::arg("mul_jac_t_vec"), nb::arg("integrate_pos"), nb::arg("handlers"), nb::arg("model"),
          nb::arg("data"), nb::arg("options"), nb::arg("warm_start"))
      .def(
          "replace",
          [](MujocoSimulations& self, std::size_t simulation, std::uintptr_t data) {
            self.replace(simulation, reinterpret_cast<void*>(data));
          },
          nb::arg("simulation"), nb::arg("data"), Unlocked())
      .def("configure", &MujocoSimulations::configure, nb::arg("timestep"), nb::arg("sparse"), Unlocked())
      .def("activate", &MujocoSimulations::activate, nb::arg("active"), Unlocked())
      .def(
          "run",
          [](MujocoSimulations& self, const std::vector<std::uintptr_t>& stages) {
            const std::vector<MujocoStage> functions = stages_at(stages);
            const nb::gil_scoped_release unlocked;
            self.run(functions);
          },
          nb::arg("stages"))
      .def(
          "write_controls",
          [](MujocoSimulations& self,
             const nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>& controls) {
            self.write_controls(controls.data());
          },
          nb::arg("controls"), Unlocked())
      .def(
          "read",
          [](const MujocoSimulations& self, std::size_t offset,
             const nb::ndarray<double, nb::ndim<2>, nb::c_contig, nb::device::cpu>& to) {
            self.read(offset, to.shape(1), to.data());
          },
          nb::arg("offset"), nb::arg("to"), Unlocked())
      .def(
          "gather", [](MujocoSimulations& self, bool all) { self.gather(all ? Rowless::kept : Rowless::left_out); },
          nb::arg("all") = false, Unlocked())
      .def("solve", nb::overload_cast<>(&MujocoSimulations::solve), Unlocked())
      .def("limit", &MujocoSimulations::limit, nb::arg("tolerance"), nb::arg("max_iterations"), Unlocked())
      .def(
          "step",
          [](MujocoSimulations& self, const std::vector<MujocoSolve>& solves, int count) {
            SignalCheck signals;
            return self.step(solves, count, [&] { signals.look(); });
          },
          nb::arg("solves"), nb::arg("count"), Unlocked())
      .def(
          "set_masses",
          [](MujocoSimulations& self,
             const nb::ndarray<const double, nb::ndim<3>, nb::c_contig, nb::device::cpu>& masses) {
            self.set_masses(masses.data());
          },
          nb::arg("masses"), Unlocked())
      .def("reset_warm_start", &MujocoSimulations::reset_warm_start, nb::arg("simulations"), Unlocked())
      .def("starts_from_accelerations", &MujocoSimulations::starts_from_accelerations)
      .def("has_factors", &MujocoSimulations::has_factors)
      .def("chunk_size", &MujocoSimulations::chunk_size)
      .def("status", [](const MujocoSimulations& self) { return bytes_of(unlocked([&] { return self.status(); })); })
      .def("take_records",
           [](MujocoSimulations& self) { return bytes_of(unlocked([&] { return self.take_records(); })); });
  module.def("mujoco_stages", &own_stages);
  module.def("mujoco_arrays", &arrays_of, nb::arg("simulations"));
}

}  // namespace stiction::python
