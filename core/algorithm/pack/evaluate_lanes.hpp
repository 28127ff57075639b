#pragma once

#include "core/algorithm/driver/check_convergence.hpp"
#include "core/algorithm/pack/pack_workspace.hpp"
#include "core/base/four_rows.hpp"

/// Candidates in the lanes of a pack: written and evaluated together, with the operations that
/// write_solution() and final_residual() have for one.
namespace stiction::inline STICTION_ISA {

/// The motion of an environment's reactions, of which `wide` are doubles and then four zeros, to the batch and to
/// `motion`.
template <class Real>
void write_motion(const EnvView<Real>& env, const double* wide, double* motion) {
  using Four = Pack<double, 4>;
  constexpr Index kFour = 4;
  const bool is_by_four = env.is_full && env.n >= kFour;
  for (Index next = 0; is_by_four && next < env.n; next += kFour) {
    const Index first = next + kFour <= env.n ? next : env.n - kFour;  // the last four begin among those before
    Four b, R, lambda;
    widen_lanes(env.b + first, b);
    widen_lanes(env.R + first, R);
    load_lanes(wide + first, lambda);
    const Real* const A = env.A + env.row_offsets[0] + Offset{env.n} * first;
    const Four sum = four_sums_of_four_rows(fma_(R, lambda, b), A, wide, env.n);
    store_lanes(motion + first, sum);
    if (env.w != nullptr) store_lanes(env.w + first, canonical_zero(saturated<Pack<Real, 4>>(sum)));
  }
  for (Index i = 0; !is_by_four && i < env.n; ++i) {
    motion[i] = row_motion(env, i, row_start(env, i));
    if (env.w != nullptr) env.w[i] = canonical_zero(saturated<Real>(motion[i]));
  }
}

/// The reactions of one lane to where the batch has them, and their motion, to the batch and into the lane.
template <class Real, int W>
void write_lane(const EnvView<Real>& env, const PackWorkspace<Real, W>& workspace, int lane) {
  const Index* const batch_row = workspace.rows_of(lane);
  const auto lambda = PackWorkspace<Real, W>::lane_of(workspace.lambda, lane);
  for (Index r = 0; r < workspace.n; ++r)
    if (batch_row[r] >= 0) env.lambda[batch_row[r]] = lambda[r];
  for (Index i = 0; i < env.n; ++i) workspace.wide[i] = static_cast<double>(env.lambda[i]);
  for (Index i = env.n; i < env.n + PackWorkspace<Real, W>::kFour; ++i) workspace.wide[i] = 0.0;
  write_motion(env, workspace.wide, workspace.moved);
  for (Index r = 0; r < workspace.n; ++r)
    workspace.motion[Offset{r} * W + lane] = batch_row[r] < 0 ? 0.0 : workspace.moved[batch_row[r]];
}

/// Natural maps and what roundings hide of them in some lanes, from `first` on.
template <Law kLaw, class Real, int W>
void evaluate_lanes_from(int first, const ConeCounts& slots, const PackWorkspace<Real, W>& workspace,
                         FinalResidual* evaluated) {
  using Wide = Pack<double, kWideLanes<Real, W>>;
  const auto wide = [first](const Pack<Real, W>& lanes) { return widened(lanes, first); };
  LargestResidual<Wide> largest;
  for_each_segment(slots, [&](auto shape, Index count, Index first_cone, Index first_row) {
    constexpr int kRows = decltype(shape)::kRows;
    for (Index c = 0; c < count; ++c) {
      const Index cone = first_cone + c;
      Wide x[kRows];
      Wide y[kRows];
      for (int k = 0; k < kRows; ++k) {
        const Index row = first_row + c * kRows + k;
        x[k] = wide(workspace.lambda[row]);
        load_lanes(workspace.motion + Offset{row} * W + first, y[k]);
        if (k == 0) continue;  // mu is 1, or the slot empty and both are 0
        const Wide mu = wide(workspace.scale[row]);
        x[k] = unit_reaction(x[k], mu);
        y[k] = mu * y[k];
      }
      Wide a;
      load_lanes(workspace.weight + Offset{cone} * W + first, a);
      largest.template add<kLaw>(shape, x, y, a, wide(workspace.lo[cone]), wide(workspace.hi[cone]));
    }
  });
  const Wide residual = sqrt_(largest.square);
  for (int l = 0; l < kWideLanes<Real, W>; ++l) evaluated[first + l] = {residual.v[l], largest.rounding_floor.v[l]};
}

/// Writes the best iterates of the `count` lanes in `asked`, whose environments are envs[lane], and evaluates them.
template <Law kLaw, class Real, int W>
STICTION_HD_SHARED void evaluate_lanes(const DenseSystem<Pack<Real, W>>& pack, const PackWorkspace<Real, W>& workspace,
                                       const EnvView<Real>* const* envs, const int* asked, int count,
                                       FinalResidual* evaluated) {
  using Lanes = Pack<Real, W>;
  constexpr int kWide = kWideLanes<Real, W>;
  const Lanes unscale = div_(pack.scalar[kScaleA], pack.scalar[kScaleB]);
  for (Index r = 0; r < pack.n; ++r)
    workspace.lambda[r] = canonical_zero((pack.best[r] * workspace.scale[r]) * unscale);
  bool is_asked[W] = {};
  for (int k = 0; k < count; ++k) {
    write_lane(*envs[asked[k]], workspace, asked[k]);
    is_asked[asked[k]] = true;
  }
  for (int first = 0; first < W; first += kWide) {
    bool any_here = false;
    for (int l = first; l < first + kWide; ++l) any_here = any_here || is_asked[l];
    if (any_here) evaluate_lanes_from<kLaw>(first, pack.counts, workspace, evaluated);
  }
}

/// check_convergence() of one lane of `asked`, with what evaluate_lanes() has found. `scale`: residual_scale(). An
/// answer worth less than none goes the way of a single environment.
template <class Method, Team TeamT, class Real, class System>
bool check_evaluated(TeamT& team, const EnvView<Real>& env, const System& s, const StopRule& rule, const EnvPoll& poll,
                     const FinalResidual& evaluated, double scale, EnvProgress<Real>& progress) {
  const double absolute = reported_residual(evaluated, rule.tolerance * scale);
  if (poll.ended && is_collapsed(div_(absolute, scale)))
    return evaluate_candidate<Method>(team, env, s, rule, poll, progress);
  return finalize<Method>(team, env, rule, poll, s.scalar[kBestResidual], absolute, scale, progress);
}

}  // namespace stiction::inline STICTION_ISA
