#pragma once

#include "core/algorithm/pack/pack_workspace.hpp"
#include "core/algorithm/residual/final_residual.hpp"

/// Weights of errors in the cones of a pack's environments.
namespace stiction::inline STICTION_ISA {

/// Writes the metric of each cone, from the diagonal in double, in the lanes being loaded. The final residual needs it,
/// and no iteration changes it.
template <class Real, int W>
void weigh_cones(const ConeCounts& slots, const PackWorkspace<Real, W>& workspace, const Pack<Real, W>& loading_mark) {
  using Wide = Pack<double, kWideLanes<Real, W>>;
  for (int first = 0; first < W; first += kWideLanes<Real, W>) {
    const auto loading = widened(loading_mark, first) > Wide(0.0);
    const auto put = [&](double* numbers, Index i, const Wide& value) {
      double* const to = numbers + Offset{i} * W + first;
      Wide old;
      load_lanes(to, old);
      store_lanes(to, select(loading, value, old));
    };
    for_each_segment(slots, [&](auto shape, Index count, Index first_cone, Index first_row) {
      constexpr int kRows = decltype(shape)::kRows;
      for (Index c = 0; c < count; ++c) {
        Wide a(0.0);
        for (int k = 0; k < kRows; ++k) {
          const Index row = first_row + c * kRows + k;
          const Wide d = widened(workspace.compliance[row], first) + widened(workspace.entry[row], first);
          if (k == 0) {
            a = max_(d, Wide(0.0));
            continue;
          }
          const auto weights = axis_weights(a, d, widened(workspace.scale[row], first));
          put(workspace.axis_press, row, weights.press);
          put(workspace.axis_slip, row, weights.slip);
        }
        put(workspace.press, first_cone + c, a);
      }
    });
  }
}

/// Metrics of the cones in one lane, whose rows may have more than one entry on the diagonal, or none.
template <class Real, int W>
void weigh_cones_of(const EnvView<Real>& env, const ConeCounts& slots, const PackWorkspace<Real, W>& workspace,
                    int lane) {
  const Index* const batch_row = workspace.rows_of(lane);
  for_each_segment(slots, [&](auto shape, Index count, Index first_cone, Index first_row) {
    constexpr int kRows = decltype(shape)::kRows;
    for (Index c = 0; c < count; ++c) {
      double a = 0.0;
      for (int k = 0; k < kRows; ++k) {
        const Index row = first_row + c * kRows + k, i = batch_row[row];
        if (i < 0) continue;
        const double d = row_diagonal(env, i, static_cast<double>(env.R[i]));
        if (k == 0) {
          a = max_(d, 0.0);
          continue;
        }
        const auto weights = axis_weights(a, d, static_cast<double>(workspace.scale[row].v[lane]));
        workspace.axis_press[Offset{row} * W + lane] = weights.press;
        workspace.axis_slip[Offset{row} * W + lane] = weights.slip;
      }
      workspace.press[Offset{first_cone + c} * W + lane] = a;
    }
  });
}

/// Free rows without a positive diagonal weigh as cone_answer() has it. Their cones come first, of one row each.
template <class Real, int W>
void weigh_bare_rows(const EnvView<Real>& env, const ConeCounts& slots, const PackWorkspace<Real, W>& workspace,
                     int lane) {
  const Index* const batch_row = workspace.rows_of(lane);
  for (Index row = 0; row < slots.free; ++row) {
    double& a = workspace.press[Offset{row} * W + lane];
    if (batch_row[row] >= 0 && !(a > 0.0)) a = row_largest(env, batch_row[row]);
  }
}

}  // namespace stiction::inline STICTION_ISA
