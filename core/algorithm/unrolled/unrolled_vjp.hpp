#pragma once

#include "core/algorithm/unrolled/sweep_tape.hpp"

/// Sweeps in reverse: cotangents of their results pulled back to the batch and to where they began
/// (docs/math/derivative.md, (28) to (31)).
namespace stiction::inline STICTION_ISA {

/// Derivatives of one visit's step by its cone, by one lane. `x` holds the iterate after it, and then that before it.
template <Law kLaw, class Real, class Shape>
STICTION_HD void cone_vjp(Shape shape, const EnvView<Real>& env, double omega, const SweepTape& s, Index sweep,
                          Index cone, Index first) {
  constexpr int kRows = Shape::kRows;
  const double* const before = s.before + static_cast<Offset>(sweep) * s.n + first;
  const double* const motion = s.motion + static_cast<Offset>(sweep) * s.n + first;
  const auto lone = lone_cone(shape, env, s, cone, first, before);
  double y[kRows], bar[kRows];
  for (int r = 0; r < kRows; ++r) {
    y[r] = motion[r];
    bar[r] = s.x_bar[first + r];
    s.x[first + r] = before[r];
  }
  LoneConeBar<kRows> to;
  local_step_vjp<kLaw>(shape, lone, y, omega, bar, to);
  for (int r = 0; r < kRows; ++r) {
    s.x_bar[first + r] = to.x[r];
    s.by_motion[r] = to.y[r];
    s.b_bar[first + r] = s.b_bar[first + r] + to.y[r];
    for (int j = 0; j < kRows; ++j) {
      double& entry = s.entry(s.A_bar, first + r, first + j);
      entry = entry + to.B[r][j];
    }
  }
  double* const measured = s.measured + 4 * cone;
  measured[0] = measured[0] + to.inv_n;
  measured[1] = measured[1] + to.inv_t;
  measured[2] = measured[2] + to.damping;
  measured[3] = measured[3] + to.share;
  s.lo_bar[first] = s.lo_bar[first] + to.lo;
  s.hi_bar[first] = s.hi_bar[first] + to.hi;
}

/// One visit in reverse: its step, then its motion. A lane takes columns.
template <Law kLaw, Team TeamT, class Real>
STICTION_HD void visit_vjp(TeamT& team, const EnvView<Real>& env, double omega, const SweepTape& s, Index sweep,
                           Index cone) {
  const Index first = env.cone_row(cone), size = env.cone_size(cone);
  single(team, [&] {
    with_shape(env.kind[cone], size, [&](auto shape) { cone_vjp<kLaw>(shape, env, omega, s, sweep, cone, first); });
  });
  for (Index r = 0; r < size; ++r) {
    const double by_motion = s.by_motion[r];
    if (by_motion == 0.0) continue;
    for (Index j = team.rank(); j < s.n; j += team.size()) {
      s.entry(s.A_bar, first + r, j) = fma_(by_motion, s.x[j], s.entry(s.A_bar, first + r, j));
      s.x_bar[j] = fma_(s.entry(s.A, first + r, j), by_motion, s.x_bar[j]);
    }
  }
  team.sync();
}

/// Differentiates step lengths by A, and the guess's way into its cone, in reverse.
template <Team TeamT, class Real>
STICTION_HD_OUTLINE void start_vjp(TeamT& team, const EnvView<Real>& env, const SweepTape& s) {
  for_each_shape(team, env, [&](auto shape, Index cone, Index first) {
    constexpr int kRows = decltype(shape)::kRows;
    const auto lone = lone_cone(shape, env, s, cone, first, s.guess + first);
    const double* const measured = s.measured + 4 * cone;
    LoneConeBar<kRows> to;
    to.inv_n = measured[0];
    to.inv_t = measured[1];
    to.damping = measured[2];
    to.share = measured[3];
    measures_vjp(lone, to);
    for (int i = 0; i < kRows; ++i)
      for (int j = 0; j < kRows; ++j) {
        double& entry = s.entry(s.A_bar, first + i, first + j);
        entry = entry + to.B[i][j];
      }
    double z[kRows], bar[kRows], share = 0.0;
    for (int k = 0; k < kRows; ++k) {
      z[k] = s.guess[first + k];
      bar[k] = s.x_bar[first + k];
    }
    if constexpr (kRows > 1) {
      cone_projection_vjp<kRows>(z, 0.5, bar, share);
    } else if (shape.kKind == ConeKind::unilateral) {
      if (!(z[0] > 0.0)) bar[0] = 0.0;
    } else if (shape.kKind == ConeKind::box) {
      double& of_bound = z[0] < lone.lo[0] ? s.lo_bar[first] : s.hi_bar[first];
      if (z[0] < lone.lo[0] || z[0] > lone.hi[0]) {
        of_bound = of_bound + bar[0];
        bar[0] = 0.0;
      }
    }
    for (int k = 0; k < kRows; ++k) s.x_bar[first + k] = bar[k];
  });
}

/// Derivative of the loss by the returned reactions, through w as well, to `seed`.
template <Team TeamT, class Real>
STICTION_HD void seed_sweeps(TeamT& team, const EnvView<Real>& env, const UnrolledJob<Real>& job, const SweepTape& s,
                             Offset set) {
  const Offset rows = set * job.batch.row_count + env.first_row;
  for_each(team, s.n, [&](Index i) { s.seed[i] = given(job.cotangents.lambda, rows + i); });
  for (Index i = 0; i < s.n && job.cotangents.w != nullptr; ++i) {
    const double w_bar = given(job.cotangents.w, rows + i);
    single(team, [&] { s.seed[i] = fma_(static_cast<double>(env.R[i]), w_bar, s.seed[i]); });
    for_each_of_row(team, env, i, [&](Index j, double value) { s.seed[j] = fma_(value, w_bar, s.seed[j]); });
  }
}

/// All of the sweeps up to `chosen` in reverse, of one set of cotangents. True if everything is finite, on every lane.
template <Law kLaw, Team TeamT, class Real>
STICTION_HD_OUTLINE bool sweeps_vjp(TeamT& team, const EnvView<Real>& env, const UnrolledJob<Real>& job,
                                    const SweepTape& s, Index chosen, Offset set) {
  seed_sweeps(team, env, job, s, set);
  for_each(team, s.n * s.n, [&](Index k) { s.A_bar[k] = 0.0; });
  for_each(team, 4 * env.cone_count, [&](Index k) { s.measured[k] = 0.0; });
  for_each(team, s.n, [&](Index p) {
    s.b_bar[p] = s.lo_bar[p] = s.hi_bar[p] = 0.0;
    s.x[p] = s.best[p];
    s.x_bar[p] = s.scale[p] * s.seed[s.row[p]];
  });
  for (Index sweep = chosen; sweep-- > 0;)
    for (Index p = env.cone_count; p-- > 0;)
      visit_vjp<kLaw>(team, env, job.sweeps.omega, s, sweep, env.factor == nullptr ? env.cone_order[p] : p);
  start_vjp(team, env, s);
  std::uint32_t broken = 0;
  for_each(team, s.n, [&](Index p) {
    if (!finite_(s.x_bar[p]) || !finite_(s.b_bar[p])) broken = 1;
  });
  for_each(team, s.n * s.n, [&](Index k) {
    if (!finite_(s.A_bar[k])) broken = 1;
  });
  return team.combine(broken) == 0;
}

/// Derivative of the loss by the friction of position p: through S in A, in b, in lambda = S x and in the guess.
STICTION_HD double by_scale(const SweepTape& s, Index p) {
  const double scale = s.scale[p];
  if (!(scale > 0.0)) return 0.0;
  double sum = 0.0;
  for (Index q = 0; q < s.n; ++q) {
    sum = fma_(s.entry(s.A_bar, p, q), s.entry(s.A, p, q), sum);
    sum = fma_(s.entry(s.A_bar, q, p), s.entry(s.A, q, p), sum);
  }
  sum = fma_(s.b_bar[p], s.b[p], sum);
  sum = fma_(0.0 - s.x_bar[p], s.guess[p], sum);
  return fma_(s.best[p], s.seed[s.row[p]], div_(sum, scale));
}

/// Cotangents of one set in the batch's numbers; zeros where `refused`, and then no scratch is read.
template <Team TeamT, class Real>
STICTION_HD_OUTLINE void write_unrolled(TeamT& team, const EnvView<Real>& env, const UnrolledJob<Real>& job,
                                        const SweepTape& s, Offset set, bool refused) {
  const BatchCotangentView<Real>& to = job.gradients;
  const Offset rows = set * job.batch.row_count + env.first_row;
  const auto reaction = [&](Index i) { return s.scale[s.position[i]] * s.best[s.position[i]]; };
  const auto by_entry = [&](Index i, Index j) {
    const Index p = s.position[i], q = s.position[j];
    const double swept = s.scale[p] * s.scale[q] * s.entry(s.A_bar, p, q);
    return fma_(given(job.cotangents.w, rows + i), reaction(j), swept);
  };
  for_each(team, env.cone_count, [&](Index cone) {
    const Index first = env.cone_row(cone), size = env.cone_size(cone);
    for (Index k = 0; k < size; ++k) {
      const Index i = env.row_of(first, size, k), p = first + k;
      const bool has_friction = !refused && env.kind[cone] == ConeKind::friction && k > 0;
      const bool is_box = !refused && env.kind[cone] == ConeKind::box;
      put(to.b, rows + i, refused ? 0.0 : fma_(s.scale[p], s.b_bar[p], given(job.cotangents.w, rows + i)));
      put(to.R, rows + i, refused ? 0.0 : by_entry(i, i));
      put(to.mu, rows + i, has_friction ? by_scale(s, p) : 0.0);
      put(to.lo, rows + i, is_box ? s.lo_bar[p] : 0.0);
      put(to.hi, rows + i, is_box ? s.hi_bar[p] : 0.0);
      put(job.sweeps.by_warm_start, rows + i, refused ? 0.0 : unit_reaction(s.x_bar[p], s.scale[p]));
      if (set == 0) put(job.sweeps.lambda, env.first_row + i, refused ? 0.0 : reaction(i));
    }
  });
  for_each(team, to.A != nullptr && env.factor == nullptr ? env.n : 0, [&](Index i) {
    for (Index k = 0; k < env.entries(i); ++k)
      put(to.A, set * job.batch.nonzero_count + env.row_offsets[i] + k, refused ? 0.0 : by_entry(i, env.columns(i)[k]));
  });
  if (to.factor == nullptr || env.factor == nullptr) return;
  Real* const factor = to.factor + set * job.batch.factor_count + (env.factor - job.batch.factor);
  for_each(team, env.n, [&](Index i) {
    for (Index k = 0; k < env.dofs; ++k) {
      double sum = 0.0;
      for (Index j = 0; j < env.n && !refused; ++j)
        sum = fma_(by_entry(i, j) + by_entry(j, i),
                   static_cast<double>(env.factor[static_cast<Offset>(j) * env.dofs + k]), sum);
      put(factor, static_cast<Offset>(i) * env.dofs + k, sum);
    }
  });
}

/// Pulls all sets of cotangents of one environment back through its sweeps and writes its record. `order` is that of
/// its cones in a sweep.
template <Team TeamT, class Real>
STICTION_HD void unrolled_env(TeamT& team, const UnrolledJob<Real>& job, Offset index, const Index* order,
                              double* memory) {
  EnvView<Real> env = slice_problem(job.batch, job.law, index);
  env.cone_order = order;
  GradientStatus record{0.0, 0.0, 0, 0, 0, 0};
  SweepTape s{};
  Index chosen = 0;
  double square = 0.0;
  if (env.n > most_unknowns(job, index)) {
    record.flags |= kGradientOverCapacity;
  } else {
    s = lay_out_tape(job, index, memory);
    record.flags |= load_tape(team, env, job, s);
  }
  const bool is_coulomb = job.law == Law::coulomb;
  if (record.flags == 0) {
    chosen = is_coulomb ? run_sweeps<Law::coulomb>(team, env, job, s, square)
                        : run_sweeps<Law::convex>(team, env, job, s, square);
    const double scale = max_over<double>(team, env.n, [&](Index i) { return abs_(static_cast<double>(env.b[i])); });
    record.forward_residual = div_(sqrt_(square), max_(scale, 1e-300));
    if (!finite_(square)) record.flags |= kGradientNonFinite;
  }
  const std::uint32_t before = record.flags;
  for (Offset set = 0; set < job.count; ++set) {
    bool refused = before != 0;
    if (!refused) {
      refused = !(is_coulomb ? sweeps_vjp<Law::coulomb>(team, env, job, s, chosen, set)
                             : sweeps_vjp<Law::convex>(team, env, job, s, chosen, set));
      if (refused) record.flags |= kGradientNonFinite;
    }
    write_unrolled(team, env, job, s, set, refused);
  }
  single(team, [&] { job.status[index] = record; });
}

/// Zeros for an environment that was not looked at, and its record.
template <Team TeamT, class Real>
STICTION_HD void refuse_unrolled(TeamT& team, const UnrolledJob<Real>& job, Offset index, std::uint32_t flags) {
  const EnvView<Real> env = slice_problem(job.batch, job.law, index);
  for (Offset set = 0; set < job.count; ++set) write_unrolled(team, env, job, SweepTape{}, set, true);
  single(team, [&] { job.status[index] = {0.0, 0.0, flags, 0, 0, 0}; });
}

}  // namespace stiction::inline STICTION_ISA
