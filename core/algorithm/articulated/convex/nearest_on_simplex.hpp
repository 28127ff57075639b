#pragma once

#include "core/algorithm/articulated/convex/convex_shape.hpp"

/// The point of a segment, a triangle or a tetrahedron that is nearest to the origin.
namespace stiction::inline STICTION_ISA {

/// Weights of the corners, 0 of those that do not matter, and the square of the distance.
template <class T>
struct NearestOfSimplex {
  T weight[4];
  T square;
};

/// Corners of a simplex, looked at a few at a time.
template <class T>
struct SimplexCorners {
  static constexpr T kFlat = sizeof(T) == sizeof(double) ? T(1e-26) : T(1e-11);  // of the square of a sine
  Vector3<T> at[4];

  [[nodiscard]] STICTION_HD NearestOfSimplex<T> of_segment(Index i, Index j) const {
    const Vector3<T> d = subtract(at[j], at[i]);
    const T square = dot(d, d);
    const T share = square > T(0) ? clamp_(div_(-dot(at[i], d), square), T(0), T(1)) : T(0);
    const Vector3<T> nearest = add_scaled(at[i], share, d);
    NearestOfSimplex<T> found{{T(0), T(0), T(0), T(0)}, dot(nearest, nearest)};
    found.weight[i] = T(1) - share;
    found.weight[j] = share;
    return found;
  }

  [[nodiscard]] STICTION_HD NearestOfSimplex<T> of_triangle(Index i, Index j, Index k) const {
    const Vector3<T> u = subtract(at[j], at[i]), v = subtract(at[k], at[i]), n = cross(u, v);
    const T square = dot(n, n);
    if (square > kFlat * (dot(u, u) * dot(v, v))) {
      const T of_i = dot(n, cross(at[j], at[k])), of_j = dot(n, cross(at[k], at[i]));
      const T of_k = square - (of_i + of_j);
      if (of_i > T(0) && of_j > T(0) && of_k > T(0)) {
        const T height = dot(n, at[i]);
        NearestOfSimplex<T> found{{T(0), T(0), T(0), T(0)}, div_(height * height, square)};
        found.weight[i] = div_(of_i, square);
        found.weight[j] = div_(of_j, square);
        found.weight[k] = div_(of_k, square);
        return found;
      }
    }
    NearestOfSimplex<T> best = of_segment(i, j);
    take_nearer(best, of_segment(j, k));
    take_nearer(best, of_segment(k, i));
    return best;
  }

  /// Returns false if the origin is inside.
  STICTION_HD bool of_tetrahedron(NearestOfSimplex<T>& best) const {
    bool is_outside = false;
    for (Index k = 0; k < 4; ++k) {
      const Index i = (k + 1) % 4, j = (k + 2) % 4, l = (k + 3) % 4;
      const Vector3<T> n = cross(subtract(at[j], at[i]), subtract(at[l], at[i]));
      const T inner = dot(n, subtract(at[k], at[i])), own = -dot(n, at[i]);
      if ((inner > T(0) && own > T(0)) || (inner < T(0) && own < T(0))) continue;
      const NearestOfSimplex<T> found = of_triangle(i, j, l);
      if (!is_outside) best = found;
      take_nearer(best, found);
      is_outside = true;
    }
    return is_outside;
  }

 private:
  static STICTION_HD void take_nearer(NearestOfSimplex<T>& best, const NearestOfSimplex<T>& other) {
    if (other.square < best.square) best = other;
  }
};

/// Leaves of a simplex the corners around its point that is nearest to the origin. Returns false if that is the origin.
template <class T>
STICTION_HD_OUTLINE bool keep_nearest(Simplex<T>& simplex) {
  SimplexCorners<T> corners;
  for (Index k = 0; k < simplex.count; ++k) corners.at[k] = simplex.at[k].place();
  NearestOfSimplex<T> nearest{{T(1), T(0), T(0), T(0)}, T(0)};
  if (simplex.count == 2) nearest = corners.of_segment(0, 1);
  if (simplex.count == 3) nearest = corners.of_triangle(0, 1, 2);
  if (simplex.count == 4 && !corners.of_tetrahedron(nearest)) return false;
  Index kept = 0;
  for (Index k = 0; k < simplex.count; ++k) {
    if (!(nearest.weight[k] > T(0))) continue;
    simplex.at[kept] = simplex.at[k];
    simplex.weight[kept++] = nearest.weight[k];
  }
  simplex.count = kept;
  return true;
}

}  // namespace stiction::inline STICTION_ISA
