#pragma once

#include "core/body/admm/anderson.hpp"
#include "core/body/direct/fill_matrix.hpp"
#include "core/body/pgs_body.hpp"

namespace stiction::inline STICTION_ISA {

/// The vectors and the factor that admm keeps, in coordinates in which every cone's block has a mean diagonal of one:
/// cone c's rows of x are scale * z, its rows of y are motion / scale.
struct AdmmState {
  Index n;
  double* scale;         ///< of each row; the same on all rows of a cone
  double* g;             ///< what is iterated: z is its projection, u = g - z the dual over -rho
  double* z;             ///< feasible
  double* v;             ///< minimiser near z - u, on no cone
  double* f;             ///< change of g that a plain step makes
  double* f_before;      ///< the same at the iterate before
  double* image_before;  ///< where a plain step leads from the iterate before
  double* skew;          ///< (K - K') z / 2, where A is not symmetric
  double* changes;       ///< remembered changes of f, then of the image  (2 kAndersonMemory n)
  DenseMatrix factor;    ///< of K + rho

  static constexpr Index kVectors = 8 + 2 * kAndersonMemory;
  template <class System>
  static STICTION_HD AdmmState of(const System& s) {
    const Index n = s.n;
    const auto vector = [&](Index k) { return s.wide_vector(k, n); };
    return {n,
            vector(0),
            vector(1),
            vector(2),
            vector(3),
            vector(4),
            vector(5),
            vector(6),
            vector(7),
            vector(8),
            {vector(kVectors), n}};
  }
  [[nodiscard]] STICTION_HD double* change_of_f(Index slot) const { return changes + static_cast<Offset>(slot) * n; }
  [[nodiscard]] STICTION_HD double* change_of_image(Index slot) const { return change_of_f(slot + kAndersonMemory); }
};

/// Alternating directions with a cached factor (docs/math/admm.md): a solve with K + rho, a projection, a dual update,
/// over-relaxed; de Saxce's shift is taken from the dual. Anderson's acceleration on the whole iteration, and a ladder
/// of rho.
struct Admm {
  static constexpr SolverKind kKind = SolverKind::admm;
  static STICTION_HD constexpr MethodRoom room() { return {0, AdmmState::kVectors, 1}; }
  static constexpr Index kChunk = 4;
  static STICTION_HD constexpr bool needs_symmetry(Law law) { return law == Law::convex; }
  template <class System>
  static constexpr bool kKeepsMotion = false;

  static constexpr double kRelaxation = 1.6;
  static constexpr double kFreeShare = 1e-4;  ///< rho of free rows, which nothing splits, over rho of the others
  static constexpr double kGrowth = 2.0;      ///< of the plain step's length beyond which a guess is taken back
  static constexpr double kImbalance = 10.0;  ///< of primal and dual residual beyond which rho changes
  static constexpr Index kCheckInterval = 12;
  static_assert(kCheckInterval % kChunk == 0);
  static constexpr Index kMostSwitches = 4;
  static constexpr Index kRungs = 6;
  static constexpr Index kFirstRung = 2;
  static STICTION_HD double rung(Index k) {
    constexpr double kShare[kRungs] = {1.0, 0.3, 0.1, 0.03, 0.01, 0.003};
    return kShare[k];
  }

  template <Law kLaw, Block B, class System>
  static STICTION_HD_OUTLINE void start(B& block, System& s) {
    using Real = typename System::Real;
    const AdmmState a = AdmmState::of(s);
    s.for_each_cone(block, [&](auto shape, Index, Index row) {
      constexpr int kRows = decltype(shape)::kRows;
      double trace = 0.0;
      for (int k = 0; k < kRows; ++k) trace = trace + static_cast<double>(s.block_entry(row, k, k));
      const double mean = div_(trace, static_cast<double>(kRows));
      for (int k = 0; k < kRows; ++k) a.scale[row + k] = mean > 0.0 ? div_(1.0, sqrt_(mean)) : 1.0;
    });
    const double skewness = fill_scaled(block, s, a);
    const double largest = largest_eigenvalue(block, a);
    single(block, [&] {
      s.scalar[kLipschitz] = static_cast<Real>(largest);
      s.scalar[kAsymmetry] = static_cast<Real>(skewness);
      s.scalar[kRung] = Real(kFirstRung);
      s.scalar[kSwitches] = s.scalar[kAge] = Real(0);
    });
    factorise(block, s, a);
    const double rho = penalty(s);
    // The dual that the start's own motion says.
    s.for_each_cone(block, [&](auto shape, Index cone, Index row) {
      constexpr int kRows = decltype(shape)::kRows;
      double y[kRows];
      for (int k = 0; k < kRows; ++k) y[k] = static_cast<double>(s.y[row + k]) * a.scale[row + k];
      if constexpr (kLaw == Law::coulomb && decltype(shape)::kKind == ConeKind::friction)
        y[0] = y[0] + tangential_norm<kRows>(y);
      for (int k = 0; k < kRows; ++k) {
        a.g[row + k] = div_(static_cast<double>(s.x[row + k]), a.scale[row + k]);
        if constexpr (decltype(shape)::kKind != ConeKind::free) a.g[row + k] = a.g[row + k] - div_(y[k], rho);
      }
      project(s, a, shape, cone, row);
    });
    if (skewness > 0.0) refresh_motion(block, s);
    forget(block, s);
  }

  template <Law kLaw, Block B, class System>
  static STICTION_HD_OUTLINE void iterate(B& block, System& s, const MethodParams<Scalar<typename System::Real>>&) {
    using Real = typename System::Real;
    const AdmmState a = AdmmState::of(s);
    const double rho = penalty(s);
    const Index age = static_cast<Index>(s.scalar[kAge]);
    const bool is_skew = s.scalar[kAsymmetry] > Real(0);
    if (is_skew && age % kChunk == 0) find_skew(block, s, a);
    s.for_each_cone(block, [&](auto shape, Index, Index row) {
      constexpr int kRows = decltype(shape)::kRows;
      double u[kRows];
      for (int k = 0; k < kRows; ++k) {
        u[k] = a.g[row + k] - a.z[row + k];
        const double own = own_penalty(shape, rho);
        double load = static_cast<double>(s.b[row + k]) * a.scale[row + k];
        if (is_skew) load = load + a.skew[row + k];
        a.v[row + k] = fma_(own, a.z[row + k] - u[k], 0.0 - load);
      }
      if constexpr (kLaw == Law::coulomb && decltype(shape)::kKind == ConeKind::friction)
        a.v[row] = fma_(0.0 - rho, tangential_norm<kRows>(u), a.v[row]);
    });
    solve_ldl(block, a.factor, a.v);
    double apart = 0.0;
    s.for_each_cone(block, [&](auto shape, Index, Index row) {
      for (int k = 0; k < decltype(shape)::kRows; ++k) {
        const double gap = a.v[row + k] - a.z[row + k];
        a.f[row + k] = decltype(shape)::kKind == ConeKind::free ? gap : kRelaxation * gap;
        if constexpr (decltype(shape)::kKind != ConeKind::free) apart = max_(abs_(gap), apart);
      }
    });
    move(block, s, a);
    double moved = 0.0;
    double largest_z = 0.0;
    double largest_u = 0.0;
    s.for_each_cone(block, [&](auto shape, Index cone, Index row) {
      constexpr int kRows = decltype(shape)::kRows;
      double before[kRows];
      for (int k = 0; k < kRows; ++k) before[k] = a.z[row + k];
      project(s, a, shape, cone, row);
      if constexpr (decltype(shape)::kKind != ConeKind::free) {
        for (int k = 0; k < kRows; ++k) {
          moved = max_(abs_(a.z[row + k] - before[k]), moved);
          largest_z = max_(abs_(a.z[row + k]), largest_z);
          largest_u = max_(abs_(a.g[row + k] - a.z[row + k]), largest_u);
        }
      }
    });
    block.sync();
    single(block, [&] { s.scalar[kAge] = static_cast<Real>((age + 1) % kCheckInterval); });
    if (age + 1 == kCheckInterval)
      balance(block, s, a, block.max(apart) * block.max(largest_u), block.max(moved) * block.max(largest_z));
  }

  template <Block B, class System>
  static STICTION_HD void refresh(B&, System&, Mask<typename System::Real>) {}

 private:
  template <class System>
  static STICTION_HD double penalty(const System& s) {
    return rung(static_cast<Index>(s.scalar[kRung])) * static_cast<double>(s.scalar[kLipschitz]);
  }
  template <class Shape>
  static STICTION_HD double own_penalty(Shape, double rho) {
    return Shape::kKind == ConeKind::free ? kFreeShare * rho : rho;
  }

  /// K = scale (A + R) scale, symmetrised. Returns the largest difference that this took.
  template <Block B, class System>
  static STICTION_HD_OUTLINE double fill_scaled(B& block, const System& s, const AdmmState& a) {
    const DenseMatrix& K = a.factor;
    fill_matrix(block, s, K);
    double difference = 0.0;
    for_each(block, a.n, [&](Index i) {
      for (Index j = 0; j <= i; ++j) {
        difference = max_(abs_(K(i, j) - K(j, i)), difference);
        K(i, j) = K(j, i) = (0.5 * K(i, j) + 0.5 * K(j, i)) * (a.scale[i] * a.scale[j]);
      }
    });
    return block.max(difference);
  }

  /// What the factor does not know of an A that is not symmetric, from the motion that was recorded with x: the motion
  /// less load, less K + rho as the factor has it, plus rho. Once in a chunk is often enough, since it is small.
  template <Block B, class System>
  static STICTION_HD_OUTLINE void find_skew(B& block, const System& s, const AdmmState& a) {
    const DenseMatrix& L = a.factor;
    const double rho = penalty(s);
    for_each(block, a.n, [&](Index j) {
      double sum = a.z[j];
      for (Index i = j + 1; i < a.n; ++i) sum = fma_(L(i, j), a.z[i], sum);
      a.f[j] = sum * L(j, j);
    });
    s.for_each_cone(block, [&](auto shape, Index, Index row) {
      for (Index i = row; i < row + decltype(shape)::kRows; ++i) {
        double known = a.f[i];
        for (Index j = 0; j < i; ++j) known = fma_(L(j, i), a.f[j], known);
        const double motion = static_cast<double>(s.y[i]) - static_cast<double>(s.b[i]);
        a.skew[i] = fma_(own_penalty(shape, rho), a.z[i], fma_(motion, a.scale[i], 0.0 - known));
      }
    });
  }

  /// The largest eigenvalue of K, from below: a few steps of the power method from a start that is the same for all.
  template <Block B>
  static STICTION_HD_OUTLINE double largest_eigenvalue(B& block, const AdmmState& a) {
    constexpr int kSteps = 8;
    const DenseMatrix& K = a.factor;
    const auto length = [&](const double* v) {
      return sqrt_(sum_leaves<double>(block, [&](Index leaf) {
        double sum = 0.0;
        for (Index i = leaf; i < a.n; i += kReduceLeaves) sum = fma_(v[i], v[i], sum);
        return sum;
      }));
    };
    for_each(block, a.n, [&](Index i) { a.v[i] = 1.0 + 0.125 * static_cast<double>((i * 5) % 7); });
    double largest = 0.0;
    double known = length(a.v);
    for (int step = 0; step < kSteps; ++step) {
      const double inverse = known > 0.0 ? div_(1.0, known) : 0.0;
      for_each(block, a.n, [&](Index i) {
        double sum = 0.0;
        for (Index j = 0; j < a.n; ++j) sum = fma_(K(j, i), a.v[j], sum);
        a.f[i] = sum * inverse;
      });
      for_each(block, a.n, [&](Index i) { a.v[i] = a.f[i]; });
      known = length(a.v);
      largest = max_(known, largest);
    }
    return largest > 0.0 ? largest : 1.0;
  }

  template <Block B, class System>
  static STICTION_HD_OUTLINE void factorise(B& block, const System& s, const AdmmState& a) {
    constexpr double kFloor = 0x1p-48;
    const double rho = penalty(s);
    s.for_each_cone(block, [&](auto shape, Index, Index row) {
      for (int k = 0; k < decltype(shape)::kRows; ++k)
        a.factor(row + k, row + k) = a.factor(row + k, row + k) + own_penalty(shape, rho);
    });
    factor_ldl(block, a.factor, kFloor * rho);
  }

  /// z of one cone from its g, and x.
  template <class System, class Shape>
  static STICTION_HD void project(System& s, const AdmmState& a, Shape shape, Index cone, Index row) {
    using Real = typename System::Real;
    constexpr int kRows = Shape::kRows;
    double z[kRows];
    double still[kRows];
    for (int k = 0; k < kRows; ++k) {
      z[k] = a.g[row + k];
      still[k] = 0.0;
    }
    double lo = 0.0;
    double hi = 0.0;
    if constexpr (Shape::kKind == ConeKind::box) {
      lo = div_(static_cast<double>(s.lo[cone]), a.scale[row]);
      hi = div_(static_cast<double>(s.hi[cone]), a.scale[row]);
    }
    proximal_point<Law::convex>(shape, z, still, 0.0, lo, hi);
    for (int k = 0; k < kRows; ++k) {
      a.z[row + k] = z[k];
      Real x = static_cast<Real>(z[k] * a.scale[row + k]);
      if constexpr (Shape::kKind == ConeKind::box) x = clamp_(x, s.lo[cone], s.hi[cone]);
      s.x[row + k] = x;
    }
  }

  template <Block B, class System>
  static STICTION_HD_OUTLINE void forget(B& block, System& s) {
    using Real = typename System::Real;
    single(block, [&] {
      s.scalar[kHistory] = Real(-1);
      s.scalar[kProgress] = static_cast<Real>(__builtin_huge_valf());
    });
  }

  /// g to the next iterate: accelerated, unless the last guess made the plain step longer; then to where a plain step
  /// from the iterate before would have led.
  template <Block B, class System>
  static STICTION_HD_OUTLINE void move(B& block, System& s, const AdmmState& a) {
    using Real = typename System::Real;
    const double square = sum_leaves<double>(block, [&](Index leaf) {
      double sum = 0.0;
      for (Index i = leaf; i < a.n; i += kReduceLeaves) sum = fma_(a.f[i], a.f[i], sum);
      return sum;
    });
    const double length = sqrt_(square);
    const Index known = static_cast<Index>(s.scalar[kHistory]);
    // Not "longer than": a guess that led to NaN is taken back as well.
    const bool is_accepted = length <= kGrowth * static_cast<double>(s.scalar[kProgress]);
    block.sync();
    if (!is_accepted) {
      for_each(block, a.n, [&](Index i) { a.g[i] = a.image_before[i]; });
      forget(block, s);
      return;
    }
    if (known >= 0) {
      const Index slot = known % kAndersonMemory;
      for_each(block, a.n, [&](Index i) {
        a.change_of_f(slot)[i] = a.f[i] - a.f_before[i];
        a.change_of_image(slot)[i] = (a.g[i] + a.f[i]) - a.image_before[i];
      });
    }
    const Index count = known + 1 < kAndersonMemory ? known + 1 : kAndersonMemory;
    const AndersonWeights weights = anderson(block, a.n, a.f, count, [&](Index j) { return a.change_of_f(j); });
    for_each(block, a.n, [&](Index i) {
      const double image = a.g[i] + a.f[i];
      double next = image;
      for (Index j = 0; j < count; ++j) next = fma_(0.0 - weights.gamma[j], a.change_of_image(j)[i], next);
      a.f_before[i] = a.f[i];
      a.image_before[i] = image;
      a.g[i] = next;
    });
    single(block, [&] {
      s.scalar[kHistory] = static_cast<Real>(known + 1 < 2 * kAndersonMemory ? known + 1 : known + 1 - kAndersonMemory);
      s.scalar[kProgress] = static_cast<Real>(length);
      if (length == 0.0) s.scalar[kOutcome] = Real(kFinished);
    });
  }

  /// A rung up or down the ladder where one residual outweighs the other, and a new factor.
  template <Block B, class System>
  static STICTION_HD_OUTLINE void balance(B& block, System& s, const AdmmState& a, double primal, double dual) {
    using Real = typename System::Real;
    const Index at = static_cast<Index>(s.scalar[kRung]);
    const Index switches = static_cast<Index>(s.scalar[kSwitches]);
    const double before = penalty(s);
    Index next = at;
    if (primal > kImbalance * dual && at > 0) next = at - 1;
    if (dual > kImbalance * primal && at + 1 < kRungs) next = at + 1;
    if (next == at || switches >= kMostSwitches) return;
    block.sync();
    single(block, [&] {
      s.scalar[kRung] = static_cast<Real>(next);
      s.scalar[kSwitches] = static_cast<Real>(switches + 1);
    });
    const double ratio = div_(before, penalty(s));
    for_each(block, a.n, [&](Index i) { a.g[i] = fma_(a.g[i] - a.z[i], ratio, a.z[i]); });
    fill_scaled(block, s, a);
    factorise(block, s, a);
    forget(block, s);
  }
};

}  // namespace stiction::inline STICTION_ISA
