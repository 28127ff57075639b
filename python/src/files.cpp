#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <memory>
#include <span>
#include <utility>

#include "python/src/as_numpy.hpp"
#include "python/src/packed.hpp"
#include "python/src/solver.hpp"
#include "stiction/io.hpp"
#include "stiction/jacobian.hpp"
#include "stiction/recorder.hpp"

namespace nb = nanobind;

namespace stiction::python {

namespace {

nb::object kinds_as_numpy(const std::vector<ConeKind>& kinds, nb::handle owner) {
  return as_numpy(std::span(reinterpret_cast<const std::uint8_t*>(kinds.data()), kinds.size()), owner);
}

/// The batch of a file in the precision asked for, with the file's other contents.
struct FileBatch {
  io::Recording recording;
  ContactBatch<float> narrow;  ///< filled where the numbers are wanted in f32
};

template <class Real>
nb::dict arrays_of(const ContactBatch<Real>& batch, nb::handle owner) {
  const auto& from = batch.arrays();
  nb::dict to;
  to["env_row_offsets"] = as_numpy(from.env_row_offsets, owner);
  to["env_cone_offsets"] = as_numpy(from.env_cone_offsets, owner);
  to["cone_kind"] = kinds_as_numpy(from.cone_kind, owner);
  to["cone_row_offsets"] = as_numpy(from.cone_row_offsets, owner);
  to["row_offsets"] = as_numpy(from.row_offsets, owner);
  to["column"] = as_numpy(from.column, owner);
  to["A"] = as_numpy(from.A, owner);
  to["b"] = as_numpy(from.b, owner);
  to["R"] = as_numpy(from.R, owner);
  to["mu"] = as_numpy(from.mu, owner);
  to["lo"] = as_numpy(from.lo, owner);
  to["hi"] = as_numpy(from.hi, owner);
  const auto optional = [&](const char* name, const auto& values) {
    if (!values.empty()) to[name] = as_numpy(values, owner);
  };
  optional("cone_group", from.cone_group);
  optional("env_flags", from.env_flags);
  optional("env_tolerance", from.env_tolerance);
  optional("env_max_iterations", from.env_max_iterations);
  return to;
}

nb::dict extras_of(const io::Recording& recording, nb::handle owner) {
  nb::dict to;
  const auto optional = [&](const char* name, const auto& values) {
    if (!values.empty()) to[name] = as_numpy(values, owner);
  };
  optional("env_dof_offsets", recording.env_dof_offsets);
  optional("v_free", recording.v_free);
  optional("target", recording.row_target);
  optional("lambda_ref", recording.lambda_ref);
  optional("v_ref", recording.v_ref);
  optional("step", recording.step);
  optional("dt", recording.dt);
  optional("cone_id", recording.cone_id);
  const auto matrix = [&](const std::string& name, const io::Csr& csr) {
    if (csr.ptr.empty()) return;
    to[(name + "_offsets").c_str()] = as_numpy(csr.ptr, owner);
    to[(name + "_column").c_str()] = as_numpy(csr.col, owner);
    to[name.c_str()] = as_numpy(csr.val, owner);
  };
  matrix("J", recording.J);
  matrix("M", recording.M);
  to["env_name"] = nb::cast(recording.env_name);
  to["source"] = nb::cast(recording.source);
  return to;
}

nb::tuple read(const std::string& path, bool wide) {
  auto file = std::make_unique<FileBatch>();
  {
    const nb::gil_scoped_release unlocked;
    file->recording = io::read_batch(path);
    if (!wide) file->narrow = convert<float>(file->recording.batch);
  }
  const FileBatch& batch = *file;
  const nb::object owner = nb::cast(file.release(), nb::rv_policy::take_ownership);
  const nb::dict arrays = wide ? arrays_of(batch.recording.batch, owner) : arrays_of(batch.narrow, owner);
  return nb::make_tuple(to_string(batch.recording.batch.law()), arrays, extras_of(batch.recording, owner));
}

template <class T>
std::vector<T> copied(const nb::dict& arrays, const char* name) {
  if (!arrays.contains(name)) return {};
  const auto* array = nb::cast<const Array*>(arrays[name]);
  const T* first = array->read<T>(name);
  return std::vector<T>(first, first + array->size());
}

void keep(io::Recording&, const ContactView&) {}
void keep(io::Recording& recording, const JacobianView& batch) {
  std::visit([&](const auto& view) { io::keep_dynamics(recording, on_host(view)); }, batch.view);
}

template <class View>
void write(const std::string& path, const View& batch, const nb::dict& extras, const std::vector<std::string>& env_name,
           const std::string& source) {
  io::Recording recording;
  recording.batch = packed(batch);
  recording.source = source;
  recording.env_name = env_name;
  recording.lambda_ref = copied<double>(extras, "lambda_ref");
  recording.cone_id = copied<std::uint64_t>(extras, "cone_id");
  recording.step = copied<std::int64_t>(extras, "step");
  recording.dt = copied<double>(extras, "dt");
  const nb::gil_scoped_release unlocked;
  keep(recording, batch);
  io::write_batch(path, recording);
}

/// Writes environments that were not solved to one file.
class FailureFile {
 public:
  FailureFile(const std::string& path, Offset most) : recorder_(path, {io::RecordWhen::failed, most, {}}) {}

  Offset take(const FormSolver& solver, const ContactView& batch, const Outputs& out, const Array* warm_start) {
    return std::visit(
        [&]<class Real>(const ContactBatchView<Real>& view) {
          const auto solution = solution_view<Real>(out, view.row_count, view.env_count);
          const Real* guess = guess_of<Real>(warm_start, view.row_count);
          const nb::gil_scoped_release unlocked;
          return recorder_.take(solver.contact(), view, solution, guess);
        },
        batch.view);
  }
  /// J and M, and the batch assembled of them: its matrix even where the solver kept a factor.
  Offset take(const FormSolver& solver, const JacobianView& batch, const Outputs& out, const Array* warm_start,
              bool of_bodies) {
    return std::visit(
        [&]<class Real>(const JacobianBatchView<Real>& view) {
          const auto solution = solution_view<Real>(out, view.row_count, view.env_count);
          const Real* guess = guess_of<Real>(warm_start, view.row_count);
          const nb::gil_scoped_release unlocked;
          return recorder_.take(solver.contact(), on_host(view), solution, guess,
                                of_bodies ? io::RecordedForm::bodies : io::RecordedForm::jacobian);
        },
        batch.view);
  }
  [[nodiscard]] Offset recorded() const noexcept { return recorder_.recorded(); }
  [[nodiscard]] Offset left_out() const noexcept { return recorder_.left_out(); }

 private:
  io::Recorder recorder_;
};

Offset take_matrices(FailureFile& file, const FormSolver& solver, const ContactView& batch, const Array* lambda,
                     const Array* status, const Array* warm_start) {
  return file.take(solver, batch, {lambda, nullptr, nullptr, status}, warm_start);
}

Offset take_jacobians(FailureFile& file, const FormSolver& solver, const JacobianView& batch, const Array* lambda,
                      const Array* status, const Array* warm_start, bool of_bodies) {
  return file.take(solver, batch, {lambda, nullptr, nullptr, status}, warm_start, of_bodies);
}

}  // namespace

void bind_files(nb::module_& module) {
  const nb::class_<FileBatch> file_batch(module, "FileBatch", "Memory of a batch that was read from a file.");
  module.def("read", &read, nb::arg("path"), nb::arg("wide"), "(law, arrays, extras) of a batch file.");
  module.def("write", &write<ContactView>, nb::arg("path"), nb::arg("batch"), nb::arg("extras"), nb::arg("env_name"),
             nb::arg("source"), "Writes a packed copy of a host batch.");
  module.def("write", &write<JacobianView>, nb::arg("path"), nb::arg("batch"), nb::arg("extras"), nb::arg("env_name"),
             nb::arg("source"), "Writes a packed copy of a host batch, with J and M.");
  nb::class_<FailureFile>(module, "FailureFile", "Environments that were not solved, with what replays them.")
      .def(nb::init<const std::string&, Offset>(), nb::arg("path"), nb::arg("most"))
      .def("take", &take_matrices, nb::arg("solver"), nb::arg("batch"), nb::arg("lambda_"), nb::arg("status"),
           nb::arg("warm_start").none())
      .def("take", &take_jacobians, nb::arg("solver"), nb::arg("batch"), nb::arg("lambda_"), nb::arg("status"),
           nb::arg("warm_start").none(), nb::arg("of_bodies") = false)
      .def_prop_ro("recorded", &FailureFile::recorded)
      .def_prop_ro("left_out", &FailureFile::left_out);
}

}  // namespace stiction::python
