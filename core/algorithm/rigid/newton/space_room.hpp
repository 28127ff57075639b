#pragma once

#include "core/algorithm/linear/krylov/bicgstab.hpp"
#include "core/algorithm/rigid/time_stepping.hpp"
#include "core/job/newton_stream.hpp"

/// Memory of Newton's method in body space, in double whatever the batch's precision (docs/math/body_newton.md).
namespace stiction::inline STICTION_ISA {

/// One contact that is solved. Numbers by row are n, t1, t2.
struct SpaceContact {
  Index side_a, side_b;
  Vector3<double> arm_a, arm_b;
  ContactFrame<double> frame;
  double mu;
  double mean;            ///< diagonal of the contact's block of J M^-1 J' + R, on average [1/kg]
  double free[3];         ///< J v_free + bias [w]
  double prox_weight;     ///< weight rho of the proximal term [1/kg]
  double prox_center[3];  ///< its centre [N s]
  double shift;           ///< lagged de Saxce term, on the normal row [w]
  double sliding;         ///< present value of that term: mu norm(w_t) [w]
  double u[3];            ///< J v + bias + shift [w]
  double z[3];            ///< the reaction is its projection [N s]
  double reaction[3];     ///< gamma(u) [N s]
  double along[3];        ///< J d [w]
  double slope;           ///< the contact's part of the line's slope
  double curvature;       ///< and of its curvature
  double stiffness[9];    ///< W = -d gamma / d u in world axes, row by row [kg]
};

/// A body's inverse mass as it is, and a mass matrix that has an inverse.
struct SpaceBody {
  InverseMass<double> inverse;
  double mass;
  Symmetric3<double> inertia;
};

/// Everything of one environment; pointers into its scratch and its stream. Twists are kept as the change that
/// reactions make, p = v - v_free, 6 numbers a body.
struct SpaceWorkspace {
  NewtonStream stream;
  Law law;
  Index contacts, bodies;
  SpaceContact* contact;
  SpaceBody* body;
  double* point;        ///< p                                                              (6 bodies)
  double* step;         ///< d                                                              (6 bodies)
  double* descent;      ///< M^-1 J' gamma - p: minus the gradient as a twist               (6 bodies)
  double* force;        ///< minus the gradient, M (M^-1 J' gamma - p)                      (6 bodies)
  double* positions;    ///< of bodies, from the lowest of their island [m]                 (3 bodies)
  double* gradients;    ///< arrays of the solvers of linear systems                        (kVectors * 6 bodies)
  BlockMatrix H;        ///< M + J'WJ, symmetric
  BlockMatrix sliding;  ///< the same with changes of shifts by velocities, under Coulomb's law; not symmetric
  double* preconditioner;

  static constexpr Offset kContactDoubles = sizeof(SpaceContact) / sizeof(double);
  static constexpr Offset kBodyDoubles = sizeof(SpaceBody) / sizeof(double);
  static_assert(sizeof(SpaceContact) % sizeof(double) == 0 && sizeof(SpaceBody) % sizeof(double) == 0);

  static constexpr Offset kVectors = kGradientVectors > kStabilizedVectors ? kGradientVectors : kStabilizedVectors;

  /// Doubles without the preconditioner's.
  static STICTION_HD constexpr Offset doubles(Offset contacts, Offset bodies, Offset blocks) {
    return contacts * kContactDoubles + bodies * (kBodyDoubles + (4 + kVectors) * kBodyBlock + 3) +
           2 * blocks * kBlockEntries;
  }

  STICTION_HD SpaceWorkspace(Law law_of_friction, Index contact_count, Index body_count, const Index* integers,
                             double* memory)
      : stream(take_newton_stream(integers)), law(law_of_friction), contacts(contact_count), bodies(body_count) {
    const auto take = [&memory](Offset count) {
      double* const part = memory;
      memory += count;
      return part;
    };
    const auto rows = static_cast<Offset>(bodies);
    contact = reinterpret_cast<SpaceContact*>(take(contacts * kContactDoubles));
    body = reinterpret_cast<SpaceBody*>(take(rows * kBodyDoubles));
    point = take(rows * kBodyBlock);
    step = take(rows * kBodyBlock);
    descent = take(rows * kBodyBlock);
    force = take(rows * kBodyBlock);
    positions = take(rows * 3);
    gradients = take(rows * kBodyBlock * kVectors);
    H = {stream.pattern, take(static_cast<Offset>(stream.pattern.blocks()) * kBlockEntries)};
    sliding = {stream.pattern, take(static_cast<Offset>(stream.pattern.blocks()) * kBlockEntries)};
    preconditioner = memory;
  }

  [[nodiscard]] STICTION_HD static Twist<double> twist(const double* twists, Index row) {
    return twist_at<double>(twists + static_cast<Offset>(row) * kBodyBlock);
  }
};

}  // namespace stiction::inline STICTION_ISA
