#pragma once

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <vector>

#include "stiction/batch_arrays.hpp"

namespace stiction::test {

/// The environment in another precision.
template <class Real, class From>
JacobianEnvironment<Real> cast(const JacobianEnvironment<From>& from) {
  JacobianEnvironment<Real> to;
  for (const auto& cone : from.cones) to.cones.push_back({cone.kind, cone.row_count, cone.group});
  to.row_offsets = from.row_offsets;
  to.column = from.column;
  const auto copy = [](std::vector<Real>& target, const std::vector<From>& source) {
    for (const From value : source) target.push_back(static_cast<Real>(value));
  };
  copy(to.J, from.J);
  copy(to.M, from.M);
  copy(to.v_free, from.v_free);
  copy(to.target, from.target);
  copy(to.R, from.R);
  copy(to.mu, from.mu);
  copy(to.lo, from.lo);
  copy(to.hi, from.hi);
  return to;
}

/// Leaves every third entry of a dense J out.
inline void thin_out(JacobianEnvironment<double>& env) {
  const std::size_t dofs = env.v_free.size(), n = env.mu.size();
  std::vector<double> values;
  env.row_offsets = {0};
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < dofs; ++k) {
      if ((i + k) % 3 == 2) continue;
      env.column.push_back(static_cast<Index>(k));
      values.push_back(env.J[i * dofs + k]);
    }
    env.row_offsets.push_back(static_cast<Index>(values.size()));
  }
  env.J = values;
}

/// A Jacobian batch in arrays that may have room. There are `room` rows and as many cones for each environment, with
/// counts (0: as many as there are, without). At the end of every array are `behind` entries. Numbers that are not in
/// use are NaN.
template <class Real>
struct RoomyJacobians {
  std::vector<Offset> env_row_offsets, env_cone_offsets, env_dof_offsets, env_mass_offsets, cone_row_offsets,
      row_offsets;
  std::vector<Index> env_row_counts, env_cone_counts, cone_group, column;
  std::vector<ConeKind> cone_kind;
  std::vector<Real> J, M, v_free, target, R, mu, lo, hi;
  bool padded, sparse;
  MassForm mass_form;
  Index mass_block;
  Law law;

  RoomyJacobians(const JacobianBatchView<Real>& batch, Index room, std::size_t behind)
      : padded(room > 0),
        sparse(batch.column != nullptr),
        mass_form(batch.mass_form),
        mass_block(batch.mass_block),
        law(batch.law) {
    fill(batch, room);
    for (auto* array : {&J, &M, &v_free, &target, &R, &mu, &lo, &hi}) {
      const bool by_rows = array != &J && array != &M && array != &v_free;
      if (!padded || !by_rows) array->resize(array->size() + behind, nan());
    }
    column.resize(J.size(), -5);
    if (padded) return;
    cone_kind.resize(cone_kind.size() + behind, static_cast<ConeKind>(9));
    cone_row_offsets.resize(cone_row_offsets.size() + behind, -3);
    row_offsets.resize(row_offsets.size() + behind, -4);
  }

  /// Another batch in the same arrays, which do not move.
  void refill(const JacobianBatchView<Real>& batch, Index room) {
    const RoomyJacobians other(batch, room, 0);
    const auto put = [](auto& own, const auto& source) {
      if (source.size() > own.size()) throw std::length_error("the test's arrays have no room for this batch");
      std::copy(source.begin(), source.end(), own.begin());
    };
    const auto put_listed = [&put](const BatchArray&, auto& own, const auto& source) { put(own, source); };
    for_each_held_array(batch, put_listed, *this, other);
    for_each_count_array(batch, put_listed, *this, other);
  }

  /// The totals are the room of the arrays.
  [[nodiscard]] JacobianBatchView<Real> view(MemorySpace space) const {
    JacobianBatchView<Real> view;
    view.env_count = static_cast<Offset>(env_row_offsets.size()) - 1;
    view.cone_count = static_cast<Offset>(cone_kind.size());
    view.row_count = static_cast<Offset>(R.size());
    view.dof_count = static_cast<Offset>(v_free.size());
    view.entry_count = static_cast<Offset>(J.size());
    view.mass_count = static_cast<Offset>(M.size());
    for_each_held_array(view, PointAt{}, view, *this);
    if (padded) for_each_count_array(view, PointAt{}, view, *this);
    if (!sparse) view.column = nullptr;
    view.mass_form = mass_form;
    view.mass_block = mass_block;
    view.law = law;
    view.space = space;
    return view;
  }

 private:
  static Real nan() { return std::numeric_limits<Real>::quiet_NaN(); }

  void fill(const JacobianBatchView<Real>& batch, Index room) {
    env_row_offsets = env_cone_offsets = {0};
    row_offsets = {0};
    env_dof_offsets.assign(batch.env_dof_offsets, batch.env_dof_offsets + batch.env_count + 1);
    env_mass_offsets.assign(batch.env_mass_offsets, batch.env_mass_offsets + batch.env_count + 1);
    M.assign(batch.M, batch.M + batch.mass_count);
    v_free.assign(batch.v_free, batch.v_free + batch.dof_count);
    for (Offset env = 0; env < batch.env_count; ++env) {
      const Index n = batch.env_rows(env), cones = batch.env_cones(env);
      const Offset first = env_row_offsets.back(), row = batch.env_row_offsets[env];
      const Offset cone = batch.env_cone_offsets[env];
      env_row_counts.push_back(n);
      env_cone_counts.push_back(cones);
      env_row_offsets.push_back(first + (room > 0 ? room : n));
      env_cone_offsets.push_back(env_cone_offsets.back() + (room > 0 ? room : cones));
      for (Index c = 0; c < (room > 0 ? room : cones); ++c) {
        cone_kind.push_back(c < cones ? batch.cone_kind[cone + c] : static_cast<ConeKind>(9));
        cone_row_offsets.push_back(first + (c < cones ? batch.cone_row_offsets[cone + c] - row : n));
      }
      for (Index i = 0; i < (room > 0 ? room : n); ++i) {
        const bool used = i < n;
        for (Offset k = batch.row_offsets[used ? row + i : 0]; used && k < batch.row_offsets[row + i + 1]; ++k) {
          J.push_back(batch.J[k]);
          column.push_back(batch.column != nullptr ? batch.column[k] : 0);
        }
        row_offsets.push_back(static_cast<Offset>(J.size()));
        target.push_back(used ? batch.target[row + i] : nan());
        R.push_back(used ? batch.R[row + i] : nan());
        mu.push_back(used ? batch.mu[row + i] : nan());
        lo.push_back(used ? batch.lo[row + i] : nan());
        hi.push_back(used ? batch.hi[row + i] : nan());
      }
    }
    cone_row_offsets.push_back(env_row_offsets.back());
  }
};

}  // namespace stiction::test
