#pragma once

#include <type_traits>

#include "core/algorithm/derivative/jvp.hpp"
#include "core/algorithm/derivative/mode_load.hpp"
#include "core/algorithm/linear/dense/lane_lu.hpp"

/// vjp_env() and jvp_env() of environments side by side (core/algorithm/derivative/README.md). Modes, and changes while
/// reactions rest, are found one by one. All that grows faster than with the number of rows is done in lanes: products
/// with A, the system, its factor. The products and the solution of a set are the text of one environment. The system
/// is summed and factored in another order of loops, and each number of it in the same order. All thus have the bits
/// that they have alone. An environment that has less than others adds zeros, and one with anything out of the ordinary
/// is left to the program of one. Host only.
namespace stiction::inline STICTION_ISA {

/// Environments of more rows fill the cache, and their loops are long enough alone.
inline constexpr Index kMostModeRows = 64;

/// A row of A in lanes, which stores every column in order.
template <class Real, int W>
struct LaneRow {
  const Real* A;
  Index count;

  [[nodiscard]] static Index column(Index k) { return k; }
  [[nodiscard]] Pack<double, W> value(Index k) const {
    Pack<double, W> numbers;
    widen_lanes(A + Offset{k} * W, numbers);
    return numbers;
  }
};

/// Environments side by side, as mode_products.hpp reads them.
template <class Real, int W>
struct LaneModes {
  using Wide = Pack<double, W>;
  static constexpr bool kMayHaveFactor = false;
  const ModeWorkspace<Real, W>& s;
  Index cone_count = 0;

  [[nodiscard]] Index rows() const { return s.n; }
  [[nodiscard]] Wide compliance(Index i) const { return s.R[i]; }
  [[nodiscard]] LaneRow<Real, W> row(Index i) const { return {s.A + Offset{i} * s.n * W, s.n}; }
  [[nodiscard]] static bool is_full() { return true; }
  [[nodiscard]] Index cones() const { return cone_count; }
  [[nodiscard]] const ConeUnknowns& cone(Index c) const { return s.cone[c]; }
  [[nodiscard]] const ConeUnknowns& cone_of(Index i) const { return s.cone[s.cone_of_row[i]]; }
};

/// Cotangents of their solutions, of a set.
template <class Real, int W>
struct LaneBar {
  const ModeWorkspace<Real, W>& s;
  bool is_of_w;

  [[nodiscard]] Pack<double, W> by_lambda(Index i) const { return s.seed[i]; }
  [[nodiscard]] Pack<double, W> by_w(Index i) const { return s.still[i]; }
  [[nodiscard]] bool has_w() const { return is_of_w; }
};

/// `Job`: VjpJob<Real> or JvpJob<Real>.
template <class Job, class Real, int W>
class ModePack {
 public:
  using Lanes = Pack<double, W>;
  static constexpr bool kIsReverse = std::is_same_v<Job, VjpJob<Real>>;

  ModePack(const Job& job, const Offset* envs, Index count, const ModeSlots& slots,
           const ModeWorkspace<Real, W>& workspace)
      : job_(job), envs_(envs), count_(count), slots_(slots), s_(workspace), n_(slots.rows()), modes_{workspace} {}

  /// Writes the environments it can, marked in `answered`.
  void run(std::uint8_t* answered) {
    load();
    find_motions();
    for (int l = 0; l < count_; ++l) find_modes_of(l);
    load_directions();
    factor();
    for (Offset set = 0; set < job_.count; ++set) {
      load_set(set);
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
    load_own_rows<Real, W>(env_, count_, job_.at.lambda, s_, s_.seed);
    load_own_rows<Real, W>(env_, count_, job_.batch.b, s_, s_.still);
  }

  /// still += (A + diag R) seed: the motion at the reactions.
  void find_motions() {
    apply_rows(
        team_, modes_, s_.seed, [&](Index i) { return s_.still[i]; },
        [&](Index i, Lanes value) { s_.still[i] = value; });
  }

  void find_modes_of(int l) {
    collect(s_.still, l, own_[l].w);
    found_[l] = find_modes_at_motion(team_, env_[l], job_, envs_[l], StoredRows<Real>{&env_[l]}, own_[l]);
    alive_[l] = (found_[l].flags & kGradientRefused) == 0;
  }

  /// E, F and D into lanes, and which unknowns there are in any.
  void load_directions() {
    for (Index k = 0; k < n_ * kMaxConeRows; ++k) s_.E[k] = s_.F[k] = Lanes(0);
    list_cones();
    for (int l = 0; l < count_; ++l)
      if (alive_[l]) load_directions_of(l);
    unknowns_ = 0;
    for (Index c = 0; c < modes_.cone_count; ++c) {
      s_.cone[c].first = unknowns_;
      unknowns_ += s_.cone[c].count;
    }
  }
  void list_cones() {
    Index row = 0;
    for (Index run = 0; run < slots_.runs(); ++run)
      for (Index k = 0; k < slots_.count(run); ++k, row += slots_.size(run)) {
        const Index cone = modes_.cone_count++;
        s_.cone[cone] = {row, slots_.size(run), 0, 0};
        is_bent_[cone] = false;
        for (Index i = row; i < row + slots_.size(run); ++i) {
          s_.cone_of_row[i] = cone;
          s_.D[i] = Lanes(1);
        }
      }
  }
  void load_directions_of(int l) {
    const DerivativeScratch& own = own_[l];
    for (Index cone = 0; cone < env_[l].cone_count; ++cone) {
      const Index first = env_[l].cone_row(cone), row = s_.cones_of(l)[cone], slot = s_.cone_of_row[row];
      const Index unknowns = own.first[cone + 1] - own.first[cone];
      s_.cone[slot].count = max_(unknowns, s_.cone[slot].count);
      for (Index k = 0; k < unknowns; ++k) lane(s_.D, row + k, l) = own.D[first + k];
      for (Index i = 0; unknowns > 0 && i < env_[l].cone_size(cone); ++i)
        for (Index k = 0; k < unknowns; ++k) {
          const Offset from = Offset{first + i} * kMaxConeRows + k, to = Offset{row + i} * kMaxConeRows + k;
          lane(s_.E, to, l) = own.E[from];
          lane(s_.F, to, l) = own.F[from];
          is_bent_[slot] = is_bent_[slot] || (i != k && own.E[from] != 0.0);
        }
    }
  }

  [[nodiscard]] LaneMatrix<W> system() const { return {s_.K, unknowns_}; }

  /// The entries of G, or of its transpose in reverse, of a cone's F: sums of blocks, in registers. `kBent`: in some
  /// lane its directions are not its rows'.
  template <int kRows, bool kBent>
  void fill_columns(Index slot) const {
    const ConeUnknowns own = modes_.cone(slot);
    const LaneMatrix<W> K = system();
    for (Index cone = 0; cone < modes_.cone_count; ++cone) {
      const ConeUnknowns other = modes_.cone(cone);
      for (Index c = 0; c < other.count; ++c) {
        const Index begin = is_bent_[cone] ? 0 : c, end = is_bent_[cone] ? other.rows : c + 1;
        Lanes sum[kRows];
        for (int f = 0; f < kRows; ++f) sum[f] = Lanes(0);
        for (int i = 0; i < kRows; ++i) {
          const LaneRow<Real, W> row = modes_.row(own.row + i);
          const auto add = [&](Lanes value, Index j) {
            add_moved(s_.F + (own.row + i) * kMaxConeRows, value * s_.E[j * kMaxConeRows + c], kBent ? 0 : i,
                      kBent ? kRows : i + 1, [&](Index f) -> Lanes& { return sum[f]; });
          };
          for (Index j = other.row + begin; j < other.row + end; ++j) add(row.value(j), j);
          if (cone == slot) add(s_.R[own.row + i], own.row + i);
        }
        for (int f = 0; f < kRows && f < own.count; ++f)
          system_entry<kIsReverse>(K, own.first + f, other.first + c) = sum[f];
      }
    }
    for (int f = 0; f < kRows && f < own.count; ++f) {
      Lanes& diagonal = K(own.first + f, own.first + f);
      diagonal = diagonal + s_.D[own.row + f];
    }
  }
  template <int kRows>
  void fill_cone(Index slot) const {
    if (is_bent_[slot]) return fill_columns<kRows, true>(slot);
    fill_columns<kRows, false>(slot);
  }
  void fill_cone(Index slot) const {
    switch (modes_.cone(slot).rows) {
      case 1:
        return fill_cone<1>(slot);
      case 2:
        return fill_cone<2>(slot);
      case 3:
        return fill_cone<3>(slot);
      case 4:
        return fill_cone<4>(slot);
      case 5:
        return fill_cone<5>(slot);
      default:
        return fill_cone<6>(slot);
    }
  }

  void factor() {
    for (Index slot = 0; slot < modes_.cone_count; ++slot)
      if (modes_.cone(slot).count > 0) fill_cone(slot);
    const LaneMatrix<W> K = system();
    for (int l = 0; l < count_; ++l) alive_[l] = alive_[l] && is_stable(l);
    equilibrate(team_, K, s_.row_scale, s_.column_scale);
    Lanes floor(0);
    for (int l = 0; l < count_; ++l) floor.v[l] = pivot_floor<Real>(found_[l].unknowns);
    const auto sound = factor_lane_lu(K, s_.pivots, floor);
    for (int l = 0; l < count_; ++l) alive_[l] = alive_[l] && is_set(sound, l);
  }
  [[nodiscard]] bool is_stable(int l) const {
    for (Index cone = 0; cone < env_[l].cone_count; ++cone) {
      const ConeUnknowns& slot = modes_.cone_of(s_.cones_of(l)[cone]);
      if (slot.count > 0 && is_unstable(own_[l].mode[cone], system().at(slot.first, slot.first, l))) return false;
    }
    return true;
  }

  /// The cotangents of a set, or what changes while the unknowns rest.
  void load_set(Offset set) {
    if constexpr (kIsReverse) {
      load_cotangents(set);
    } else {
      for (int l = 0; l < count_; ++l) {
        if (!alive_[l]) continue;
        change_motion_at_rest(team_, env_[l], job_, own_[l], set);
        change_bounds(team_, env_[l], job_, own_[l], set);
      }
      deal(&DerivativeScratch::still, s_.still);
      deal(&DerivativeScratch::nu, s_.nu);
      deal(&DerivativeScratch::image, s_.image);
    }
  }
  /// Numbers that each environment has alone into lanes; zeros where there are none.
  void deal(double* DerivativeScratch::* numbers, Lanes* to) {
    for (Index r = 0; r < n_; ++r) to[r] = Lanes(0);
    for (int l = 0; l < count_; ++l)
      if (alive_[l]) for_each_row(l, [&](Index r, Index i) { lane(to, r, l) = (own_[l].*numbers)[i]; });
  }
  void collect(const Lanes* from, int l, double* to) {
    for_each_row(l, [&](Index r, Index i) { to[i] = reinterpret_cast<const double*>(from)[Offset{r} * W + l]; });
  }
  void load_cotangents(Offset set) {
    const auto of_set = [&](const Real* numbers) {
      return numbers == nullptr ? nullptr : numbers + set * job_.batch.row_count;
    };
    load_own_rows<Real, W>(env_, count_, of_set(job_.cotangents.lambda), s_, s_.seed);
    load_own_rows<Real, W>(env_, count_, of_set(job_.cotangents.w), s_, s_.still);
  }
  auto solution_of_set() {
    if constexpr (kIsReverse) {
      return solve_adjoint(team_, modes_, system(), LaneBar<Real, W>{s_, job_.cotangents.w != nullptr});
    } else {
      return solve_change(team_, modes_, system());
    }
  }
  void solve() {
    const auto own = solution_of_set();
    for (int l = 0; l < count_; ++l) {
      alive_[l] = alive_[l] && is_set(own.is_finite, l);
      residual_[l] = max_(own.residual.v[l], residual_[l]);
    }
  }

  void write(int l, Offset set) {
    collect(s_.nu, l, own_[l].nu);
    if constexpr (kIsReverse) {
      collect(s_.image, l, own_[l].image);
      write_gradients(team_, env_[l], job_, own_[l], set, false);
    } else {
      collect(s_.seed, l, own_[l].seed);
      write_changes(team_, env_[l], job_, own_[l], set, false);
    }
  }

  const Job& job_;
  const Offset* envs_;
  Index count_;
  const ModeSlots& slots_;
  const ModeWorkspace<Real, W>& s_;
  Index n_;
  LaneModes<Real, W> modes_;
  Index unknowns_ = 0;
  SerialTeam team_;
  EnvView<Real> env_[W];
  DerivativeScratch own_[W];
  ModesFound found_[W];
  bool alive_[W] = {};
  double residual_[W] = {};
  bool is_bent_[kMostModeRows * 2];  ///< of a cone in some lane: its directions are not its rows'
};

}  // namespace stiction::inline STICTION_ISA
