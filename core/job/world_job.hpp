#pragma once

#include <limits>

#include "stiction/world.hpp"

/// A world as plain data, which crosses into code compiled for an instruction set or a device.
namespace stiction {

/// Contact points of one pair of shapes, at most, and numbers that identify them from step to step.
inline constexpr Index kManifoldPoints = 4;
inline constexpr Index kFeatures = 64;

/// Most pairs of an environment that a step looks closer at, so that its contacts can be counted.
inline constexpr Offset kMostNearPairs = std::numeric_limits<Index>::max() / kManifoldPoints;

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
  double mu, restitution;
};

template <class Real>
struct WorldBodyData {
  Real inv_mass;
  Real inertia[3], inv_inertia[3];
  double mass;
  bool isotropic;  ///< all three moments equal
};

/// Shapes of one body, and how many pairs have a body before it as their lower one.
struct BodyShapes {
  Index begin, end;
  Offset pairs_before;
};

/// Two shapes that may touch; body_a < body_b.
struct ShapePair {
  Index shape_a, shape_b, body_a, body_b;
};

/// Common parts of two shapes' contacts.
template <class Real>
struct WorldPair {
  ShapePair shapes;
  Real mu, restitution;
};

/// Shapes are in order of their bodies, the world's first. The numbers of pairs, in order of bodies and shapes, hence
/// follow from the shapes (shape_pairs.hpp).
template <class Real>
struct WorldModelView {
  Index bodies, shapes;
  bool by_tree;  ///< pairs are not listed: a tree finds those that are near
  Index pairs;   ///< how many are listed
  const WorldBodyData<Real>* body;
  const WorldShapeData<Real>* shape;
  const BodyShapes* shapes_of;  ///< of the world and of each body       (bodies + 1)
  const WorldPair<Real>* pair;  ///< by number                           (pairs)
  Real gravity[3];
  Real step, margin;
  Real cells_per_length;  ///< of the grid that the tree is sorted by [1/m]
};

/// A contact as it was found.
template <class Real>
struct FoundContact {
  Offset pair;
  Index feature;
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
  Real* guess;    ///< start of the impulse
  Real* impulse;  ///< final impulse
};

/// Destination of a step's contacts, and memory of the step before.
template <class Real>
struct ContactSink {
  WorldContacts<Real> now;
  WorldContacts<Real> last;  ///< offsets null: nothing is remembered
  Real keep;                 ///< share of an impulse that is handed on
};

}  // namespace stiction
