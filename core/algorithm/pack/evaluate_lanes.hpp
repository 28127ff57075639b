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
  const bool is_by_four = env.is_full && env.n >= kFourRows;
  for (Index next = 0; is_by_four && next < env.n; next += kFourRows) {
    const Index first = next + kFourRows <= env.n ? next : env.n - kFourRows;  // the last four begin among those before
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
  for (Index i = env.n; i < env.n + kFourRows; ++i) workspace.wide[i] = 0.0;
  write_motion(env, workspace.wide, workspace.moved);
  for (Index r = 0; r < workspace.n; ++r)
    workspace.motion[Offset{r} * W + lane] = batch_row[r] < 0 ? 0.0 : workspace.moved[batch_row[r]];
}

/// Errors in some lanes, from `first` on. `units`: ErrorScale's of every lane.
template <Law kLaw, class Real, int W>
void evaluate_lanes_from(int first, const DenseSystem<Pack<Real, W>>& pack, const PackWorkspace<Real, W>& workspace,
                         const double (&units)[W], FinalResidual* evaluated) {
  using Wide = Pack<double, kWideLanes<Real, W>>;
  const auto wide = [first](const Pack<Real, W>& lanes) { return widened(lanes, first); };
  const auto number = [first](const double* numbers, Index i) {
    Wide value;
    load_lanes(numbers + Offset{i} * W + first, value);
    return value;
  };
  Wide unit;
  load_lanes(units + first, unit);
  LargestResidual<Wide> largest;
  for_each_segment(pack.counts, [&](auto shape, Index count, Index first_cone, Index first_row) {
    constexpr int kRows = decltype(shape)::kRows;
    for (Index c = 0; c < count; ++c) {
      const Index cone = first_cone + c;
      Wide x[kRows];
      Wide y[kRows];
      ConeMetric<Wide, kRows> metric;
      metric.a = number(workspace.press, cone);
      for (int k = 0; k < kRows; ++k) {
        const Index row = first_row + c * kRows + k;
        x[k] = wide(workspace.lambda[row]);
        y[k] = number(workspace.motion, row);
        metric.press[k] = metric.slip[k] = Wide(1.0);
        if (k == 0) continue;  // mu is 1, or the slot empty and both are 0
        metric.press[k] = number(workspace.axis_press, row);
        metric.slip[k] = number(workspace.axis_slip, row);
        const Wide mu = wide(workspace.scale[row]);
        x[k] = unit_reaction(x[k], mu);
        y[k] = mu * y[k];
      }
      largest.template add<kLaw>(shape, x, y, metric, wide(workspace.lo[cone]), wide(workspace.hi[cone]),
                                 wide(workspace.share[cone]), unit);
    }
  });
  const auto rooted = [unit](const Wide& square) { return div_(sqrt_(square), unit); };
  const Wide residual = rooted(largest.square), stuck = rooted(largest.stuck), absolute = rooted(largest.plain);
  const Wide floor = div_(Wide(0x1p-53) * sqrt_(largest.size), unit), reaction = rooted(largest.reaction);
  for (int l = 0; l < kWideLanes<Real, W>; ++l)
    evaluated[first + l] = {residual.v[l], stuck.v[l], absolute.v[l], floor.v[l], reaction.v[l]};
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
  for_each_segment(pack.counts, [&](auto shape, Index slots, Index first_cone, Index first_row) {
    constexpr int kRows = decltype(shape)::kRows;
    for (Index c = 0; c < slots; ++c) {
      const auto needs_nothing = pack.island[first_cone + c] == Lanes(static_cast<Real>(kIdleIsland<Real>));
      if (!any(needs_nothing)) continue;
      for (int k = 0; k < kRows; ++k) {
        Lanes& lambda = workspace.lambda[first_row + c * kRows + k];
        lambda = select(needs_nothing, Lanes(0), lambda);
      }
    }
  });
  double units[W];
  for (int l = 0; l < W; ++l) units[l] = 1.0;
  for (int k = 0; k < count; ++k) {
    const int l = asked[k];
    units[l] = error_scale(div_(static_cast<double>(pack.scalar[kErrorScale].v[l]),
                                static_cast<double>(pack.scalar[kScaleB].v[l])))
                   .unit;
  }
  bool is_asked[W] = {};
  for (int k = 0; k < count; ++k) {
    write_lane(*envs[asked[k]], workspace, asked[k]);
    is_asked[asked[k]] = true;
  }
  for (int first = 0; first < W; first += kWide) {
    bool any_here = false;
    for (int l = first; l < first + kWide; ++l) any_here = any_here || is_asked[l];
    if (any_here) evaluate_lanes_from<kLaw>(first, pack, workspace, units, evaluated);
  }
}

/// check_convergence() of one lane of `asked`, with the results of evaluate_lanes(). A final iterate that is worse
/// than lambda = 0 is finished by the single-environment path.
template <class Method, Team TeamT, class Real, class System>
bool check_evaluated(TeamT& team, const EnvView<Real>& env, const System& s, const StopRule& rule, const EnvPoll& poll,
                     const FinalResidual& evaluated, EnvProgress<Real>& progress) {
  const Verdict verdict = judge<Real>(evaluated, error_scale_of(s).largest, allowance(rule));
  if (poll.ended && is_collapsed(verdict.relative))
    return evaluate_candidate<Method>(team, env, s, rule, poll, progress);
  return finalize<Method>(team, env, poll, s.scalar[kBestResidual], verdict, progress);
}

}  // namespace stiction::inline STICTION_ISA
