#pragma once

#include "core/algorithm/articulated/convex/nearest_on_simplex.hpp"

/// Distance of two convex shapes: Gilbert, Johnson and Keerthi 1988.
namespace stiction::inline STICTION_ISA {

template <class T>
struct ConvexRounding {
  static constexpr bool kIsDouble = sizeof(T) == sizeof(double);
  static constexpr T kTouching = kIsDouble ? T(1e-9) : T(1e-5);    ///< a distance without a direction, over the extent
  static constexpr T kConverged = kIsDouble ? T(1e-15) : T(1e-7);  ///< of the square of a distance
  static constexpr T kDepth = kIsDouble ? T(1e-11) : T(1e-6);      ///< of a depth, over the extent
  static constexpr T kSeen = kIsDouble ? T(1e-15) : T(1e-7);       ///< of a height, likewise
};

enum class Encounter : std::uint8_t { apart, near, overlapping };

/// Searches for the nearest points, and leaves the simplex that they lie in. Shapes farther than `most` are apart.
template <class T>
STICTION_HD_OUTLINE Encounter separate(ConvexPair<T>& pair, T most, Closest<T>& found) {
  constexpr Index kMostRounds = 64;
  Simplex<T>& simplex = found.between;
  Vector3<T> x = subtract(pair.a.centre, pair.b.centre);
  T square = dot(x, x);
  const T touching = ConvexRounding<T>::kTouching * pair.extent;
  if (!(square > touching * touching)) x = {T(1), T(0), T(0)};
  square = dot(x, x);
  bool is_first = true, are_parted = false;
  for (Index round = 0; round < kMostRounds; ++round) {
    const DifferencePoint<T> point = pair.support(scaled(T(-1), x));
    const T along_x = dot(x, point.place());
    if (along_x > T(0) && along_x * along_x > most * most * square) return Encounter::apart;
    if (!is_first &&
        (square - along_x <= ConvexRounding<T>::kConverged * square || has_point(simplex.at, simplex.count, point)))
      break;
    const Simplex<T> before = simplex;
    simplex.at[simplex.count] = point;
    simplex.weight[simplex.count++] = T(1);
    const bool is_inside = !keep_nearest(simplex);
    // Rounding may put the origin into a flat simplex, though a plane parts the shapes.
    are_parted = are_parted || (along_x > T(0) && along_x * along_x > touching * touching * square);
    if (is_inside && !are_parted) return Encounter::overlapping;
    simplex.mix(found.a, found.b);
    const Vector3<T> nearer = subtract(found.a, found.b);
    const T less = dot(nearer, nearer);
    if (!is_inside && !(less > touching * touching)) return Encounter::overlapping;
    if (is_inside || (!is_first && !(less < square))) {  // by rounding
      simplex = before;
      simplex.mix(found.a, found.b);
      break;
    }
    x = nearer;
    square = less;
    is_first = false;
  }
  found.distance = sqrt_(square);
  const T scale = div_(T(-1), found.distance);
  found.normal = scaled(scale, x);
  return Encounter::near;
}

}  // namespace stiction::inline STICTION_ISA
