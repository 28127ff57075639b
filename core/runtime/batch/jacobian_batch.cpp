#include <algorithm>
#include <string>

#include "core/base/extents.hpp"
#include "core/machine/jacobian_machine.hpp"
#include "core/runtime/check/defects.hpp"
#include "core/runtime/check/expect.hpp"
#include "core/runtime/check/stored_columns.hpp"
#include "stiction/batch_arrays.hpp"

namespace stiction {

namespace {

template <class T>
void append(std::vector<T>& to, const std::vector<T>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

/// Appends `from`, or zeros where it was left out.
template <class Real>
void append_rows(std::vector<Real>& to, const std::vector<Real>& from, std::size_t rows) {
  to.resize(to.size() + rows, Real(0));
  std::copy(from.begin(), from.end(), to.end() - static_cast<std::ptrdiff_t>(rows));
}

Offset block_rows(Index mass_block, Offset dofs) {
  return mass_block == 0 ? dofs : mass_block;
}

template <class Name>
void check_blocks(Index mass_block, Offset dofs, const Name& name) {
  if (dofs % larger_of<Offset>(1, block_rows(mass_block, dofs)) == 0) return;
  refuse(std::string(name()) + " has " + std::to_string(dofs) + " degrees of freedom, which blocks of " +
         std::to_string(mass_block) + " do not tile; choose another mass_block, or 0 for one dense block");
}

/// Shapes of one environment, and its rows.
template <class Real>
std::size_t check_shape(const JacobianEnvironment<Real>& env, Index mass_block) {
  Offset tiled = 0;
  for (std::size_t c = 0; c < env.cones.size(); ++c) {
    if (env.cones[c].row_count < 1)
      refuse("cones[" + std::to_string(c) + "].row_count = " + std::to_string(env.cones[c].row_count) +
             ", expected at least 1");
    tiled += env.cones[c].row_count;
  }
  const auto rows = static_cast<std::size_t>(tiled);
  const std::size_t dofs = env.v_free.size();
  check_blocks(mass_block, static_cast<Offset>(dofs), [] { return "the environment"; });
  expect_length("M", env.M.size(), dofs * static_cast<std::size_t>(block_rows(mass_block, static_cast<Offset>(dofs))),
                "degrees of freedom times rows of a block");
  if (env.row_offsets.empty() && env.column.empty()) {
    expect_length("J", env.J.size(), rows * dofs, "rows of the cones times length of v_free");
  } else {
    expect_length("row_offsets", env.row_offsets.size(), rows + 1, "one per row of the cones, and one");
    expect_length("column", env.column.size(), env.J.size(), "one per entry of J");
    if (env.row_offsets.front() != 0 || env.row_offsets.back() != static_cast<Index>(env.J.size()) ||
        !std::is_sorted(env.row_offsets.begin(), env.row_offsets.end()))
      refuse("row_offsets do not lead from 0 forward to " + std::to_string(env.J.size()) + ", the length of J");
    if (!all_below(env.column, static_cast<Index>(dofs)))
      refuse("column holds an entry outside of 0.." + std::to_string(static_cast<Offset>(dofs) - 1) +
             ", the degrees of freedom of v_free");
  }
  const auto optional = [rows](const char* name, const std::vector<Real>& values) {
    if (!values.empty()) expect_length(name, values.size(), rows, "one per row of the cones; or none for zeros");
  };
  optional("target", env.target);
  optional("R", env.R);
  optional("mu", env.mu);
  optional("lo", env.lo);
  optional("hi", env.hi);
  return rows;
}

/// Checks the part in use of an array, by offsets and the counts that may stand in for the next one's beginning.
void check_parts(const char* name, const Offset* offsets, const Index* counts, Offset parts, Offset total,
                 DefectReport& report) {
  if (offsets == nullptr) refuse(std::string(name) + " is null; point it to the batch's array");
  check_offsets(
      name, std::span(offsets, static_cast<std::size_t>(parts) + 1), total, "entries", [](Offset) { return Defect{}; },
      report);
  for (Offset i = 0; counts != nullptr && i < parts; ++i)
    if (counts[i] < 0 || counts[i] > offsets[i + 1] - offsets[i])
      refuse("the count of " + std::string(name) + "[" + std::to_string(i) + "], " + std::to_string(counts[i]) +
             ", is not in 0.." + std::to_string(offsets[i + 1] - offsets[i]) + ", the room there");
}

}  // namespace

template <class Real>
void check_structure(const JacobianBatchView<Real>& batch) {
  if (batch.space != MemorySpace::host)
    refuse("the batch is in device memory, which the CPU does not read: solve it with a JacobianSolver of that device");
  for (const Offset count : {batch.env_count, batch.cone_count, batch.row_count, batch.dof_count, batch.entry_count,
                             batch.mass_count, Offset{batch.mass_block}})
    if (count < 0) refuse("a count of the view is " + std::to_string(count) + ": counts must be >= 0; fix the view");
  DefectReport report(1);
  check_parts("env_row_offsets", batch.env_row_offsets, batch.env_row_counts, batch.env_count, batch.row_count, report);
  check_parts("env_cone_offsets", batch.env_cone_offsets, batch.env_cone_counts, batch.env_count, batch.cone_count,
              report);
  check_parts("env_dof_offsets", batch.env_dof_offsets, nullptr, batch.env_count, batch.dof_count, report);
  check_parts("env_mass_offsets", batch.env_mass_offsets, nullptr, batch.env_count, batch.mass_count, report);
  check_parts("cone_row_offsets", batch.cone_row_offsets, nullptr, batch.cone_count, batch.row_count, report);
  check_parts("row_offsets", batch.row_offsets, nullptr, batch.row_count, batch.entry_count, report);
  if (report.full()) refuse(report.take().front().message);
  if (const char* name = missing_array(batch); name != nullptr)
    refuse(std::string(name) + " is null; point it to the batch's array");
  for (Offset env = 0; env < batch.env_count; ++env) {
    const auto where = [env] { return "env " + std::to_string(env); };
    const Offset dofs = batch.env_dofs(env), block = block_rows(batch.mass_block, dofs);
    check_blocks(batch.mass_block, dofs, where);
    const Offset room = batch.env_mass_offsets[env + 1] - batch.env_mass_offsets[env];
    if (room < dofs * block)
      refuse("M of " + where() + " has room for " + std::to_string(room) + " entries, its " + std::to_string(dofs) +
             " degrees of freedom take " + std::to_string(dofs * block) + "; fix env_mass_offsets");
    const Offset first = batch.env_row_offsets[env];
    for (Offset row = first; row < first + batch.env_rows(env); ++row) {
      const Offset begin = batch.row_offsets[row], count = batch.row_offsets[row + 1] - begin;
      if (batch.column == nullptr
              ? count < dofs
              : !all_below(std::span(batch.column + begin, static_cast<std::size_t>(count)), static_cast<Index>(dofs)))
        refuse("row " + std::to_string(row - first) + " of J of " + where() +
               (batch.column == nullptr
                    ? " has " + std::to_string(count) + " entries, expected one per degree of freedom, "
                    : " has a column outside of its degrees of freedom, ") +
               std::to_string(dofs) + "; fix row_offsets or column");
    }
    const Offset cone = batch.env_cone_offsets[env], cones_end = cone + batch.env_cones(env);
    if (batch.cone_row_offsets[cone] != first && cones_end > cone)
      refuse("the first cone of " + where() + " does not begin at its first row; fix cone_row_offsets");
    if (batch.env_rows(env) != (cones_end > cone ? batch.cone_row_offsets[cones_end] - first : 0))
      refuse("the cones of " + where() + " do not tile its " + std::to_string(batch.env_rows(env)) +
             " rows; fix cone_row_offsets");
  }
}

template <class Real>
JacobianBatch<Real>::JacobianBatch(Law law, MassForm mass_form, Index mass_block)
    : law_(law), mass_form_(mass_form), mass_block_(mass_block) {
  if (mass_block < 0)
    refuse("mass_block = " + std::to_string(mass_block) + ", expected rows of a block, or 0 for one dense block");
}

template <class Real>
void JacobianBatch<Real>::add(const JacobianEnvironment<Real>& environment) {
  const std::size_t rows = check_shape(environment, mass_block_);
  const std::size_t dofs = environment.v_free.size();
  const bool sparse = !environment.row_offsets.empty();
  const bool grouped =
      std::any_of(environment.cones.begin(), environment.cones.end(), [](const auto& cone) { return cone.group >= 0; });
  if (grouped) arrays_.cone_group.resize(arrays_.cone_kind.size(), -1);
  for (const auto& cone : environment.cones) {
    arrays_.cone_kind.push_back(cone.kind);
    arrays_.cone_row_offsets.push_back(arrays_.cone_row_offsets.back() + cone.row_count);
    if (grouped || !arrays_.cone_group.empty()) arrays_.cone_group.push_back(cone.group);
  }
  if (sparse && !has_columns_) {
    // Rows so far are dense: their columns, which went without saying, are written down.
    for (std::size_t row = 0; row + 1 < arrays_.row_offsets.size(); ++row)
      for (Offset k = 0; k < arrays_.row_offsets[row + 1] - arrays_.row_offsets[row]; ++k)
        arrays_.column.push_back(static_cast<Index>(k));
    has_columns_ = true;
  }
  for (std::size_t row = 0; row < rows; ++row) {
    const auto count = sparse ? static_cast<Offset>(environment.row_offsets[row + 1] - environment.row_offsets[row])
                              : static_cast<Offset>(dofs);
    arrays_.row_offsets.push_back(arrays_.row_offsets.back() + count);
    for (Offset k = 0; has_columns_ && !sparse && k < count; ++k) arrays_.column.push_back(static_cast<Index>(k));
  }
  if (sparse) append(arrays_.column, environment.column);
  append(arrays_.J, environment.J);
  append(arrays_.M, environment.M);
  append(arrays_.v_free, environment.v_free);
  append_rows(arrays_.target, environment.target, rows);
  append_rows(arrays_.R, environment.R, rows);
  append_rows(arrays_.mu, environment.mu, rows);
  append_rows(arrays_.lo, environment.lo, rows);
  append_rows(arrays_.hi, environment.hi, rows);
  arrays_.env_row_offsets.push_back(static_cast<Offset>(arrays_.R.size()));
  arrays_.env_cone_offsets.push_back(static_cast<Offset>(arrays_.cone_kind.size()));
  arrays_.env_dof_offsets.push_back(static_cast<Offset>(arrays_.v_free.size()));
  arrays_.env_mass_offsets.push_back(static_cast<Offset>(arrays_.M.size()));
}

template <class Real>
JacobianBatchView<Real> JacobianBatch<Real>::view() const noexcept {
  JacobianBatchView<Real> view;
  view.env_count = env_count();
  view.cone_count = static_cast<Offset>(arrays_.cone_kind.size());
  view.row_count = row_count();
  view.dof_count = dof_count();
  view.entry_count = static_cast<Offset>(arrays_.J.size());
  view.mass_count = static_cast<Offset>(arrays_.M.size());
  for_each_held_array(view, PointAt{}, view, arrays_);
  // Rows without entries have columns too: null would mean that J is dense.
  static constexpr Index kNoColumn = 0;
  if (has_columns_ && arrays_.column.empty()) view.column = &kNoColumn;
  view.mass_form = mass_form_;
  view.mass_block = mass_block_;
  view.law = law_;
  return view;
}

template void check_structure(const JacobianBatchView<float>&);
template void check_structure(const JacobianBatchView<double>&);
template class JacobianBatch<float>;
template class JacobianBatch<double>;

}  // namespace stiction
