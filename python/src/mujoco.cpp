#include "python/src/mujoco.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <utility>

#include "python/src/mujoco_memory.hpp"
#include "stiction/error.hpp"

namespace stiction::python {

namespace {

const std::byte* bytes(const void* structure) {
  return static_cast<const std::byte*>(structure);
}

/// Ids last as long as a constraint does. An id is its kind, object and which of the object's rows. Or it is its pair
/// of geoms (0: something without a geom), which of the contacts that they share, and which edge of its pyramid.
std::uint64_t id_of(std::uint64_t kind, std::uint64_t first, std::uint64_t second, std::uint64_t number,
                    std::uint64_t edge) {
  return kind << 56U | first << 36U | second << 16U | number << 4U | edge;
}

}  // namespace

MujocoChunk::MujocoChunk(const MujocoLayout& layout, MujocoFunctions functions, const void* model,
                         std::vector<void*> data, std::size_t first, const SolverOptions& options, double warm_start)
    : layout_(layout),
      functions_(functions),
      model_(model),
      data_(std::move(data)),
      first_(first),
      options_(options),
      warm_start_(warm_start),
      active_(data_.size(), 1),
      cones_(data_.size(), 0),
      system_(mass_form_of(options, layout_.nv)),
      previous_(system_.mass_form),
      left_out_(data_.size(), 0),
      was_reset_(data_.size(), 0),
      starts_over_(data_.size(), 0),
      rk4_(data_.size()) {}

MassForm MujocoChunk::mass_form_of(const SolverOptions& options, Index nv) {
  return takes_newton(options) && nv <= kMostVelocityDofs ? MassForm::matrix : MassForm::factor;
}

void MujocoChunk::replace(std::size_t simulation, void* data) {
  data_[simulation] = data;
  reset_warm_start(simulation);
  starts_over_[simulation] = 0;  // the new one's accelerations are its own
}

void MujocoChunk::activate(const std::uint8_t* active) {
  active_.assign(active, active + data_.size());
}

void MujocoChunk::run(const std::vector<MujocoStage>& stages) {
  const MujocoErrors errors(functions_.handlers);
  each([&](std::size_t env) {
    for (const MujocoStage& stage : stages)
      stage.function != nullptr ? errors.call(stage.function, model_, data_[env], first_ + env)
                                : run_own(stage.own, env);
  });
}

void MujocoChunk::run_own(OwnStage stage, std::size_t env) {
  const auto number = [stage](OwnStage first) { return 1 + static_cast<int>(stage) - static_cast<int>(first); };
  switch (stage) {
    case OwnStage::count: {
      const auto* data = bytes(data_[env]);
      cones_[env] = count_cones(data, number_at<std::int32_t>(data, layout_.nefc));
      return;
    }
    case OwnStage::write_back:
      return write_back(env);
    case OwnStage::renew_forces:
      static_cast<std::uint8_t*>(data_[env])[layout_.flg_rnepost] = 0;
      return;
    case OwnStage::rk4_begin:
      return rk4_begin(env);
    case OwnStage::rk4_enter_1:
    case OwnStage::rk4_enter_2:
    case OwnStage::rk4_enter_3:
      return rk4_enter(env, number(OwnStage::rk4_enter_1));
    case OwnStage::rk4_leave_1:
    case OwnStage::rk4_leave_2:
    case OwnStage::rk4_leave_3:
      return rk4_leave(env, number(OwnStage::rk4_leave_1));
    case OwnStage::rk4_end:
      return rk4_end(env);
    case OwnStage::end:
      return;
  }
}

void MujocoChunk::write_controls(const double* controls) {
  const auto width = static_cast<std::size_t>(layout_.nu);
  if (width == 0) return;
  each([&](std::size_t env) {
    std::memcpy(array_at<double>(bytes(data_[env]), layout_.ctrl), controls + env * width, width * sizeof(double));
  });
}

const double* MujocoChunk::set_masses(const double* masses) {
  const auto each_one = static_cast<std::size_t>(layout_.nv) * static_cast<std::size_t>(layout_.nv);
  system_.has_own_zeros = false;
  each([&](std::size_t env) {
    std::memcpy(system_.M.data() + system_.env_mass_offsets[env], masses, each_one * sizeof(double));
    masses += each_one;
  });
  return masses;
}

void MujocoChunk::read(std::size_t offset, std::size_t width, double* to) const {
  if (width == 0) return;
  for (std::size_t env = 0; env < data_.size(); ++env)
    std::memcpy(to + env * width, array_at<const double>(bytes(data_[env]), offset), width * sizeof(double));
}

Index MujocoChunk::count_cones(const std::byte* data, Index rows) const {
  const auto* type = array_at<const std::int32_t>(data, layout_.efc_type);
  const auto* id = array_at<const std::int32_t>(data, layout_.efc_id);
  const auto* contact = array_at<const std::byte>(data, layout_.contact);
  Index cones = 0;
  for (Index row = 0; row < rows; ++cones) {
    const auto kind = static_cast<std::size_t>(type[row]);
    if (kind >= layout_.row_kind.size())
      throw Error(ErrorCode::unsupported, "constraint rows of MuJoCo's type " + std::to_string(kind) +
                                              " are not known here; known are those of MuJoCo 4.0");
    const bool friction = layout_.row_kind[kind] == static_cast<std::int32_t>(ConeKind::friction);
    const auto offset = static_cast<std::size_t>(id[row]) * layout_.contact_bytes;
    row += friction ? number_at<std::int32_t>(contact + offset, layout_.contact_dim) : 1;
  }
  return cones;
}

void MujocoChunk::place(Rowless rowless) {
  MujocoSystem& to = system_;
  const std::size_t envs = data_.size();
  for (auto* offsets : {&to.env_row_offsets, &to.env_cone_offsets, &to.env_dof_offsets, &to.env_mass_offsets})
    offsets->assign(envs + 1, 0);
  Offset entries = 0;
  for (std::size_t env = 0; env < envs; ++env) {
    const Offset rows = active_[env] != 0 ? number_at<std::int32_t>(bytes(data_[env]), layout_.nefc) : 0;
    left_out_[env] = active_[env] != 0 && rows == 0 && rowless == Rowless::left_out ? 1 : 0;
    const Offset dofs = active_[env] != 0 && left_out_[env] == 0 ? layout_.nv : 0;
    to.env_row_offsets[env + 1] = to.env_row_offsets[env] + rows;
    to.env_cone_offsets[env + 1] = to.env_cone_offsets[env] + (active_[env] != 0 ? cones_[env] : 0);
    to.env_dof_offsets[env + 1] = to.env_dof_offsets[env] + dofs;
    to.env_mass_offsets[env + 1] = to.env_mass_offsets[env] + dofs * dofs;
    entries += rows * dofs;
  }
  const auto rows = static_cast<std::size_t>(to.env_row_offsets.back());
  const auto all_cones = static_cast<std::size_t>(to.env_cone_offsets.back());
  for (auto* row_array : {&to.target, &to.R, &to.mu, &to.lo, &to.hi, &to.lambda}) row_array->resize(rows);
  for (auto* dof_array : {&to.v_free, &to.start, &to.velocity})
    dof_array->resize(static_cast<std::size_t>(to.env_dof_offsets.back()));
  // Masses have the places of their zeros in common: zeros stay so.
  if (!to.has_own_zeros) to.M.clear();
  to.M.resize(static_cast<std::size_t>(to.env_mass_offsets.back()));
  to.has_own_zeros = true;
  to.J.resize(static_cast<std::size_t>(entries));
  to.row_offsets.resize(rows + 1);
  to.cone_kind.resize(all_cones);
  to.cone_id.resize(all_cones);
  to.cone_row_offsets.resize(all_cones + 1);
  to.status.resize(envs);
  to.row_offsets.back() = entries;
  to.cone_row_offsets.back() = to.env_row_offsets.back();
}

void MujocoChunk::fill_cones(const std::byte* data, Offset row, Offset cone, Index rows) {
  const auto* type = array_at<const std::int32_t>(data, layout_.efc_type);
  const auto* id = array_at<const std::int32_t>(data, layout_.efc_id);
  const auto* contact = array_at<const std::byte>(data, layout_.contact);
  const auto* loss = array_at<const double>(data, layout_.efc_frictionloss);
  std::uint64_t last_pair = 0;
  std::uint64_t number = 0;
  std::uint64_t edge = 0;
  std::int32_t last_contact = -1;
  std::uint64_t row_of_object = 0;
  for (Index i = 0; i < rows; ++cone) {
    const auto mujoco_kind = static_cast<std::size_t>(type[i]);
    const std::int32_t kind = layout_.row_kind[mujoco_kind];
    const auto object = static_cast<std::uint64_t>(id[i]);
    auto cone_kind = kind == kPyramid ? ConeKind::unilateral : static_cast<ConeKind>(kind);
    auto at = static_cast<std::size_t>(row + i);
    Index size = 1;
    system_.mu[at] = system_.lo[at] = system_.hi[at] = 0.0;
    // A weld has six rows under its number, a limit one or two.
    const bool is_same = i > 0 && type[i] == type[i - 1] && id[i] == id[i - 1];
    row_of_object = is_same ? row_of_object + 1 : 0;
    system_.cone_id[static_cast<std::size_t>(cone)] = id_of(mujoco_kind, object, 0, row_of_object, 0);
    if (cone_kind == ConeKind::box) {
      system_.lo[at] = -loss[i];
      system_.hi[at] = loss[i];
    }
    if (mujoco_kind >= 5) {  // contacts are MuJoCo's last kinds
      const std::byte* one = contact + object * layout_.contact_bytes;
      const auto first = static_cast<std::uint64_t>(number_at<std::int32_t>(one, layout_.contact_geom)) + 1;
      const auto second = static_cast<std::uint64_t>(number_at<std::int32_t>(one, layout_.contact_geom + 4)) + 1;
      const std::uint64_t pair = first << 32U | second;
      if (id[i] != last_contact) {
        number = pair == last_pair ? number + 1 : 0;
        edge = 0;
      } else {
        ++edge;
      }
      last_contact = id[i];
      last_pair = pair;
      system_.cone_id[static_cast<std::size_t>(cone)] = id_of(5, first, second, number, edge);
      if (cone_kind == ConeKind::friction) {
        size = number_at<std::int32_t>(one, layout_.contact_dim);
        for (Index axis = 1; axis < size; ++axis) {
          const auto place = layout_.contact_friction + static_cast<std::size_t>(axis - 1) * sizeof(double);
          const auto axis_row = at + static_cast<std::size_t>(axis);
          system_.mu[axis_row] = number_at<double>(one, place);
          system_.lo[axis_row] = system_.hi[axis_row] = 0.0;
        }
      }
    }
    system_.cone_kind[static_cast<std::size_t>(cone)] = static_cast<std::uint8_t>(cone_kind);
    system_.cone_row_offsets[static_cast<std::size_t>(cone)] = row + i;
    i += size;
  }
}

void MujocoChunk::fill_jacobian(const std::byte* data, double* J, Index rows) const {
  const auto* values = array_at<const double>(data, layout_.efc_J);
  const auto nv = static_cast<std::size_t>(layout_.nv);
  if (!layout_.sparse) {
    if (system_.mass_form == MassForm::matrix) {
      std::memcpy(J, values, static_cast<std::size_t>(rows) * nv * sizeof(double));
      return;
    }
    for (Index row = 0; row < rows; ++row, J += nv, values += nv) std::reverse_copy(values, values + nv, J);
    return;
  }
  const auto* count = array_at<const std::int32_t>(data, layout_.efc_J_rownnz);
  const auto* first = array_at<const std::int32_t>(data, layout_.efc_J_rowadr);
  const auto* column = array_at<const std::int32_t>(data, layout_.efc_J_colind);
  for (Index row = 0; row < rows; ++row, J += nv) {
    for (std::size_t dof = 0; dof < nv; ++dof) J[dof] = 0.0;
    for (std::int32_t entry = first[row]; entry < first[row] + count[row]; ++entry)
      J[place_of(static_cast<std::size_t>(column[entry]))] = values[entry];
  }
}

void MujocoChunk::fill_mass(const std::byte* data, double* M) const {
  if (system_.mass_form == MassForm::factor) {
    fill_factor(data, M);
    return;
  }
  const auto* values = array_at<const double>(data, layout_.mass);
  const auto nv = static_cast<std::size_t>(layout_.nv);
  std::size_t entry = 0;
  for (std::size_t row = 0; row < nv; ++row, M += nv)
    for (const std::size_t end = entry + static_cast<std::size_t>(layout_.mass_rownnz[row]); entry < end; ++entry)
      M[layout_.mass_colind[entry]] = values[entry];
}

void MujocoChunk::fill_factor(const std::byte* data, double* factor) const {
  const auto* values = array_at<const double>(data, layout_.qLD);
  const auto nv = static_cast<std::size_t>(layout_.nv);
  std::size_t entry = 0;
  for (std::size_t row = 0; row < nv; ++row) {
    const auto count = static_cast<std::size_t>(layout_.mass_rownnz[row]);
    double* column = factor + (nv - 1 - row);
    const double root = std::sqrt(values[entry + count - 1]);  // a row's diagonal is its last entry
    for (std::size_t end = entry + count - 1; entry < end; ++entry)
      column[(nv - 1 - static_cast<std::size_t>(layout_.mass_colind[entry])) * nv] = root * values[entry];
    column[(nv - 1 - row) * nv] = root;
    ++entry;
  }
}

void MujocoChunk::fill_motion(const std::byte* data, double* v_free, double* start, double* M) const {
  const auto nv = static_cast<std::size_t>(layout_.nv);
  const auto* smooth = array_at<const double>(data, layout_.qacc_smooth);
  if (system_.mass_form == MassForm::matrix) {
    std::memcpy(v_free, smooth, nv * sizeof(double));
    std::memcpy(start, array_at<const double>(data, layout_.qacc_warmstart), nv * sizeof(double));
  } else {
    std::reverse_copy(smooth, smooth + nv, v_free);
  }
  fill_mass(data, M);
}

void MujocoChunk::fill(std::size_t env) {
  if (left_out_[env] != 0) return;
  const auto* data = bytes(data_[env]);
  const Offset row = system_.env_row_offsets[env], dof = system_.env_dof_offsets[env];
  const auto rows = static_cast<Index>(system_.env_row_offsets[env + 1] - row);
  const auto nv = static_cast<Offset>(layout_.nv);
  const auto bytes_of = [](Offset count) { return static_cast<std::size_t>(count) * sizeof(double); };
  double* start = system_.start.data() + dof;
  fill_motion(data, system_.v_free.data() + dof, start, system_.M.data() + system_.env_mass_offsets[env]);
  if (starts_over_[env] != 0) std::fill_n(start, nv, 0.0);
  if (rows == 0) return;

  // Rows of one simulation have as many entries each, and inactive ones have none, so the row's number gives the place.
  const Offset first_entry = row * nv;
  for (Index i = 0; i < rows; ++i) system_.row_offsets[static_cast<std::size_t>(row + i)] = first_entry + i * nv;
  fill_jacobian(data, system_.J.data() + first_entry, rows);
  std::memcpy(system_.target.data() + row, array_at<const double>(data, layout_.efc_aref), bytes_of(rows));
  std::memcpy(system_.R.data() + row, array_at<const double>(data, layout_.efc_R), bytes_of(rows));
  fill_cones(data, row, system_.env_cone_offsets[env], rows);
}

void MujocoChunk::gather(Rowless rowless) {
  // The last rows are of use only to solves that start from reactions. Else one system's memory stays in the cache.
  if (!starts_from_accelerations()) std::swap(system_, previous_);
  place(rowless);
  each([this](std::size_t env) { fill(env); });
}

MujocoSystem MujocoChunk::whole_system() const {
  MujocoSystem whole = system_;
  if (std::find(left_out_.begin(), left_out_.end(), 1) == left_out_.end()) return whole;
  const auto nv = static_cast<std::size_t>(layout_.nv);
  for (std::size_t env = 0; env < data_.size(); ++env) {
    const Offset dofs =
        left_out_[env] != 0 ? Offset{layout_.nv} : system_.env_dof_offsets[env + 1] - system_.env_dof_offsets[env];
    whole.env_dof_offsets[env + 1] = whole.env_dof_offsets[env] + dofs;
    whole.env_mass_offsets[env + 1] = whole.env_mass_offsets[env] + dofs * dofs;
  }
  for (auto* array : {&whole.v_free, &whole.start, &whole.velocity})
    array->resize(static_cast<std::size_t>(whole.env_dof_offsets.back()));
  whole.M.assign(static_cast<std::size_t>(whole.env_mass_offsets.back()), 0.0);
  for (std::size_t env = 0; env < data_.size(); ++env) {
    const Offset dof = whole.env_dof_offsets[env], mass = whole.env_mass_offsets[env];
    double* const v_free = whole.v_free.data() + dof;
    if (left_out_[env] != 0) {
      fill_motion(bytes(data_[env]), v_free, whole.start.data() + dof, whole.M.data() + mass);
      std::copy_n(v_free, nv, whole.velocity.data() + dof);
      continue;
    }
    const Offset from = system_.env_dof_offsets[env], dofs = system_.env_dof_offsets[env + 1] - from;
    std::copy_n(system_.v_free.data() + from, dofs, v_free);
    std::copy_n(system_.start.data() + from, dofs, whole.start.data() + dof);
    std::copy_n(system_.velocity.data() + from, dofs, whole.velocity.data() + dof);
    std::copy_n(system_.M.data() + system_.env_mass_offsets[env], dofs * dofs, whole.M.data() + mass);
  }
  return whole;
}

}  // namespace stiction::python
