#include "core/io/readers.hpp"
#include "core/io/recorded_solve.hpp"

namespace stiction::io {
namespace {

constexpr std::int64_t kVersion = 1;

/// Reads PATH/ptr, PATH/col, PATH/val with `rows` rows; absent if the group is.
Csr read_csr(const InputFile& file, const std::string& path, std::size_t rows) {
  Csr matrix;
  if (!file.has(path)) return matrix;
  matrix.val = file.reals(path + "/val");
  matrix.col = file.integers<Index>(path + "/col", matrix.val.size());
  matrix.ptr = file.integers<Offset>(path + "/ptr", rows + 1);
  check_offsets(file, path + "/ptr", matrix.ptr, matrix.val.size());
  return matrix;
}

/// Refuses columns of J or M that are no degree of freedom of the row's environment. (Columns of A are checked by
/// stiction::validate with the rest of the problem; J and M are extras that are checked here alone.)
void check_columns(const InputFile& file, const std::string& path, const Csr& matrix,
                   const std::vector<Offset>& row_offsets, const std::vector<Offset>& dof_offsets) {
  for (std::size_t env = 0; env + 1 < row_offsets.size(); ++env) {
    const Offset dofs = dof_offsets[env + 1] - dof_offsets[env];
    const auto begin = matrix.ptr[static_cast<std::size_t>(row_offsets[env])];
    const auto end = matrix.ptr[static_cast<std::size_t>(row_offsets[env + 1])];
    for (Offset k = begin; k < end; ++k) {
      const Index column = matrix.col[static_cast<std::size_t>(k)];
      if (column < 0 || column >= dofs) {
        file.refuse_dataset(path + "/col", "holds " + std::to_string(column) + " at position " + std::to_string(k) +
                                               ", environment " + std::to_string(env) + " has " + std::to_string(dofs) +
                                               " degrees of freedom");
      }
    }
  }
}

/// Splits the file's one parameter per row into mu of friction rows and the bounds of box rows.
void read_row_parameters(const InputFile& file, ContactBatch<double>::Arrays& arrays) {
  const std::size_t rows = arrays.b.size();
  const std::vector<double> parameter = file.reals("row_param", rows);
  const bool asymmetric = file.has("row_lo") || file.has("row_hi");
  const std::vector<double> lo = asymmetric ? file.reals("row_lo", rows) : std::vector<double>();
  const std::vector<double> hi = asymmetric ? file.reals("row_hi", rows) : std::vector<double>();
  arrays.mu.assign(rows, 0.0);
  arrays.lo.assign(rows, 0.0);
  arrays.hi.assign(rows, 0.0);
  for (std::size_t cone = 0; cone < arrays.cone_kind.size(); ++cone) {
    const auto begin = static_cast<std::size_t>(arrays.cone_row_offsets[cone]);
    const auto end = static_cast<std::size_t>(arrays.cone_row_offsets[cone + 1]);
    for (std::size_t row = begin; row < end; ++row) {
      if (carries_friction(arrays.cone_kind[cone])) arrays.mu[row] = parameter[row];
      if (arrays.cone_kind[cone] == ConeKind::box) {
        arrays.lo[row] = asymmetric ? lo[row] : -parameter[row];
        arrays.hi[row] = asymmetric ? hi[row] : parameter[row];
      }
    }
  }
}

void read_dynamics(const InputFile& file, Recording& recording) {
  const auto& arrays = recording.batch.arrays();
  const std::size_t rows = arrays.b.size();
  if (file.has("row_target")) recording.row_target = file.reals("row_target", rows);
  if (file.has("env_dof_ptr")) {
    recording.env_dof_offsets = file.integers<Offset>("env_dof_ptr", arrays.env_row_offsets.size());
    // The number of degrees of freedom is the end of this array; arrays of that many elements are checked below.
    const Offset last = recording.env_dof_offsets.back();
    check_offsets(file, "env_dof_ptr", recording.env_dof_offsets, static_cast<std::size_t>(last));
    const auto dofs = static_cast<std::size_t>(last);
    if (file.has("v_free")) recording.v_free = file.reals("v_free", dofs);
    if (file.has("v_ref")) recording.v_ref = file.reals("v_ref", dofs);
    recording.J = read_csr(file, "J", rows);
    if (!recording.J.ptr.empty()) {
      check_columns(file, "J", recording.J, arrays.env_row_offsets, recording.env_dof_offsets);
    }
    recording.M = read_csr(file, "M", dofs);
    if (!recording.M.ptr.empty()) {
      check_columns(file, "M", recording.M, recording.env_dof_offsets, recording.env_dof_offsets);
    }
  } else {
    for (const char* part : {"J", "M", "v_free", "v_ref"}) {
      if (file.has(part)) file.refuse_dataset("env_dof_ptr", std::string("is missing, '") + part + "' needs it");
    }
  }
}

}  // namespace

Recording read_contact_batch(const InputFile& file) {
  const auto version = file.integer_attribute("version");
  if (!version) file.refuse("attribute 'version' is missing, expected 1");
  if (*version != kVersion) {
    file.refuse("contact-batch version " + std::to_string(*version) + " is not supported, expected 1");
  }

  ContactBatch<double>::Arrays arrays;
  arrays.b = file.reals("b");
  const std::size_t rows = arrays.b.size();
  arrays.R = file.reals("R", rows);
  const auto kinds = file.integers<std::uint8_t>("cone_kind");
  arrays.cone_kind.reserve(kinds.size());
  for (const std::uint8_t kind : kinds) arrays.cone_kind.push_back(static_cast<ConeKind>(kind));
  arrays.cone_row_offsets = file.integers<Offset>("cone_row_ptr", kinds.size() + 1);
  check_offsets(file, "cone_row_ptr", arrays.cone_row_offsets, rows);
  if (file.has("cone_group")) arrays.cone_group = file.integers<Index>("cone_group", kinds.size());
  arrays.env_row_offsets = file.integers<Offset>("env_row_ptr");
  check_offsets(file, "env_row_ptr", arrays.env_row_offsets, rows);
  arrays.env_cone_offsets = file.integers<Offset>("env_cone_ptr", arrays.env_row_offsets.size());
  check_offsets(file, "env_cone_ptr", arrays.env_cone_offsets, kinds.size());
  if (file.has("env_flags"))
    arrays.env_flags = file.integers<std::uint32_t>("env_flags", arrays.env_row_offsets.size() - 1);
  if (file.has("env_tolerance")) arrays.env_tolerance = file.reals("env_tolerance", arrays.env_row_offsets.size() - 1);
  if (file.has("env_max_iterations"))
    arrays.env_max_iterations = file.integers<Index>("env_max_iterations", arrays.env_row_offsets.size() - 1);
  if (!file.has("A")) file.refuse("group 'A' is missing");
  Csr A = read_csr(file, "A", rows);
  arrays.row_offsets = std::move(A.ptr);
  arrays.column = std::move(A.col);
  arrays.A = std::move(A.val);
  read_row_parameters(file, arrays);

  Recording recording;
  const std::size_t envs = arrays.env_row_offsets.size() - 1;
  recording.batch = ContactBatch<double>::from_arrays(read_law(file, std::nullopt), std::move(arrays));
  recording.source = file.text_attribute("source").value_or("");
  if (file.has("lambda_ref")) recording.lambda_ref = file.reals("lambda_ref", rows);
  if (file.has("env_name")) recording.env_name = file.strings("env_name", envs);
  if (file.has("step")) recording.step = file.integers<std::int64_t>("step", envs);
  if (file.has("dt")) recording.dt = file.reals("dt", envs);
  if (file.has("cone_id")) recording.cone_id = file.bits("cone_id", kinds.size());
  recording.solve = read_recorded_solve(file, rows);
  read_dynamics(file, recording);
  return recording;
}

}  // namespace stiction::io
