#pragma once

#include "stiction/world.hpp"

/// A world as plain data: what crosses into code compiled for an instruction set or a device.
namespace stiction {

/// Contact points of one pair of shapes, at most, and numbers that tell them apart from step to step.
inline constexpr Index kManifoldPoints = 4;
inline constexpr Index kFeatures = 64;

/// A shape in a body's axes.
template <class Real>
struct WorldShapeData {
  Index body;
  ShapeKind kind;
  Real size[3];
  Real position[3];
  Real axes[9];  ///< columns: the shape's axes
  Real bound;    ///< radius about the shape's centre that holds it; of a plane 0
  Real reach;    ///< radius about the body's centre of mass that holds it
};

template <class Real>
struct WorldBodyData {
  Real inv_mass;
  Real inertia[3], inv_inertia[3];
  double mass;
  bool isotropic;  ///< all three moments equal
};

/// Two shapes that may touch; body_a < body_b.
template <class Real>
struct WorldPair {
  Index shape_a, shape_b, body_a, body_b;
  Real mu, restitution;
};

template <class Real>
struct WorldModelView {
  Index bodies, shapes, pairs;
  const WorldBodyData<Real>* body;
  const WorldShapeData<Real>* shape;
  const WorldPair<Real>* pair;
  Real gravity[3];
  Real step, margin;
};

/// A contact as it was found.
template <class Real>
struct FoundContact {
  Index pair, feature;
  Real arm_a[3], arm_b[3], normal[3];
  Real depth;
};

/// One step of one world. Arrays of bodies have the shapes of BodyBatchView.
template <class Real>
struct WorldJob {
  WorldModelView<Real> model;
  Real *position, *orientation, *twist;  ///< state
  const Real* wrench;
  Real *inv_inertia, *twist_change;  ///< of the solve
  const Real* solved_twist;
  const EnvStatus* status;
};

/// Contacts of a step in the arrays of a BodyBatchView, and their impulses.
template <class Real>
struct WorldContacts {
  const Offset* offsets;  ///< (env_count + 1)
  Index *body_a, *body_b;
  Real *arm_a, *arm_b, *normal, *mu, *depth, *restitution;
  std::uint64_t* id;
  Real* guess;    ///< what the impulse is looked for from
  Real* impulse;  ///< what it ended with
};

/// Where the contacts of a step go, and what is remembered of the step before.
template <class Real>
struct ContactSink {
  WorldContacts<Real> now;
  WorldContacts<Real> last;  ///< offsets null: nothing is remembered
  Real keep;                 ///< share of an impulse that is handed on
};

}  // namespace stiction
