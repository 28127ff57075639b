#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <string>

#include "python/src/as_numpy.hpp"
#include "python/src/mujoco.hpp"
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
  take("qpos", layout.qpos);
  take("qvel", layout.qvel);
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
  take("contact_bytes", layout.contact_bytes);
  take("contact_dim", layout.contact_dim);
  take("contact_friction", layout.contact_friction);
  take("contact_geom", layout.contact_geom);
  take("nq", layout.nq);
  take("nv", layout.nv);
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

/// Records of the last solve as bytes; a copy.
nb::bytes status_of(const MujocoSimulations& simulations) {
  const std::vector<EnvStatus>& status = simulations.system().status;
  return nb::bytes(reinterpret_cast<const char*>(status.data()), status.size() * sizeof(EnvStatus));
}

nb::dict arrays_of(const nb::object& self) {
  const MujocoSystem& system = nb::cast<const MujocoSimulations&>(self).system();
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
  nb::class_<MujocoSimulations>(module, "MujocoSimulations", "Many simulations of one MuJoCo model (stiction.mujoco).")
      .def(
          "__init__",
          [](MujocoSimulations* self, const nb::dict& layout, std::uintptr_t mul_jac_t_vec,
             std::uintptr_t integrate_pos, std::uintptr_t model, const std::vector<std::uintptr_t>& data,
             const SolverOptions& options, double warm_start) {
            MujocoFunctions functions{};
            functions.mul_jac_t_vec = function_at<decltype(functions.mul_jac_t_vec)>(mul_jac_t_vec);
            functions.integrate_pos = function_at<decltype(functions.integrate_pos)>(integrate_pos);
            std::vector<void*> simulations;
            for (const std::uintptr_t address : data) simulations.push_back(reinterpret_cast<void*>(address));
            new (self) MujocoSimulations(layout_from(layout), functions, reinterpret_cast<const void*>(model),
                                         std::move(simulations), options, warm_start);
          },
          nb::arg("layout"), nb::arg("mul_jac_t_vec"), nb::arg("integrate_pos"), nb::arg("model"), nb::arg("data"),
          nb::arg("options"), nb::arg("warm_start"))
      .def(
          "replace",
          [](MujocoSimulations& self, std::size_t simulation, std::uintptr_t data) {
            self.replace(simulation, reinterpret_cast<void*>(data));
          },
          nb::arg("simulation"), nb::arg("data"))
      .def("configure", &MujocoSimulations::configure, nb::arg("timestep"), nb::arg("sparse"))
      .def("activate", &MujocoSimulations::activate, nb::arg("active"))
      .def(
          "run",
          [](MujocoSimulations& self, const std::vector<std::uintptr_t>& stages) {
            std::vector<MujocoStage> functions;
            for (const std::uintptr_t address : stages) functions.push_back(function_at<MujocoStage>(address));
            const nb::gil_scoped_release unlocked;
            self.run(functions);
          },
          nb::arg("stages"))
      .def("gather", &MujocoSimulations::gather, Unlocked())
      .def("solve", &MujocoSimulations::solve, nb::arg("tolerance"), nb::arg("max_iterations"), Unlocked())
      .def("scatter", &MujocoSimulations::scatter, Unlocked())
      .def("reset_warm_start", &MujocoSimulations::reset_warm_start, nb::arg("simulations"))
      .def("starts_from_accelerations", &MujocoSimulations::starts_from_accelerations)
      .def("rk4_begin", &MujocoSimulations::rk4_begin, Unlocked())
      .def("rk4_enter", &MujocoSimulations::rk4_enter, nb::arg("stage"), Unlocked())
      .def("rk4_leave", &MujocoSimulations::rk4_leave, nb::arg("stage"), Unlocked())
      .def("rk4_end", &MujocoSimulations::rk4_end, Unlocked());
  module.def("mujoco_arrays", &arrays_of, nb::arg("simulations"));
  module.def("mujoco_status", &status_of, nb::arg("simulations"));
}

}  // namespace stiction::python
