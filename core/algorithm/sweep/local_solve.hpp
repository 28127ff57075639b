#pragma once

#include "core/algorithm/problem/cone_projection.hpp"
#include "core/algorithm/problem/cone_shape.hpp"
#include "core/algorithm/problem/law.hpp"
#include "core/algorithm/sweep/uneven_friction.hpp"
#include "core/base/strided.hpp"

/// One cone's step from its current x and motion y, in the solver's coordinates (docs/math/local_solve.md).
namespace stiction::inline STICTION_ISA {

/// Change of one cone's x.
template <class Real, int M>
struct ConeStep {
  Real d[M];
};

/// Friction, exact Coulomb law. The normal row steps alone. Then the tangential rows step on the disk that the fresh
/// normal reaction spans, with their motion corrected for the change of the normal. The fixed point satisfies the
/// Coulomb law itself (w_n complementary to lambda_n, friction opposing sliding), so de Saxce's term does not appear.
template <int M, class System>
STICTION_HD auto coulomb_step(const System& s, Index cone, Index row, const typename System::Real (&y)[M],
                              typename System::Real omega) {
  using Real = typename System::Real;
  ConeStep<Real, M> step;
  const Real x_n = s.x[row];
  const Real fresh = project_half_line(fma_(Real(0) - omega * s.inv_n[cone], y[0], x_n));
  step.d[0] = fresh - x_n;
  const Real gain = Real(0) - omega * s.inv_t[cone];
  Real z[M];
  z[0] = fresh;
  for (int k = 1; k < M; ++k) {
    const Real motion = fma_(s.block_entry(row, k, 0), step.d[0], y[k]);
    z[k] = fma_(gain, motion, s.x[row + k]);
  }
  project_disk<M>(z, fresh);
  for (int k = 1; k < M; ++k) step.d[k] = z[k] - s.x[row + k];
  return step;
}

/// Friction, convex law: a proximal step on the whole cone in a metric of two numbers that bounds its block, repeated
/// on the local problem. Normal-then-tangent would stop at points that are not the minimiser, because the cone couples
/// the two.
template <int M, class System>
STICTION_HD auto convex_step(const System& s, Index cone, Index row, const typename System::Real (&y)[M],
                             typename System::Real omega) {
  using Real = typename System::Real;
  ConeStep<Real, M> step;
  Real motion[M];
  for (int k = 0; k < M; ++k) {
    step.d[k] = Real(0);
    motion[k] = y[k];
  }
  const Real damped = Real(0) - omega * s.damping[cone];
  const Real gain_n = damped * s.inv_n[cone];
  const Real gain_t = damped * s.inv_t[cone];
  for (int pass = 0; pass < kLocalSteps; ++pass) {
    Real z[M];
    for (int k = 0; k < M; ++k) z[k] = fma_(k == 0 ? gain_n : gain_t, motion[k], s.x[row + k] + step.d[k]);
    project_second_order_cone<M>(z, s.share[cone]);
    Real change[M];
    for (int k = 0; k < M; ++k) {
      const Real d = z[k] - s.x[row + k];
      change[k] = d - step.d[k];
      step.d[k] = d;
    }
    if (pass + 1 < kLocalSteps)
      for (int i = 0; i < M; ++i)
        for (int j = 0; j < M; ++j) motion[i] = fma_(s.block_entry(row, i, j), change[j], motion[i]);
  }
  return step;
}

/// True if a form of system can have cones of boxed friction. Bodies and windows of registers have none.
template <class System>
inline constexpr bool kMayHaveBoxFriction =
    requires(const System& s) { s.counts.box_friction; } || requires(const System& s) { s.env->counts.box_friction; };

/// Returns true if a system has some, or in some lane of a pack.
template <class System>
STICTION_HD bool has_box_friction(const System& s) {
  if constexpr (requires { s.counts.box_friction; }) {
    return s.counts.box_friction > 0;
  } else if constexpr (kMayHaveBoxFriction<System>) {
    return s.env->counts.box_friction > 0;
  } else {
    return false;
  }
}

/// Data of its cone that a visit of boxed friction reads.
template <class Real, int M>
struct BoxedCone {
  Real x[M];
  Real y[M];
  Real block[M][M];  ///< A + diag R of its rows, up to the diagonal
  Real gain;         ///< step length of the normal row
  Real largest;      ///< largest of the further rows before omega
  Real omega;
};

/// Boxed friction, row by row (docs/math/box_friction.md). The normal row steps alone. Then each further row steps
/// between the bounds that the fresh normal reaction gives it. Its motion is corrected for the rows before it.
///
/// Kept out of line, so that visits where nothing is boxed stay short, and given numbers alone. A function that is
/// given the system may change it, as far as a device's compiler knows. It would read all addresses anew for every
/// cone.
template <class Real, int M>
STICTION_HD_SHARED ConeStep<Real, M> box_friction_step(BoxedCone<Real, M> cone) {
  ConeStep<Real, M> step;
  const Real fresh = project_half_line(fma_(Real(0) - cone.gain, cone.y[0], cone.x[0]));
  step.d[0] = fresh - cone.x[0];
  for (int k = 1; k < M; ++k) {
    Real moved = cone.y[k];
    for (int j = 0; j < k; ++j) moved = fma_(cone.block[k][j], step.d[j], moved);
    const Real diagonal = cone.block[k][k];
    const Real inverse = div_(Real(1), diagonal);
    const Real gain = select(and_(diagonal > Real(0), inverse < cone.largest), inverse, cone.largest);
    const Real z = fma_(Real(0) - cone.omega * gain, moved, cone.x[k]);
    step.d[k] = clamp_(z, Real(0) - fresh, fresh) - cone.x[k];
  }
  return step;
}

/// Arguments of box_friction_step() for a cone of a system.
template <int M, class System>
STICTION_HD auto boxed_cone(const System& s, Index cone, Index row, const typename System::Real (&y)[M],
                            typename System::Real omega) {
  using Real = typename System::Real;
  // A row that couples to nothing still needs a finite step: it slides to its bound.
  constexpr float kLargestRelative = 0x1p60F;
  BoxedCone<Real, M> read;
  for (int k = 0; k < M; ++k) {
    read.x[k] = s.x[row + k];
    read.y[k] = y[k];
    for (int j = 0; j <= k; ++j) read.block[k][j] = s.block_entry(row, k, j);
  }
  read.gain = omega * s.inv_n[cone];
  read.largest = s.inv_t[cone] * Real(kLargestRelative);
  read.omega = omega;
  return read;
}

/// The step of a cone with friction, that of Usual where no friction is boxed. In a pack both may be needed.
template <class Usual, int M, class System>
STICTION_HD auto step_with_friction(const System& s, Index cone, Index row, const typename System::Real (&y)[M],
                                    typename System::Real omega) {
  using Real = typename System::Real;
  if constexpr (!kMayHaveBoxFriction<System>) {
    return Usual::of(s, cone, row, y, omega);
  } else {
    const bool has_box = has_box_friction(s);
    ConeStep<Real, M> step;
    for (int k = 0; k < M; ++k) step.d[k] = Real(0);
    if (!has_box || any(not_(s.lo[cone] < Real(0)))) step = Usual::of(s, cone, row, y, omega);
    if (has_box) {
      const auto is_boxed = s.lo[cone] < Real(0);
      const ConeStep<Real, M> own = box_friction_step(boxed_cone<M>(s, cone, row, y, omega));
      for (int k = 0; k < M; ++k) step.d[k] = select(is_boxed, own.d[k], step.d[k]);
    }
    return step;
  }
}

/// The steps of friction cones under either law, for step_with_friction().
template <Law kLaw>
struct FrictionConeStep {
  static_assert(kLaw != kLawOfSystem, "sweep_by_law() asks the system");
  template <int M, class System>
  static STICTION_HD auto of(const System& s, Index cone, Index row, const typename System::Real (&y)[M],
                             typename System::Real omega) {
    using Real = typename System::Real;
    ConeStep<Real, M> step = even<M>(s, cone, row, y, omega);
    if constexpr (M > 2) {
      const auto uneven = is_uneven<M>(s, row);
      if (any(uneven)) {
        const UnevenCone<Real, M> read = uneven_cone<M>(s, cone, row, y, omega);
        Real own[M];
        if constexpr (kLaw == Law::coulomb) {
          uneven_coulomb_step(read, own);
        } else {
          uneven_convex_step(read, own);
        }
        for (int k = 0; k < M; ++k) step.d[k] = select(uneven, own[k], step.d[k]);
      }
    }
    return step;
  }

  /// The step of a cone whose axes are alike.
  template <int M, class System>
  static STICTION_HD auto even(const System& s, Index cone, Index row, const typename System::Real (&y)[M],
                               typename System::Real omega) {
    if constexpr (kLaw == Law::coulomb) {
      return coulomb_step<M>(s, cone, row, y, omega);
    } else {
      return convex_step<M>(s, cone, row, y, omega);
    }
  }

  template <int M, class System>
  static STICTION_HD auto uneven_cone(const System& s, Index cone, Index row, const typename System::Real (&y)[M],
                                      typename System::Real omega) {
    using Real = typename System::Real;
    UnevenCone<Real, M> read;
    for (int i = 0; i < M; ++i) {
      read.x[i] = s.x[row + i];
      read.y[i] = y[i];
      for (int j = 0; j < M; ++j) read.block[i][j] = s.block_entry(row, i, j);
    }
    read.inv_n = s.inv_n[cone];
    read.inv_t = s.inv_t[cone];
    read.omega = omega;
    return read;
  }
};

/// z becomes `from` projected where `is_boxed`: the normal onto the half line, then each axis between the bounds that
/// the projected normal gives it.
template <int M, class Real>
STICTION_HD void project_box_friction(Real (&z)[M], const Real (&from)[M], Mask<Real> is_boxed) {
  Real own[M];
  for (int k = 0; k < M; ++k) own[k] = from[k];
  own[0] = project_half_line(own[0]);
  project_box<M>(own, own[0]);
  for (int k = 0; k < M; ++k) z[k] = select(is_boxed, own[k], z[k]);
}

/// proximal_point() of a cone of boxed friction into z, all of whose rows step at once; of other cones z stays.
template <int M, class System, class Real>
STICTION_HD void box_proximal_point(const System& s, Index cone, Index row, Real (&z)[M], const Real (&y)[M],
                                    Real gain) {
  if constexpr (M > 1) {
    if (!has_box_friction(s)) return;
    Real moved[M];
    for (int k = 0; k < M; ++k) moved[k] = fma_(Real(0) - gain, y[k], s.x[row + k]);
    project_box_friction(z, moved, s.lo[cone] < Real(0));
  }
}

/// The step of any cone.
template <Law kLaw, class Shape, class System>
STICTION_HD auto local_step(Shape, const System& s, Index cone, Index row,
                            const typename System::Real (&y)[Shape::kRows], typename System::Real omega) {
  using Real = typename System::Real;
  constexpr int kRows = Shape::kRows;
  if constexpr (Shape::kKind == ConeKind::friction) {
    return step_with_friction<FrictionConeStep<kLaw>, kRows>(s, cone, row, y, omega);
  } else {
    const Real x = s.x[row];
    const Real z = fma_(Real(0) - omega * s.inv_n[cone], y[0], x);
    if constexpr (Shape::kKind == ConeKind::free) {
      return ConeStep<Real, 1>{{z - x}};
    } else if constexpr (Shape::kKind == ConeKind::box) {
      return ConeStep<Real, 1>{{clamp_(z, s.lo[cone], s.hi[cone]) - x}};
    } else {
      return ConeStep<Real, 1>{{project_half_line(z) - x}};
    }
  }
}

/// A proximal step of any cone with one step length: P(x - gain * y), de Saxce's term added to y under the Coulomb law.
/// Methods that move all cones at once call it.
template <class Shape, class Real, int M>
STICTION_HD void proximal_point(Shape, Real (&z)[M], const Real (&y)[M], Real gain, Real lo, Real hi, Law law) {
  Real motion = y[0];
  if constexpr (Shape::kKind == ConeKind::friction)
    if (law == Law::coulomb) motion = motion + tangential_norm<M>(y);
  z[0] = fma_(Real(0) - gain, motion, z[0]);
  if constexpr (Shape::kKind == ConeKind::friction) {
    for (int k = 1; k < M; ++k) z[k] = fma_(Real(0) - gain, y[k], z[k]);
    project_second_order_cone<M>(z);
  } else if constexpr (Shape::kKind == ConeKind::unilateral) {
    z[0] = project_half_line(z[0]);
  } else if constexpr (Shape::kKind == ConeKind::box) {
    z[0] = clamp_(z[0], lo, hi);
  }
}

}  // namespace stiction::inline STICTION_ISA
