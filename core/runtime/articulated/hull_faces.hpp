#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/base/extents.hpp"
#include "core/job/articulated_job.hpp"

/// Hulls of meshes as kernels read them. Choices that depend on the hull alone are made here.
namespace stiction {

using HullPoint = std::array<double, 3>;

inline HullPoint between(const HullPoint& a, const HullPoint& b) {
  return {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
}
inline HullPoint across(const HullPoint& a, const HullPoint& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline double length_of(const HullPoint& v) {
  return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/// The corners of a face, in turn from one of its vertices on. Four stand for a face of more. They are those that
/// MuJoCo 4.0 takes: each in turn goes on around the face while their area grows.
inline std::vector<Index> standing_corners(const ArticulatedHull& hull, std::size_t face, std::size_t from) {
  const auto begin = at(hull.face_begin[face]), count = at(hull.face_begin[face + 1]) - begin;
  const auto corner = [&](std::size_t k) { return hull.corners[begin + (from + k) % count]; };
  const auto place = [&](std::size_t k) { return hull.vertices[at(corner(k))]; };
  std::size_t b = 1, c = 2, d = 3;
  if (count > 4) {
    const auto area = [&](std::size_t two, std::size_t three, std::size_t four) {
      return length_of(across(between(place(0), place(three)), between(place(two), place(four))));
    };
    while (d + 1 < count && area(b, c, d + 1) > area(b, c, d)) {
      ++d;
      while (c + 1 < d && area(b, c + 1, d) > area(b, c, d)) ++c;
      while (b + 1 < c && area(b + 1, c, d) > area(b, c, d)) ++b;
    }
  }
  std::vector<Index> found{corner(0), corner(b), corner(c)};
  if (count > 3) found.push_back(corner(d));
  return found;
}

/// Twice the area of a face, along its normal. Any three corners may lie on a line.
inline HullPoint area_of(const ArticulatedHull& hull, std::size_t face) {
  const auto begin = at(hull.face_begin[face]), count = at(hull.face_begin[face + 1]) - begin;
  const auto from_first = [&](std::size_t k) {
    return between(hull.vertices[at(hull.corners[begin])], hull.vertices[at(hull.corners[begin + k])]);
  };
  HullPoint sum{};
  for (std::size_t k = 1; k + 1 < count; ++k) {
    const HullPoint part = across(from_first(k), from_first(k + 1));
    for (std::size_t i = 0; i < 3; ++i) sum[i] += part[i];
  }
  return sum;
}

inline Index most_corners(const ArticulatedHull& hull) {
  Index most = 0;
  for (std::size_t face = 0; face + 1 < hull.face_begin.size(); ++face) {
    const Index count = hull.face_begin[face + 1] - hull.face_begin[face];
    if (count > most) most = count;
  }
  return most;
}

/// Returns true if each vertex is a corner of a face.
inline bool has_faces_everywhere(const ArticulatedHull& hull) {
  std::vector<bool> has(hull.vertices.size());
  for (const Index corner : hull.corners) has[at(corner)] = true;
  return std::find(has.begin(), has.end(), false) == has.end();
}

inline double along(const HullPoint& a, const HullPoint& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// The unit normal of a face, away from the middle of its hull.
inline HullPoint outward_normal(const ArticulatedHull& hull, std::size_t face) {
  HullPoint middle{}, normal = area_of(hull, face);
  for (const HullPoint& v : hull.vertices)
    for (std::size_t k = 0; k < 3; ++k) middle[k] += v[k] / static_cast<double>(hull.vertices.size());
  const HullPoint out = between(middle, hull.vertices[at(hull.corners[at(hull.face_begin[face])])]);
  const double length = length_of(normal) * (along(out, normal) < 0 ? -1 : 1);
  for (double& x : normal) x /= length;
  return normal;
}

/// Adds the hull of a geom that is a mesh to those of all geoms.
template <class T>
void add_hull(const ArticulatedDescription& from, const ArticulatedGeom& geom, ArticulatedGeomData<T>& to,
              std::vector<ArticulatedVertexData<T>>& vertices, std::vector<ArticulatedFaceData<T>>& faces,
              std::vector<Index>& corners) {
  to.hull_begin = to.hull_end = static_cast<Index>(vertices.size());
  if (geom.kind != GeomKind::mesh) return;
  const ArticulatedHull& hull = from.hulls[at(geom.hull)];
  std::vector<std::vector<ArticulatedFaceData<T>>> of_vertex(hull.vertices.size());
  for (std::size_t face = 0; face + 1 < hull.face_begin.size(); ++face) {
    const HullPoint normal = outward_normal(hull, face);
    const auto count = at(hull.face_begin[face + 1] - hull.face_begin[face]);
    const auto begin = static_cast<Index>(corners.size());
    const bool turns_back = along(area_of(hull, face), normal) < 0;  // corners turn left about the normal here
    const auto place_of_corner = [&](std::size_t k) { return turns_back ? count - 1 - k : k; };
    for (std::size_t k = 0; k < count; ++k) {
      const std::vector<Index> standing = standing_corners(hull, face, k);
      ArticulatedFaceData<T> own{};
      for (std::size_t i = 0; i < 3; ++i) own.normal[i] = static_cast<T>(normal[i]);
      for (std::size_t i = 1; i < standing.size(); ++i) own.other[own.others++] = to.hull_begin + standing[i];
      own.begin = begin;
      own.end = begin + static_cast<Index>(count);
      own.place = begin + static_cast<Index>(place_of_corner(k));
      of_vertex[at(standing[0])].push_back(own);
    }
    for (std::size_t k = 0; k < count; ++k)
      corners.push_back(to.hull_begin + hull.corners[at(hull.face_begin[face]) + place_of_corner(k)]);
  }
  for (std::size_t v = 0; v < hull.vertices.size(); ++v) {
    ArticulatedVertexData<T> own{};
    for (std::size_t i = 0; i < 3; ++i) own.place[i] = static_cast<T>(hull.vertices[v][i]);
    own.face_begin = static_cast<Index>(faces.size());
    faces.insert(faces.end(), of_vertex[v].begin(), of_vertex[v].end());
    own.face_end = static_cast<Index>(faces.size());
    vertices.push_back(own);
  }
  to.hull_end = static_cast<Index>(vertices.size());
}

}  // namespace stiction
