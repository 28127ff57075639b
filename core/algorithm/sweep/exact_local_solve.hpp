#pragma once

#include "core/algorithm/sweep/local_solve.hpp"
#include "core/algorithm/sweep/symmetric_eigen.hpp"

/// Coulomb's law of one contact solved exactly, its neighbours held fast (docs/math/nsgs.md).
namespace stiction::inline STICTION_ISA {

/// Least eigenvalue of the tangential block, relative to the largest: rounding of the block itself.
template <class Scalar>
inline constexpr Scalar kSmallestEigenvalue = sizeof(Scalar) == 4 ? Scalar(0x1p-20) : Scalar(0x1p-44);

/// One contact's sliding branch as a function of one number. In the coordinates in which the tangential block is
/// diagonal, x_t = -q / (e + sigma) and x_n = stick - c x_t.
template <int N, class Real>
struct Sliding {
  Real q[N];    ///< motion at x_t = 0, in units of x
  Real e[N];    ///< eigenvalues of the tangential block above the smallest, relative to a bound on the largest
  Real c[N];    ///< row n of the block over B_nn
  Real normal;  ///< x_n at x_t = 0; sliding needs it to be positive

  Real slip[N];  ///< x_t at the sigma of the last evaluation
  Real length;   ///< its norm
  Real height;   ///< x_n there
  Real slope;    ///< derivative of gap() there

  /// x_n / norm(x_t) - 1, which is negative before the root and positive behind it.
  STICTION_HD Real gap(Real sigma) {
    Real square(0);
    Real steepness(0);  // -x_t . dx_t / dsigma
    Real fall(0);       // dx_n / dsigma
    height = normal;
    for (int k = 0; k < N; ++k) {
      const Real inverse = div_(Real(1), e[k] + sigma);
      slip[k] = (Real(0) - q[k]) * inverse;
      square = fma_(slip[k], slip[k], square);
      steepness = fma_(slip[k] * slip[k], inverse, steepness);
      height = fma_(Real(0) - c[k], slip[k], height);
      fall = fma_(c[k] * slip[k], inverse, fall);
    }
    length = sqrt_(square);
    const Real rate = div_(Real(1), length);
    slope = fma_(height * rate, steepness * rate * rate, fall * rate);
    return fma_(height, rate, Real(-1));
  }
};

/// Steps to the root of the gap: Newton's where they stay between the bounds and at least halve, else the geometric
/// mean of the bounds. Enough to leave nothing but rounding (docs/math/nsgs.md).
template <class Scalar>
inline constexpr int kRootSteps = sizeof(Scalar) == 4 ? 16 : 24;

/// The sigma in [low, high] with gap(sigma) = 0 as nearly as rounding lets it. From below Newton's steps do not
/// overshoot where normal and tangent do not couple, because 1 / norm(x_t) is concave (More and Sorensen 1983).
template <int N, class Real>
STICTION_HD Real sliding_root(Sliding<N, Real>& slide, Real low, Real high, Real start) {
  Real sigma = start;
  Real best = start;
  Real best_gap = Real(__builtin_huge_valf());
  Real last = high - low;
  for (int step = 0; step < kRootSteps<Scalar<Real>>; ++step) {
    const Real gap = slide.gap(sigma);
    const auto better = abs_(gap) < best_gap;
    best = select(better, sigma, best);
    best_gap = select(better, abs_(gap), best_gap);
    const auto before = gap < Real(0);
    low = select(before, sigma, low);
    high = select(before, high, sigma);
    const Real newton = sigma - div_(gap, slide.slope);
    const Real size = abs_(newton - sigma);
    const auto inside = and_(newton >= low, newton <= high);
    const auto trusted = and_(inside, size <= Real(0.5) * last);
    const Real next = select(trusted, newton, sqrt_(low) * sqrt_(high));
    last = abs_(next - sigma);
    sigma = next;
  }
  return best;
}

/// The sliding reaction into slide.slip and slide.length. With one tangential axis the direction is known. With more,
/// norm(x_t) lies between normal / (1 + c) and normal / (1 - c). sigma lies between its values for the smallest and
/// for the largest eigenvalue. The upper bound has room for a root that is the bound itself, so that rounding does not
/// shut Newton's step out.
template <int N, class Real>
STICTION_HD void sliding_reaction(Sliding<N, Real>& slide, Real smallest, Real largest) {
  if constexpr (N == 1) {
    const Real direction = select(slide.q[0] > Real(0), Real(-1), Real(1));
    slide.length = div_(slide.normal, fma_(slide.c[0], direction, Real(1)));
    slide.slip[0] = direction * slide.length;
  } else {
    Real square(0);
    Real coupling(0);
    for (int k = 0; k < N; ++k) {
      square = fma_(slide.q[k], slide.q[k], square);
      coupling = fma_(slide.c[k], slide.c[k], coupling);
    }
    const Real pull = div_(sqrt_(square), slide.normal);
    coupling = sqrt_(coupling);
    // Not min_: of a minimum with a literal nvcc makes an instruction that the PTX gate refuses.
    const Real wide = pull * fma_(Real(1.0625), coupling, Real(1.0625));
    const Real high = max_(select(Real(0x1p60) < wide, Real(0x1p60), wide), smallest);
    const Real low = fma_(pull, Real(1) - coupling, smallest - largest);
    slide.gap(sliding_root(slide, smallest, high, min_(max_(low, smallest), high)));
  }
}

/// Finds the exact solution of one contact. It is separating if the normal motion without a reaction is not inward.
/// Else it is sticking if the reaction that stops all motion lies in the cone, else sliding. Which reaction it is
/// depends on x through rounding alone. A contact that is at its solution stays there, whatever was raised or
/// symmetrised in its block.
template <int M, class System>
STICTION_HD auto exact_coulomb_step(const System& s, Index cone, Index row, const typename System::Real (&y)[M],
                                    typename System::Real omega) {
  using Real = typename System::Real;
  constexpr int kTangents = M - 1;
  const Real inv_n = s.inv_n[cone];
  const Real inv_t = s.inv_t[cone];
  Sliding<kTangents, Real> slide;

  // The tangential block with the normal row eliminated, relative to inv_t.
  Real S[kTangents][kTangents];
  Real V[kTangents][kTangents];
  for (int i = 0; i < kTangents; ++i)
    for (int j = i; j < kTangents; ++j) {
      const Real direct = s.block_entry(row, 1 + i, 1 + j) + s.block_entry(row, 1 + j, 1 + i);
      const Real through = fma_(s.block_entry(row, 1 + i, 0), s.block_entry(row, 0, 1 + j),
                                s.block_entry(row, 1 + j, 0) * s.block_entry(row, 0, 1 + i));
      S[i][j] = S[j][i] = (Real(0.5) * inv_t) * fma_(Real(0) - through, inv_n, direct);
    }
  symmetric_eigen(S, V, slide.e);
  Real smallest = slide.e[0];
  Real largest = slide.e[0];
  for (int k = 0; k < kTangents; ++k) {
    slide.e[k] = max_(slide.e[k], Real(kSmallestEigenvalue<Scalar<Real>>));
    smallest = min_(slide.e[k], smallest);
    largest = max_(slide.e[k], largest);
  }
  smallest = max_(smallest, Real(kSmallestEigenvalue<Scalar<Real>>));

  // Motion, reaction and coupling in the block's own axes.
  Real x[kTangents];
  Real stick[kTangents];
  Real stick_square(0);
  slide.normal = fma_(Real(0) - inv_n, y[0], s.x[row]);
  for (int k = 0; k < kTangents; ++k) {
    Real motion(0);
    x[k] = slide.c[k] = Real(0);
    for (int i = 0; i < kTangents; ++i) {
      const Real corrected = fma_(Real(0) - s.block_entry(row, 1 + i, 0) * inv_n, y[0], y[1 + i]);
      motion = fma_(V[i][k], corrected, motion);
      x[k] = fma_(V[i][k], s.x[row + 1 + i], x[k]);
      slide.c[k] = fma_(V[i][k], s.block_entry(row, 0, 1 + i) * inv_n, slide.c[k]);
    }
    motion = motion * inv_t;
    slide.q[k] = fma_(Real(0) - slide.e[k], x[k], motion);
    stick[k] = x[k] - div_(motion, slide.e[k]);
    slide.normal = fma_(slide.c[k], x[k], slide.normal);
    stick_square = fma_(stick[k], stick[k], stick_square);
    slide.e[k] = slide.e[k] - smallest;
  }
  Real stick_normal = slide.normal;
  for (int k = 0; k < kTangents; ++k) stick_normal = fma_(Real(0) - slide.c[k], stick[k], stick_normal);

  const auto touches = slide.normal > Real(0);
  const auto sticks = sqrt_(stick_square) <= stick_normal;
  const auto slides = and_(touches, not_(sticks));
  Real normal = select(touches, stick_normal, Real(0));
  Real own[kTangents];
  for (int k = 0; k < kTangents; ++k) own[k] = select(touches, stick[k], Real(0));
  if (any(slides)) {
    sliding_reaction(slide, smallest, largest);
    normal = select(slides, slide.length, normal);
    for (int k = 0; k < kTangents; ++k) own[k] = select(slides, slide.slip[k], own[k]);
  }

  ConeStep<Real, M> step;
  Real z[M];
  step.d[0] = project_half_line(fma_(omega, normal - s.x[row], s.x[row])) - s.x[row];
  z[0] = s.x[row] + step.d[0];
  for (int i = 0; i < kTangents; ++i) {
    Real tangent(0);
    for (int k = 0; k < kTangents; ++k) tangent = fma_(V[i][k], own[k], tangent);
    z[1 + i] = fma_(omega, tangent - s.x[row + 1 + i], s.x[row + 1 + i]);
  }
  project_disk<M>(z, z[0]);
  for (int k = 1; k < M; ++k) step.d[k] = z[k] - s.x[row + k];
  return step;
}

}  // namespace stiction::inline STICTION_ISA
