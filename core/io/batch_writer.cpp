#include <bit>
#include <limits>

#include "core/base/fp_env.hpp"
#include "core/io/hdf5_out.hpp"
#include "core/io/recorded_solve.hpp"
#include "stiction/error.hpp"
#include "stiction/io.hpp"

namespace stiction::io {
namespace {

void require_csr(const char* name, const Csr& matrix, std::size_t rows) {
  const std::string text = name;
  require_length("write_batch: recording." + text + ".ptr", matrix.ptr.size(), rows + 1);
  const bool ends = matrix.ptr.empty() || matrix.ptr.back() == static_cast<Offset>(matrix.val.size());
  if (matrix.col.size() != matrix.val.size() || !ends) {
    throw Error(ErrorCode::invalid_argument,
                "write_batch: recording." + text + " has " + std::to_string(matrix.col.size()) + " columns and " +
                    std::to_string(matrix.val.size()) + " values, expected both as ptr ends");
  }
}

/// Refuses batches that read_batch would refuse, before a file is made of them.
void check(const Recording& recording) {
  if (!recording.batch.arrays().factor.empty())
    throw Error(
        ErrorCode::invalid_argument,
        "write_batch: recording.batch keeps environments as factors, which the format does not know: assemble it "
        "with FactorUse::never");
  const auto& arrays = recording.batch.arrays();
  const std::size_t envs = arrays.env_row_offsets.size() - 1;
  const std::size_t rows = arrays.b.size();
  require_length("write_batch: recording.env_dof_offsets", recording.env_dof_offsets.size(), envs + 1);
  const std::size_t dofs =
      recording.env_dof_offsets.empty() ? 0 : static_cast<std::size_t>(recording.env_dof_offsets.back());
  const bool dynamics =
      !recording.J.ptr.empty() || !recording.M.ptr.empty() || !recording.v_free.empty() || !recording.v_ref.empty();
  if (dynamics && recording.env_dof_offsets.empty()) {
    throw Error(ErrorCode::invalid_argument,
                "write_batch: recording.env_dof_offsets is empty, J, M, v_free and v_ref need it");
  }
  require_csr("J", recording.J, rows);
  require_csr("M", recording.M, dofs);
  require_length("write_batch: recording.v_free", recording.v_free.size(), dofs);
  require_length("write_batch: recording.v_ref", recording.v_ref.size(), dofs);
  require_length("write_batch: recording.row_target", recording.row_target.size(), rows);
  require_length("write_batch: recording.lambda_ref", recording.lambda_ref.size(), rows);
  require_length("write_batch: recording.env_name", recording.env_name.size(), envs);
  require_length("write_batch: recording.step", recording.step.size(), envs);
  require_length("write_batch: recording.dt", recording.dt.size(), envs);
  require_length("write_batch: recording.cone_id", recording.cone_id.size(), arrays.cone_kind.size());
  if (recording.solve) check_recorded_solve(*recording.solve, rows);
}

struct RowParameters {
  std::vector<double> param, lo, hi;
  bool asymmetric = false;  ///< lo and hi must be written
};

RowParameters row_parameters(const ContactBatch<double>::Arrays& arrays) {
  RowParameters out;
  out.param.assign(arrays.b.size(), 0.0);
  out.lo = out.param;
  out.hi = out.param;
  for (std::size_t cone = 0; cone < arrays.cone_kind.size(); ++cone) {
    const auto begin = static_cast<std::size_t>(arrays.cone_row_offsets[cone]);
    const auto end = static_cast<std::size_t>(arrays.cone_row_offsets[cone + 1]);
    for (std::size_t row = begin; row < end; ++row) {
      if (carries_friction(arrays.cone_kind[cone])) out.param[row] = arrays.mu[row];
      if (arrays.cone_kind[cone] != ConeKind::box) continue;
      const double lo = arrays.lo[row], hi = arrays.hi[row];
      out.lo[row] = lo;
      out.hi[row] = hi;
      // A reader that does not know row_lo must fail on a box that is not symmetric rather than misread it.
      out.param[row] = lo == -hi ? hi : std::numeric_limits<double>::quiet_NaN();
      // Compared by bits, so that a lower bound of +0 is not replayed as the -0 that the symmetric form would give.
      if (std::bit_cast<std::uint64_t>(lo) != std::bit_cast<std::uint64_t>(-hi)) out.asymmetric = true;
    }
  }
  return out;
}

void write_csr(OutputFile& file, const std::string& path, const Csr& matrix) {
  if (matrix.ptr.empty()) return;
  file.group(path);
  file.array(path + "/ptr", matrix.ptr);
  file.array(path + "/col", matrix.col);
  file.array(path + "/val", matrix.val);
}

template <class T>
void write_optional(OutputFile& file, const std::string& path, const std::vector<T>& values) {
  if (!values.empty()) file.array(path, values);
}

}  // namespace

void write_batch(const std::filesystem::path& path, const Recording& recording) {
  const ScopedFpEnv fp_env;
  check(recording);
  const auto& arrays = recording.batch.arrays();
  OutputFile file(path);
  file.attribute("format", "contact-batch");
  file.attribute("version", std::int64_t{1});
  file.attribute("source", recording.source);
  file.attribute("law", to_string(recording.batch.law()));

  file.array("env_row_ptr", arrays.env_row_offsets);
  file.array("env_cone_ptr", arrays.env_cone_offsets);
  std::vector<std::uint8_t> kinds;
  kinds.reserve(arrays.cone_kind.size());
  for (const ConeKind kind : arrays.cone_kind) kinds.push_back(static_cast<std::uint8_t>(kind));
  file.array("cone_kind", kinds);
  file.array("cone_row_ptr", arrays.cone_row_offsets);
  write_optional(file, "cone_group", arrays.cone_group);
  write_optional(file, "env_flags", arrays.env_flags);
  write_optional(file, "env_tolerance", arrays.env_tolerance);
  write_optional(file, "env_max_iterations", arrays.env_max_iterations);
  const RowParameters rows = row_parameters(arrays);
  file.array("row_param", rows.param);
  if (rows.asymmetric) {
    file.array("row_lo", rows.lo);
    file.array("row_hi", rows.hi);
  }
  file.group("A");
  file.array("A/ptr", arrays.row_offsets);
  file.array("A/col", arrays.column);
  file.array("A/val", arrays.A);
  file.array("b", arrays.b);
  file.array("R", arrays.R);

  write_optional(file, "env_dof_ptr", recording.env_dof_offsets);
  write_csr(file, "J", recording.J);
  write_csr(file, "M", recording.M);
  write_optional(file, "v_free", recording.v_free);
  write_optional(file, "row_target", recording.row_target);
  write_optional(file, "lambda_ref", recording.lambda_ref);
  write_optional(file, "v_ref", recording.v_ref);
  if (!recording.env_name.empty()) file.strings("env_name", recording.env_name);
  write_optional(file, "step", recording.step);
  write_optional(file, "dt", recording.dt);
  write_optional(file, "cone_id", recording.cone_id);
  if (recording.solve) write_recorded_solve(file, *recording.solve);
  file.commit();
}

}  // namespace stiction::io
