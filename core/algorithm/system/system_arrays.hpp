#pragma once

#include "core/base/real.hpp"
#include "core/base/strided.hpp"
#include "core/job/workspace.hpp"
#include "stiction/types.hpp"

namespace stiction::inline STICTION_ISA {

/// Scalars an environment carries from chunk to chunk, kept beside its arrays so that a lane can be loaded and read
/// like any other data.
enum StateScalar : Index {
  kBestResidual = 0,  ///< smallest residual estimate recorded so far [-]
  kLastResidual,      ///< the latest one [-]
  kBestReaction,      ///< largest reaction of that iterate, as the motion that it causes, over the error scale [-]
  kErrorScale,        ///< the largest island's, in the solver's units; 1 where that is zero
  kScaleA,            ///< power of two that A was multiplied by
  kScaleB,            ///< power of two that b was multiplied by
  kOutcome,           ///< Outcome of a method that decides when it ends, and its memory of how
  kMethodScalars,     ///< the first of those that the method names in its own file
  kStateScalars = kMethodScalars + 7
};

/// Progress of a method that decides when it ends; kept in kOutcome.
enum Outcome : int {
  kRunning = 0,
  kFinished,     ///< further iterations change nothing
  kGaveUp,       ///< the same, and there is no answer to be expected
  kRayDetected,  ///< complementary pivoting ended on a ray: it gave up, and sets a flag
};

/// The arrays every form of system has, in the solver's coordinates. Rows of friction cones are multiplied by mu, so
/// that x_t = lambda_t / mu, y_t = mu w_t and each friction cone is the unit cone. A and b are each multiplied by a
/// power of two.
template <class Real, int kStride>
struct SystemArrays {
  Strided<Real, kStride> b;                ///< right-hand side                                   (n)
  Strided<Real, kStride> x;                ///< the iterate                                       (n)
  Strided<Real, kStride> y;                ///< motion (A + R) x + b                              (n)
  Strided<Real, kStride> best;             ///< the iterate with the smallest residual recorded   (n)
  Strided<Real, kStride> extra;            ///< vectors of the method, n apart                    (method * n)
  Strided<Real, kStride> axis_press;       ///< ConeMetric's weights of further rows                 (n)
  Strided<Real, kStride> axis_slip;        ///<                                                      (n)
  Strided<Real, kStride> residual_weight;  ///< mean diagonal of the cone's block before mu: weight of steps (cones)
  Strided<Real, kStride> press;            ///< ConeMetric's a: the first diagonal entry, 0 if not positive  (cones)
  Strided<Real, kStride> island;           ///< the largest island's error scale over that of the cone's own (cones)
  Strided<Real, kStride> shares;           ///< the same by the batch's cones                        (cones)
  Strided<Real, kStride> inv_n;            ///< 1 / first diagonal entry                          (cones)
  Strided<Real, kStride> inv_t;            ///< 1 / bound on the largest eigenvalue of the tangential block (cones)
  Strided<Real, kStride> inv_cone;         ///< 1 / bound on the largest eigenvalue of the block  (cones)
  Strided<Real, kStride> damping;          ///< share of the steps inv_n and inv_t after coupling: BlockMetric  (cones)
  Strided<Real, kStride> share;            ///< of the tangential rows in that metric             (cones)
  Strided<Real, kStride> lo, hi;  ///< bounds of box cones, by cone. With boxed friction -1 and 1: bounds of a further
                                  ///< row for each unit of the normal one. Friction cones have 0 (cones)
  Strided<Real, kStride> scalar;  ///< StateScalar                                       (kStateScalars)
  double* wide = nullptr;         ///< the method's doubles: vectors, then matrices      (Workspace::doubles)
  bool has_matrices = false;      ///< whether it includes matrices, or a method's vectors instead
  Law law = Law::convex;          ///< as its environment's
  bool has_blocks = false;        ///< its cones are swept in blocks, as its environment's

  static constexpr Offset elements(Offset n, Offset cones, const Workspace& workspace) {
    return (6 + workspace.vectors) * n + 11 * cones + kStateScalars + workspace.double_elements<Real>(n);
  }
  /// The method's vector k of doubles; its matrices follow the last.
  [[nodiscard]] STICTION_HD double* wide_vector(Index k, Index n) const { return wide + Offset{k} * n; }

  /// Takes the method's doubles from the beginning of the memory, where it is aligned for them; returns the rest.
  STICTION_HD Real* carve_wide(Real* memory, Offset n, const Workspace& workspace) {
    if (!workspace.is_direct()) return memory;
    wide = reinterpret_cast<double*>(memory);
    has_matrices = workspace.has_matrices(n);
    return memory + workspace.double_elements<Real>(n);
  }
  /// Lays the arrays out one after the other from `memory`; returns the first element behind them.
  STICTION_HD Strided<Real, kStride> carve(Strided<Real, kStride> memory, Offset n, Offset cones,
                                           const Workspace& workspace) {
    const auto take = [&memory](Offset count) {
      const Strided<Real, kStride> part = memory;
      memory = memory.from(count);
      return part;
    };
    b = take(n);
    x = take(n);
    y = take(n);
    best = take(n);
    extra = take(workspace.vectors * n);
    axis_press = take(n);
    axis_slip = take(n);
    residual_weight = take(cones);
    press = take(cones);
    island = take(cones);
    shares = take(cones);
    inv_n = take(cones);
    inv_t = take(cones);
    inv_cone = take(cones);
    damping = take(cones);
    share = take(cones);
    lo = take(cones);
    hi = take(cones);
    scalar = take(kStateScalars);
    return memory;
  }
};

}  // namespace stiction::inline STICTION_ISA
