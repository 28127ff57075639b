#pragma once

#include "core/algorithm/derivative/vjp.hpp"
#include "core/algorithm/driver/solve_environment.hpp"
#include "core/algorithm/unrolled/vjp_step.hpp"
#include "core/job/unrolled_job.hpp"

/// Sweeps of `pgs` run again in double, with their values kept (docs/math/derivative.md, (28)). Cones follow one
/// another; lanes share the rows of a visit.
namespace stiction::inline STICTION_ISA {

/// Scratch of one environment, in the coordinates of the unit cones. Position p of a cone's component k is its first
/// row + k, the normal first.
struct SweepTape {
  Index n;
  double* A;          ///< S (A + diag R) S                                     (n x n)
  double* A_bar;      ///< its cotangents                                       (n x n)
  double* before;     ///< reaction of a cone before its visit, sweep by sweep  (sweeps x n)
  double* motion;     ///< its motion at the visit                              (sweeps x n)
  double* scale;      ///< S                                                    (n)
  double* b;          ///< S b                                                  (n)
  double* guess;      ///< where sweeps begin, before it is moved into the cone (n)
  double* x;          ///<                                                      (n)
  double* best;       ///< the iterate that is returned                         (n)
  double* x_bar;      ///<                                                      (n)
  double* b_bar;      ///<                                                      (n)
  double* lo_bar;     ///<                                                      (n)
  double* hi_bar;     ///<                                                      (n)
  double* seed;       ///< cotangents of lambda, row by row                     (n)
  double* lambda;     ///< in the batch's rows                                  (n)
  double* w;          ///<                                                      (n)
  double* measure;    ///< inv_n, inv_t, damping, share of each cone            (4 x cones)
  double* measured;   ///< their cotangents                                     (4 x cones)
  double* share;      ///< of each cone's island, over the largest error scale  (cones)
  double* by_motion;  ///< cotangents of the motion at a visit                  (kMaxConeRows)
  Index* row;         ///< the batch's row of each position                     (n)
  Index* position;    ///< and back                                             (n)

  [[nodiscard]] STICTION_HD double& entry(double* matrix, Index p, Index q) const {
    return matrix[static_cast<Offset>(p) * n + q];
  }
};

/// Scratch of an environment of that size, in doubles.
STICTION_HD constexpr Offset unrolled_elements(Offset rows, Offset cones, Offset sweeps) {
  return 2 * rows * rows + 2 * rows * sweeps + 12 * rows + 9 * cones + kMaxConeRows + rows + 1;
}
template <class Real>
STICTION_HD Offset unrolled_elements(const UnrolledJob<Real>& job, Offset env) {
  const Offset n = most_unknowns(job, env) < job.batch.env_rows(env) ? 0 : job.batch.env_rows(env);
  return unrolled_elements(n, job.batch.env_cones(env), job.sweeps.count);
}

template <class Real>
STICTION_HD SweepTape lay_out_tape(const UnrolledJob<Real>& job, Offset env, double* memory) {
  const Offset n = job.batch.env_rows(env), cones = job.batch.env_cones(env);
  const auto take = [&](Offset count) {
    double* const begin = memory;
    memory += count;
    return begin;
  };
  SweepTape s;
  s.n = static_cast<Index>(n);
  s.A = take(n * n);
  s.A_bar = take(n * n);
  s.before = take(n * job.sweeps.count);
  s.motion = take(n * job.sweeps.count);
  for (double** vector :
       {&s.scale, &s.b, &s.guess, &s.x, &s.best, &s.x_bar, &s.b_bar, &s.lo_bar, &s.hi_bar, &s.seed, &s.lambda, &s.w})
    *vector = take(n);
  s.measure = take(4 * cones);
  s.measured = take(4 * cones);
  s.share = take(cones);
  s.by_motion = take(kMaxConeRows);
  s.row = reinterpret_cast<Index*>(memory);
  s.position = s.row + n;
  return s;
}

/// f(column, entry) for all that row i of A has, R left out. Lanes share them.
template <Team TeamT, class Real, class F>
STICTION_HD void for_each_of_row(TeamT& team, const EnvView<Real>& env, Index i, const F& f) {
  if (env.factor == nullptr) {
    const Real* const a = env.A + env.row_offsets[i];
    for_each(team, env.entries(i), [&](Index k) { f(env.columns(i)[k], static_cast<double>(a[k])); });
    return;
  }
  for_each(team, env.n, [&](Index j) {
    double sum = 0.0;
    for (Index k = 0; k < env.dofs; ++k)
      sum = fma_(static_cast<double>(env.factor[static_cast<Offset>(i) * env.dofs + k]),
                 static_cast<double>(env.factor[static_cast<Offset>(j) * env.dofs + k]), sum);
    f(j, sum);
  });
}
/// One lane has them all, in order.
template <class Real, class F>
STICTION_HD void for_each_of_row(const EnvView<Real>& env, Index i, const F& f) {
  SerialTeam alone;
  for_each_of_row(alone, env, i, f);
}

/// f(shape, cone, first row) for every cone. Lanes share them.
template <Team TeamT, class Real, class F>
STICTION_HD void for_each_shape(TeamT& team, const EnvView<Real>& env, const F& f) {
  for_each(team, env.cone_count, [&](Index cone) {
    with_shape(env.kind[cone], env.cone_size(cone), [&](auto shape) { f(shape, cone, env.cone_row(cone)); });
  });
}

/// A cone and the reaction x of its rows; its bounds where it is a box.
template <class Shape, class Real>
STICTION_HD auto lone_cone(Shape, const EnvView<Real>& env, const SweepTape& s, Index cone, Index first,
                           const double* x) {
  constexpr int kRows = Shape::kRows;
  LoneCone<kRows> lone;
  for (int i = 0; i < kRows; ++i) {
    lone.x[i] = x[i];
    for (int j = 0; j < kRows; ++j) lone.B[i][j] = s.entry(s.A, first + i, first + j);
  }
  const double* const measure = s.measure + 4 * cone;
  lone.inv_n[0] = measure[0];
  lone.inv_t[0] = measure[1];
  lone.damping[0] = measure[2];
  lone.share[0] = measure[3];
  lone.lo[0] = Shape::kKind == ConeKind::box ? static_cast<double>(lower_bound(env, first)) : 0.0;
  lone.hi[0] = Shape::kKind == ConeKind::box ? static_cast<double>(upper_bound(env, first)) : 0.0;
  return lone;
}

/// Rows of A as the final residual reads them: f(rows).
template <class Real, class F>
STICTION_HD auto with_rows(const EnvView<Real>& env, F&& f) {
  if (env.factor == nullptr) return f(StoredRows<Real>{&env});
  return f(FactorRows<Real>{&env, nullptr});
}

/// Shares of islands, as weigh_islands() finds them.
template <Team TeamT, class Real>
STICTION_HD void weigh_islands(TeamT& team, const EnvView<Real>& env, const SweepTape& s) {
  const double unit =
      error_unit(max_over<double>(team, env.n, [&](Index i) { return abs_(static_cast<double>(env.b[i])); }));
  for_each(team, env.cone_count, [&](Index cone) {
    s.share[cone] = with_rows(env, [&](const auto& rows) { return cone_error_at_rest(env, rows, cone, unit); });
  });
  const double most = max_over<double>(team, env.cone_count, [&](Index cone) { return s.share[cone]; });
  const auto couples = [&](Index a, Index b) {
    for (Index p = env.cone_row(a); p < env.cone_row(a) + env.cone_size(a); ++p)
      for (Index q = env.cone_row(b); q < env.cone_row(b) + env.cone_size(b); ++q)
        if (s.entry(s.A, p, q) != 0.0 || s.entry(s.A, q, p) != 0.0) return true;
    return false;
  };
  single(team, [&] {
    for (bool has_grown = true; has_grown;) {
      has_grown = false;
      for (Index a = 0; a < env.cone_count; ++a)
        for (Index b = 0; b < env.cone_count && s.share[a] != most; ++b)
          if (s.share[b] > s.share[a] && couples(a, b)) {
            s.share[a] = s.share[b];
            has_grown = true;
          }
    }
  });
  for_each(team, env.cone_count,
           [&](Index cone) { s.share[cone] = most > 0.0 ? island_share(most, s.share[cone]) : 1.0; });
}

/// Fills the system and the guess. Returns flags, on every lane.
template <Team TeamT, class Real>
STICTION_HD_OUTLINE std::uint32_t load_tape(TeamT& team, const EnvView<Real>& env, const UnrolledJob<Real>& job,
                                            const SweepTape& s) {
  std::uint32_t flags = 0;
  if ((env.flags & ~static_cast<std::uint32_t>(kFlagContactsDropped)) != 0) flags |= kGradientInvalidInput;
  for_each_shape(team, env, [&](auto shape, Index cone, Index first) {
    constexpr int kRows = decltype(shape)::kRows;
    if (env.kind[cone] >= ConeKind::box_friction) flags |= kGradientInvalidInput;
    for (int k = 0; k < kRows; ++k) {
      const Index i = env.row_of(first, kRows, k), p = first + k;
      flags |= row_flags(env, shape.kKind, k, i);
      s.row[p] = i;
      s.position[i] = p;
      s.scale[p] = static_cast<double>(row_scale(env, shape.kKind, k, i));
      s.b[p] = s.scale[p] * static_cast<double>(env.b[i]);
      const double from =
          job.sweeps.warm_start == nullptr ? 0.0 : static_cast<double>(job.sweeps.warm_start[env.first_row + i]);
      s.guess[p] = unit_reaction(from, s.scale[p]);
      if (!finite_(s.b[p]) || !finite_(s.guess[p])) flags |= kGradientNonFinite;
    }
  });
  for_each(team, env.n, [&](Index i) {
    const Index p = s.position[i];
    for (Index q = 0; q < env.n; ++q) s.entry(s.A, p, q) = 0.0;
    const auto add = [&](Index j, double value) {
      const Index q = s.position[j];
      double& entry = s.entry(s.A, p, q);
      entry = fma_(s.scale[p] * value, s.scale[q], entry);
      if (!finite_(entry)) flags |= kGradientNonFinite;
    };
    for_each_of_row(env, i, add);
    add(i, static_cast<double>(env.R[i]));
  });
  for_each_shape(team, env, [&](auto shape, Index cone, Index first) {
    auto lone = lone_cone(shape, env, s, cone, first, s.guess + first);
    lone.measure();
    double* const measure = s.measure + 4 * cone;
    measure[0] = lone.inv_n[0];
    measure[1] = lone.inv_t[0];
    measure[2] = lone.damping[0];
    measure[3] = lone.share[0];
    double still[decltype(shape)::kRows] = {};
    proximal_point(shape, lone.x, still, 0.0, lone.lo[0], lone.hi[0], Law::convex);
    for (int k = 0; k < decltype(shape)::kRows; ++k) s.x[first + k] = lone.x[k];
  });
  weigh_islands(team, env, s);
  return team.combine(flags);
}

/// One sweep, kept.
template <Law kLaw, Team TeamT, class Real>
STICTION_HD void keep_sweep(TeamT& team, const EnvView<Real>& env, const UnrolledJob<Real>& job, const SweepTape& s,
                            Index sweep) {
  double* const before = s.before + static_cast<Offset>(sweep) * s.n;
  double* const motion = s.motion + static_cast<Offset>(sweep) * s.n;
  for (Index p = 0; p < env.cone_count; ++p) {
    const Index cone = env.factor == nullptr ? env.cone_order[p] : p;
    const Index first = env.cone_row(cone);
    for_each(team, env.cone_size(cone), [&](Index r) {
      double sum = s.b[first + r];
      for (Index j = 0; j < s.n; ++j) sum = fma_(s.entry(s.A, first + r, j), s.x[j], sum);
      motion[first + r] = sum;
      before[first + r] = s.x[first + r];
    });
    single(team, [&] {
      with_shape(env.kind[cone], env.cone_size(cone), [&](auto shape) {
        constexpr int kRows = decltype(shape)::kRows;
        double y[kRows];
        for (int r = 0; r < kRows; ++r) y[r] = motion[first + r];
        const auto lone = lone_cone(shape, env, s, cone, first, s.x + first);
        const auto step = local_step<kLaw>(shape, lone, 0, 0, y, job.sweeps.omega);
        for (int r = 0; r < kRows; ++r) s.x[first + r] = s.x[first + r] + step.d[r];
      });
    });
  }
}

/// The square of the largest error at the iterate, in shares of the largest error scale; on every lane. The solver
/// chooses its result by it.
template <Team TeamT, class Real>
STICTION_HD double square_at(TeamT& team, const EnvView<Real>& env, const SweepTape& s) {
  for_each(team, s.n, [&](Index p) { s.lambda[s.row[p]] = s.scale[p] * s.x[p]; });
  LargestResidual<double> largest;
  for_each(team, env.n, [&](Index i) {
    s.w[i] = fma_(static_cast<double>(env.R[i]), s.lambda[i], static_cast<double>(env.b[i]));
    for_each_of_row(env, i, [&](Index j, double value) { s.w[i] = fma_(value, s.lambda[j], s.w[i]); });
  });
  for_each(team, env.cone_count, [&](Index cone) {
    with_rows(env, [&](const auto& rows) {
      add_cone<false>(
          env, rows, cone, s.share[cone], 1.0, [&](Index i) { return s.w[i]; }, [&](Index i) { return s.lambda[i]; },
          largest);
      return 0;
    });
  });
  return team.max(largest.square);
}

/// All sweeps. Returns which iterate the solver returns, of those that it looks at; it is left in `best`.
template <Law kLaw, Team TeamT, class Real>
STICTION_HD_OUTLINE Index run_sweeps(TeamT& team, const EnvView<Real>& env, const UnrolledJob<Real>& job,
                                     const SweepTape& s, double& square) {
  Index chosen = 0;
  for (Index done = 0;; ++done) {
    if (done % kChunk == 0 || done == job.sweeps.count) {
      const double own = square_at(team, env, s);
      if (done == 0 || own < square) {
        square = own;
        chosen = done;
        for_each(team, s.n, [&](Index p) { s.best[p] = s.x[p]; });
      }
    }
    if (done == job.sweeps.count) return chosen;
    keep_sweep<kLaw>(team, env, job, s, done);
  }
}

}  // namespace stiction::inline STICTION_ISA
