#pragma once

#include "core/algorithm/load/inspect.hpp"
#include "core/algorithm/pack/pack_workspace.hpp"
#include "core/algorithm/system/cone_slots.hpp"

/// The numbers of environments into the lanes that they enter, as the batch has them.
namespace stiction::inline STICTION_ISA {

/// An environment on its way into a lane.
template <class Real>
struct PendingLoad {
  const EnvView<Real>* env;
  int lane;
  std::uint32_t flags;      ///< as load_system() returns them
  const Real* matrix;       ///< its rows one after another
  bool is_written = false;  ///< its rows are written out in the order of the lane, else they are the batch's own
  bool is_scaled = false;   ///< and in the solver's coordinates
};

/// Returns true if the canonical order of an environment's rows is that of the batch.
template <class Real>
bool is_canonical(const EnvView<Real>& env) {
  Index apart = 0;
  for (Index position = 0; position < env.cone_count; ++position) apart |= env.cone_order[position] - position;
  return apart == 0 && !env.normal_last;
}

/// Finds the row of the batch for each of a lane's rows. Returns whether, kind after kind, neighbours in the lane are
/// neighbours in the batch.
template <class Real, int W>
bool list_rows(const EnvView<Real>& env, const DenseSystem<Real, W>& s, Index* batch_row) {
  if (is_canonical(env)) {
    Index next = 0;
    Index first = 0;
    for (int shape = 0; shape < kConeShapes; ++shape) {
      const Index own = shape_count(env.counts, shape) * shape_rows(shape);
      const Index slots = shape_count(s.counts, shape) * shape_rows(shape);
      for (Index r = 0; r < slots; ++r) batch_row[first + r] = r < own ? next + r : -1;
      next += own;
      first += slots;
    }
    return true;
  }
  SerialTeam team;
  for (Index r = 0; r < s.n; ++r) batch_row[r] = -1;
  for_each_slot(team, env, s, [&](Index cone, ConeSlot slot) {
    const Index first = env.cone_row(cone);
    const Index size = env.cone_size(cone);
    for (Index k = 0; k < size; ++k) batch_row[slot.row + k] = env.row_of(first, size, k);
  });
  Index apart = 0;
  Index first = 0;
  for (int shape = 0; shape < kConeShapes; ++shape) {
    const Index own = shape_count(env.counts, shape) * shape_rows(shape);
    for (Index r = first; r < first + own; ++r) apart |= batch_row[r] - batch_row[first] - (r - first);
    first += shape_count(s.counts, shape) * shape_rows(shape);
  }
  return apart == 0;
}

/// Returns true if columns ascend in every row, so that no row has one twice. False means nothing.
template <class Real>
bool columns_ascend(const EnvView<Real>& env) {
  unsigned off = 0;
  for (Index i = 0; i < env.n; ++i) {
    const Index* const column = env.columns(i);
    const Index count = env.entries(i);
    for (Index k = 1; k < count; ++k) off |= static_cast<unsigned>(column[k] <= column[k - 1]);
  }
  return off == 0;
}

/// A of one environment by rows of the lane. `scale` null: as the batch has it, none of whose rows has a column twice.
/// With a scale: in the solver's coordinates, by the same operations as assemble(). `slot`: room for a number of each
/// of the environment's rows.
template <class Real, int W>
void write_rows(const EnvView<Real>& env, Index n, const Index* batch_row, const Strided<Real, W>* scale, Real scale_a,
                Index* slot, Real* A) {
  for (Index r = 0; r < n; ++r)
    if (batch_row[r] >= 0) slot[batch_row[r]] = r;
  for (Index k = 0; k < n * n; ++k) A[k] = 0;
  for (Index r = 0; r < n; ++r) {
    const Index i = batch_row[r];
    if (i < 0) continue;
    const Real* const a = env.A + env.row_offsets[i];
    const Index* const column = env.columns(i);
    const Index count = env.entries(i);
    Real* const to = A + Offset{n} * r;
    for (Index t = 0; scale == nullptr && t < count; ++t) to[slot[column[t]]] = a[t];
    for (Index t = 0; scale != nullptr && t < count; ++t) {
      Real& entry = to[slot[column[t]]];
      entry = entry + (a[t] * scale_a) * ((*scale)[r] * (*scale)[slot[column[t]]]);
    }
  }
}

/// An environment's rows into its lane, in the batch's units: b and guess into the system, all else into the workspace.
/// Finds its matrix, but where rows have columns twice, which take part in sums once they are scaled.
template <class Real, int W>
void gather_rows(PendingLoad<Real>& load, const DenseSystem<Real, W>& s, const PackWorkspace<Real, W>& workspace) {
  const EnvView<Real>& env = *load.env;
  const int lane = load.lane;
  const auto of = [lane](auto* lanes) { return PackWorkspace<Real, W>::lane_of(lanes, lane); };
  Index* const batch_row = workspace.rows_of(lane);
  const bool is_in_order = list_rows(env, s, batch_row);
  load.is_written = !is_in_order || !env.is_full;
  load.is_scaled = !env.is_full && !columns_ascend(env);
  load.matrix = env.A + env.row_offsets[0];
  if (load.is_written) {
    Real* const own = workspace.written + Offset{s.n} * s.n * lane;
    if (!load.is_scaled) write_rows<Real, W>(env, s.n, batch_row, nullptr, Real(1), workspace.column, own);
    load.matrix = own;
  }
  // One array after the other: of all at once not even the addresses fit into registers.
  const auto put = [&](Strided<Real, W> to, auto&& value) {
    for (Index r = 0; r < s.n; ++r) to[r] = batch_row[r] < 0 ? Real(0) : value(r, batch_row[r]);
  };
  const auto put_zeros = [&](Strided<Real, W> to) {
    for (Index r = 0; r < s.n; ++r) to[r] = 0;
  };
  put(s.b, [b = env.b](Index, Index i) { return b[i]; });
  if (env.warm_start != nullptr) {
    put(s.x, [guess = env.warm_start](Index, Index i) { return guess[i]; });
  } else {
    put_zeros(s.x);
  }
  put(of(workspace.compliance), [R = env.R](Index, Index i) { return R[i]; });
  put(of(workspace.present), [](Index, Index) { return Real(1); });
  put(of(workspace.scale), [](Index, Index) { return Real(1); });
  const auto put_diagonal = [&, A = load.matrix](Index stride, bool is_by_lane) {
    put(of(workspace.entry), [=](Index r, Index i) { return A[Offset{stride} * (is_by_lane ? r : i)]; });
  };
  if (load.is_scaled) {
    put_zeros(of(workspace.entry));
  } else if (load.is_written) {
    put_diagonal(s.n + 1, true);
  } else {
    put_diagonal(env.n + 1, false);
  }
  const auto scale = of(workspace.scale), lo = of(workspace.lo), hi = of(workspace.hi);
  for_each_segment(s.counts, [&](auto shape, Index count, Index first_cone, Index first_row) {
    constexpr ConeKind kKind = decltype(shape)::kKind;
    constexpr Index kRows = decltype(shape)::kRows;
    for (Index c = 0; c < count; ++c) {
      const Index row = first_row + c * kRows;
      const Index i = batch_row[row];
      const bool is_bounded = kKind == ConeKind::box && i >= 0;
      // Crossed bounds stay crossed, of which one that counts as infinite could hide it.
      const bool is_crossed = is_bounded && env.lo[i] > env.hi[i];
      lo[first_cone + c] = is_crossed ? Real(1) : is_bounded ? lower_bound(env, i) : Real(0);
      hi[first_cone + c] = is_crossed ? Real(-1) : is_bounded ? upper_bound(env, i) : Real(0);
      for (Index k = 1; k < kRows && i >= 0; ++k) scale[row + k] = env.friction(batch_row[row + k]);
    }
  });
  if (env.counts.box_friction > 0) {
    SerialTeam team;
    for_each_slot(team, env, s, [&](Index cone, ConeSlot slot) {
      if (env.kind[cone] != ConeKind::box_friction) return;
      lo[slot.cone] = Real(-1);
      hi[slot.cone] = Real(1);
    });
  }
}

/// The diagonal of A + diag R in the batch's units, once those of A and of R are there.
template <class Real, int W>
void sum_diagonals(const DenseSystem<Real, W>* lanes, const PackWorkspace<Real, W>& workspace,
                   const PendingLoad<Real>* loads, int count) {
  for (Index r = 0; r < workspace.n; ++r) workspace.diagonal[r] = workspace.compliance[r] + workspace.entry[r];
  for (int e = 0; e < count; ++e) {
    const PendingLoad<Real>& load = loads[e];
    if (!load.is_scaled) continue;
    const auto diagonal = PackWorkspace<Real, W>::lane_of(workspace.diagonal, load.lane);
    const Index* const batch_row = workspace.rows_of(load.lane);
    for (Index r = 0; r < workspace.n; ++r)
      if (batch_row[r] >= 0) diagonal[r] = scan_row(*load.env, lanes[load.lane], batch_row[r], true).diagonal;
  }
}

}  // namespace stiction::inline STICTION_ISA
