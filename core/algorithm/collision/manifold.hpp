#pragma once

#include "core/algorithm/collision/pose.hpp"
#include "core/job/world_job.hpp"

namespace stiction::inline STICTION_ISA {

/// A shape where it is.
template <class T>
struct PlacedShape {
  ShapeKind kind;
  Vector3<T> centre;
  Axes3<T> axes;
  T size[3];
};

/// One point of contact, halfway between the two surfaces.
template <class T>
struct ContactCandidate {
  Vector3<T> point;
  Vector3<T> normal;  ///< unit, from the pair's first shape to its second
  T depth;            ///< negative: a gap
  Index feature;      ///< in [0, kFeatures), unique in a pair, the same while the same parts touch
};

/// The contact points of a pair, features ascending.
template <class T>
struct Manifold {
  ContactCandidate<T> at[kManifoldPoints];
  Index count = 0;

  /// Keeps a point that is no farther than `margin`.
  STICTION_HD void add(const ContactCandidate<T>& candidate, T margin) {
    if (candidate.depth >= -margin) at[count++] = candidate;
  }
  /// Turns the contacts into those seen from the other shape.
  STICTION_HD void swap_sides() {
    for (Index k = 0; k < count; ++k) at[k].normal = scaled(T(-1), at[k].normal);
  }
};

/// Ends of a round shape's segment are centre - h and centre + h; of a sphere both are its centre.
template <class T>
STICTION_HD Vector3<T> half_segment(const PlacedShape<T>& shape) {
  return scaled(shape.kind == ShapeKind::capsule ? shape.size[1] : T(0), shape.axes.z);
}

/// Entry k of a vector.
template <class T>
STICTION_HD T entry(const Vector3<T>& a, Index k) {
  return k == 0 ? a.x : (k == 1 ? a.y : a.z);
}
template <class T>
STICTION_HD Vector3<T> axis(const Axes3<T>& axes, Index k) {
  return k == 0 ? axes.x : (k == 1 ? axes.y : axes.z);
}
template <class T>
STICTION_HD T sign_of(T x) {
  return x < T(0) ? T(-1) : T(1);
}

}  // namespace stiction::inline STICTION_ISA
