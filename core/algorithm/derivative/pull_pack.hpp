#pragma once

#include "core/algorithm/derivative/pull_load.hpp"
#include "core/algorithm/derivative/vjp.hpp"
#include "core/algorithm/linear/dense/lane_lu.hpp"

/// vjp_env() of environments side by side (docs/math/derivative.md, "Contacts side by side"). Modes are found one by
/// one. All that grows faster than with the number of rows is done in lanes: products with A, the system, its factor.
/// Each number comes of the operations that vjp_env() has for it, in their order, so it has the same bits. What an
/// environment has not adds zeros. An environment with anything out of the ordinary is left to vjp_env(). Host only.
namespace stiction::inline STICTION_ISA {

/// Environments of more rows fill the cache, and their loops are long enough alone.
inline constexpr Index kMostPullRows = 64;

template <class Real, int W>
class PullPack {
 public:
  using Lanes = Pack<double, W>;

  PullPack(const VjpJob<Real>& job, const Offset* envs, Index count, const PullSlots& slots,
           const PullWorkspace<Real, W>& workspace)
      : job_(job), envs_(envs), count_(count), slots_(slots), s_(workspace), n_(slots.rows()) {}

  /// Writes what it can and marks that in `answered`.
  void run(std::uint8_t* answered) {
    load();
    find_motions();
    for (int l = 0; l < count_; ++l) find_modes_of(l);
    load_directions();
    factor();
    for (Offset set = 0; set < job_.count; ++set) {
      load_cotangents(set);
      solve();
      for (int l = 0; l < count_; ++l)
        if (alive_[l]) write(l, set);
    }
    for (int l = 0; l < count_; ++l) {
      if (!alive_[l]) continue;
      write_record(team_, job_, envs_[l], found_[l], residual_[l]);
      answered[envs_[l]] = 1;
    }
  }

 private:
  static double& lane(Lanes* numbers, Offset i, int l) { return reinterpret_cast<double*>(numbers)[i * W + l]; }
  [[nodiscard]] Lanes entry(Index i, Index j) const {
    Lanes value;
    widen_lanes(s_.A + (Offset{i} * n_ + j) * W, value);
    return value;
  }
  /// f(row here, row of the environment) for all of a lane's rows.
  template <class F>
  void for_each_row(int l, const F& f) const {
    const Index* const batch_row = s_.rows_of(l);
    for (Index r = 0; r < n_; ++r)
      if (batch_row[r] >= 0) f(r, batch_row[r]);
  }

  void load() {
    for (int l = 0; l < count_; ++l) {
      env_[l] = slice_problem(job_.batch, job_.law, envs_[l]);
      env_[l].is_full = true;
      own_[l] = lay_out(env_[l].n, env_[l].cone_count, 0, 0, s_.own + s_.own_length * l);
      list_own_rows(env_[l], slots_, s_, l);
    }
    load_own_matrices<Real, W>(env_, count_, s_);
    load_own_rows<Real, W>(env_, count_, job_.batch.R, s_, s_.R);
    load_own_rows<Real, W>(env_, count_, job_.at.lambda, s_, s_.given);
    load_own_rows<Real, W>(env_, count_, job_.batch.b, s_, s_.motion);
  }

  /// motion += (A + diag R) given. Rows are summed four at a time, so that they do not wait for each other.
  void find_motions() {
    constexpr Index kTogether = 4;
    for (Index r = 0; r < n_; r += kTogether) {
      const Index rows = n_ - r < kTogether ? n_ - r : kTogether;
      Lanes sum[kTogether];
      for (Index k = 0; k < rows; ++k) sum[k] = fma_(s_.R[r + k], s_.given[r + k], s_.motion[r + k]);
      if (rows == kTogether) {
        for (Index c = 0; c < n_; ++c)
          for (Index k = 0; k < kTogether; ++k) sum[k] = fma_(entry(r + k, c), s_.given[c], sum[k]);
      } else {
        for (Index c = 0; c < n_; ++c)
          for (Index k = 0; k < rows; ++k) sum[k] = fma_(entry(r + k, c), s_.given[c], sum[k]);
      }
      for (Index k = 0; k < rows; ++k) s_.motion[r + k] = sum[k];
    }
  }

  void find_modes_of(int l) {
    for_each_row(l, [&](Index r, Index i) { own_[l].w[i] = lane(s_.motion, r, l); });
    found_[l] = find_modes_at_motion(team_, env_[l], job_, envs_[l], StoredRows<Real>{&env_[l]}, own_[l]);
    alive_[l] = (found_[l].flags & kGradientRefused) == 0;
  }

  /// E, F and D into lanes, and which unknowns there are in any.
  void load_directions() {
    for (Index k = 0; k < n_ * kMaxConeRows; ++k) s_.E[k] = s_.F[k] = Lanes(0);
    for (Index r = 0; r < n_; ++r) {
      s_.D[r] = Lanes(1);
      s_.unknown_of[r] = -1;
      is_bent_[r] = false;
    }
    for (int l = 0; l < count_; ++l)
      if (alive_[l]) load_directions_of(l);
    unknowns_ = 0;
    for (Index r = 0; r < n_; ++r)
      if (s_.unknown_of[r] == 0) s_.unknown_of[r] = unknowns_++;
  }
  void load_directions_of(int l) {
    const DerivativeScratch& own = own_[l];
    for (Index cone = 0; cone < env_[l].cone_count; ++cone) {
      const Index first = env_[l].cone_row(cone), row = s_.cones_of(l)[cone];
      const Index unknowns = own.first[cone + 1] - own.first[cone];
      for (Index k = 0; k < unknowns; ++k) {
        s_.unknown_of[row + k] = 0;
        lane(s_.D, row + k, l) = own.D[first + k];
      }
      for (Index i = 0; unknowns > 0 && i < env_[l].cone_size(cone); ++i)
        for (Index k = 0; k < unknowns; ++k) {
          const Offset from = Offset{first + i} * kMaxConeRows + k, to = Offset{row + i} * kMaxConeRows + k;
          lane(s_.E, to, l) = own.E[from];
          lane(s_.F, to, l) = own.F[from];
          is_bent_[row] = is_bent_[row] || (i != k && own.E[from] != 0.0);
        }
    }
  }

  /// f(first row, number of rows) for all cones that have unknowns.
  template <class F>
  void for_each_moving(const F& f) const {
    Index row = 0;
    for (Index run = 0; run < slots_.runs(); ++run)
      for (Index k = 0; k < slots_.count(run); ++k, row += slots_.size(run))
        if (s_.unknown_of[row] >= 0) f(row, slots_.size(run));
  }
  [[nodiscard]] LaneMatrix<W> system() const { return {s_.K, unknowns_}; }

  /// The entries of G' in the columns of a cone's F. `kBent`: in some lane its directions are not its rows'.
  template <int kRows, bool kBent>
  void fill_columns(Index row) const {
    for_each_moving([&](Index other, Index others) {
      for (Index c = 0; c < others && s_.unknown_of[other + c] >= 0; ++c) {
        const Index begin = is_bent_[other] ? 0 : c, end = is_bent_[other] ? others : c + 1;
        Lanes sum[kRows];
        for (int f = 0; f < kRows; ++f) sum[f] = Lanes(0);
        for (int i = 0; i < kRows; ++i) {
          const auto add = [&](Lanes value, Index j) {
            const Lanes moved = value * s_.E[j * kMaxConeRows + c];
            const Lanes* const F = s_.F + (row + i) * kMaxConeRows;
            if constexpr (kBent) {
              for (int f = 0; f < kRows; ++f) sum[f] = fma_(F[f], moved, sum[f]);
            } else {
              sum[i] = fma_(F[i], moved, sum[i]);
            }
          };
          for (Index j = begin; j < end; ++j) add(entry(row + i, other + j), other + j);
          if (row == other) add(s_.R[row + i], row + i);
        }
        for (int f = 0; f < kRows && s_.unknown_of[row + f] >= 0; ++f)
          s_.K[Offset{s_.unknown_of[row + f]} * unknowns_ + s_.unknown_of[other + c]] = sum[f];
      }
    });
    const LaneMatrix<W> K = system();
    for (int f = 0; f < kRows && s_.unknown_of[row + f] >= 0; ++f) {
      Lanes& diagonal = K(s_.unknown_of[row + f], s_.unknown_of[row + f]);
      diagonal = diagonal + s_.D[row + f];
    }
  }
  template <int kRows>
  void fill_cone(Index row) const {
    if (is_bent_[row]) return fill_columns<kRows, true>(row);
    fill_columns<kRows, false>(row);
  }

  void factor() {
    for_each_moving([&](Index row, Index rows) {
      switch (rows) {
        case 1:
          return fill_cone<1>(row);
        case 2:
          return fill_cone<2>(row);
        case 3:
          return fill_cone<3>(row);
        case 4:
          return fill_cone<4>(row);
        case 5:
          return fill_cone<5>(row);
        default:
          return fill_cone<6>(row);
      }
    });
    const LaneMatrix<W> K = system();
    for (int l = 0; l < count_; ++l) alive_[l] = alive_[l] && is_stable(l);
    equilibrate_lanes(K);
    Lanes floor(0);
    for (int l = 0; l < count_; ++l) floor.v[l] = pivot_floor<Real>(found_[l].unknowns);
    const auto sound = factor_lane_lu(K, s_.pivots, floor);
    for (int l = 0; l < count_; ++l) alive_[l] = alive_[l] && is_set(sound, l);
  }
  /// Whether no contact slides that more pressure would press on less.
  [[nodiscard]] bool is_stable(int l) const {
    for (Index cone = 0; cone < env_[l].cone_count; ++cone) {
      if (own_[l].mode[cone] != static_cast<Index>(ConeMode::sliding)) continue;
      const Index k = s_.unknown_of[s_.cones_of(l)[cone]];
      if (!(system().at(k, k, l) > 0.0)) return false;
    }
    return true;
  }
  static Lanes unit_scales(Lanes largest) {
    Lanes scale;
    for (int l = 0; l < W; ++l) scale.v[l] = unit_scale(largest.v[l]);
    return scale;
  }
  /// equilibrate(), lane by lane.
  void equilibrate_lanes(const LaneMatrix<W>& K) const {
    for (Index i = 0; i < K.n; ++i) s_.row_scale[i] = Lanes(0);
    for (Index j = 0; j < K.n; ++j)
      for (Index i = 0; i < K.n; ++i) s_.row_scale[i] = max_(abs_(K(i, j)), s_.row_scale[i]);
    for (Index i = 0; i < K.n; ++i) s_.row_scale[i] = unit_scales(s_.row_scale[i]);
    for (Index j = 0; j < K.n; ++j) {
      Lanes largest(0);
      for (Index i = 0; i < K.n; ++i) {
        K(i, j) = K(i, j) * s_.row_scale[i];
        largest = max_(abs_(K(i, j)), largest);
      }
      const Lanes scale = s_.column_scale[j] = unit_scales(largest);
      for (Index i = 0; i < K.n; ++i) K(i, j) = K(i, j) * scale;
    }
  }

  void load_cotangents(Offset set) {
    const auto of_set = [&](const Real* numbers) {
      return numbers == nullptr ? nullptr : numbers + set * job_.batch.row_count;
    };
    load_own_rows<Real, W>(env_, count_, of_set(job_.cotangents.lambda), s_, s_.given);
    load_own_rows<Real, W>(env_, count_, of_set(job_.cotangents.w), s_, s_.motion);
  }
  /// out = given + (A + diag R)' in.
  void apply_transposed(const Lanes* in, Lanes* out) const {
    for (Index r = 0; r < n_; ++r) out[r] = fma_(s_.R[r], in[r], s_.given[r]);
    for (Index r = 0; r < n_; ++r)
      for (Index c = 0; c < n_; ++c) out[c] = fma_(entry(r, c), in[r], out[c]);
  }
  /// f(number of the unknown, its row, sum over the rows of its cone of E times in).
  template <class F>
  void sum_for_unknowns(const Lanes* in, const F& f) const {
    for_each_moving([&](Index row, Index rows) {
      for (Index k = 0; k < rows && s_.unknown_of[row + k] >= 0; ++k) {
        Lanes sum(0);
        for (Index i = 0; i < rows; ++i) sum = fma_(s_.E[(row + i) * kMaxConeRows + k], in[row + i], sum);
        f(s_.unknown_of[row + k], row + k, sum);
      }
    });
  }

  /// solve_adjoint() of all lanes.
  void solve() {
    const Lanes* seed = s_.given;
    if (job_.cotangents.w != nullptr) {
      apply_transposed(s_.motion, s_.image);
      seed = s_.image;
    }
    Lanes largest(0);
    sum_for_unknowns(seed, [&](Index k, Index, Lanes value) {
      largest = max_(abs_(value * s_.row_scale[k]), largest);
      s_.unknown[k] = value * s_.row_scale[k];
    });
    solve_lane_lu(system(), s_.pivots, s_.unknown);
    for (Index k = 0; k < unknowns_; ++k) s_.unknown[k] = s_.unknown[k] * s_.column_scale[k];
    for (Index r = 0; r < n_; ++r) s_.nu[r] = s_.motion[r];
    for_each_moving([&](Index row, Index rows) {
      for (Index i = 0; i < rows; ++i) {
        Lanes sum(0);
        for (Index k = 0; k < rows && s_.unknown_of[row + k] >= 0; ++k)
          sum = fma_(s_.F[(row + i) * kMaxConeRows + k], s_.unknown[s_.unknown_of[row + k]], sum);
        s_.nu[row + i] = s_.motion[row + i] - sum;
      }
    });
    apply_transposed(s_.nu, s_.image);
    Lanes left(0);
    sum_for_unknowns(s_.image, [&](Index k, Index row, Lanes value) {
      left = max_(abs_((value - s_.D[row] * s_.unknown[k]) * s_.row_scale[k]), left);
    });
    Lanes nothing(0);  // NaN where anything is not finite
    for (Index r = 0; r < n_; ++r) nothing = fma_(s_.nu[r], Lanes(0), fma_(s_.image[r], Lanes(0), nothing));
    for (int l = 0; l < count_; ++l) {
      alive_[l] = alive_[l] && nothing.v[l] == 0.0;
      const double own = largest.v[l] > 0.0 ? div_(left.v[l], largest.v[l]) : 0.0;
      residual_[l] = max_(own, residual_[l]);
    }
  }

  void write(int l, Offset set) {
    for_each_row(l, [&](Index r, Index i) {
      own_[l].nu[i] = lane(s_.nu, r, l);
      own_[l].image[i] = lane(s_.image, r, l);
    });
    write_gradients(team_, env_[l], job_, own_[l], set, false);
  }

  const VjpJob<Real>& job_;
  const Offset* envs_;
  Index count_;
  const PullSlots& slots_;
  const PullWorkspace<Real, W>& s_;
  Index n_;
  Index unknowns_ = 0;
  SerialTeam team_;
  EnvView<Real> env_[W];
  DerivativeScratch own_[W];
  ModesFound found_[W];
  bool alive_[W] = {};
  double residual_[W] = {};
  bool is_bent_[kMostPullRows * 2];  ///< of a cone's first row: its directions are not its rows'
};

}  // namespace stiction::inline STICTION_ISA
