#pragma once

#include <array>
#include <cmath>

#include "scenes/rng.hpp"

namespace stiction::scenes {

/// Vectors and rotations with the order of every sum written out. Only sqrt of <cmath> is used: it is correctly
/// rounded everywhere, sin and cos are not.
struct Vec3 {
  double x = 0, y = 0, z = 0;
};

inline Vec3 operator+(Vec3 a, Vec3 b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline Vec3 operator-(Vec3 a, Vec3 b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Vec3 operator*(double s, Vec3 a) {
  return {s * a.x, s * a.y, s * a.z};
}
inline double dot(Vec3 a, Vec3 b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline Vec3 cross(Vec3 a, Vec3 b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double norm(Vec3 a) {
  return std::sqrt(dot(a, a));
}
inline Vec3 normalized(Vec3 a) {
  return (1.0 / norm(a)) * a;
}

/// 3 x 3 matrix by columns.
struct Mat3 {
  Vec3 x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
};

inline Vec3 operator*(const Mat3& m, Vec3 v) {
  return v.x * m.x + v.y * m.y + v.z * m.z;
}
inline Mat3 operator*(const Mat3& a, const Mat3& b) {
  return {a * b.x, a * b.y, a * b.z};
}
inline Mat3 transposed(const Mat3& m) {
  return {{m.x.x, m.y.x, m.z.x}, {m.x.y, m.y.y, m.z.y}, {m.x.z, m.y.z, m.z.z}};
}

struct SinCos {
  double sin, cos;
};

/// Sine and cosine of an angle in [-pi, pi] [rad]: Taylor series of the half angle (error below 1e-14), then
/// doubling. Additions and multiplications only, so the same bits everywhere.
inline SinCos sin_cos(double angle) {
  const double h = 0.5 * angle;
  const double h2 = h * h;
  double s = 1, c = 1;
  for (int k = 12; k >= 1; --k) {
    s = 1 - s * h2 / static_cast<double>(2 * k * (2 * k + 1));
    c = 1 - c * h2 / static_cast<double>(2 * k * (2 * k - 1));
  }
  s *= h;
  return {2 * s * c, 1 - 2 * s * s};
}

inline Mat3 rotation_x(double angle) {
  const auto [s, c] = sin_cos(angle);
  return {{1, 0, 0}, {0, c, s}, {0, -s, c}};
}
inline Mat3 rotation_y(double angle) {
  const auto [s, c] = sin_cos(angle);
  return {{c, 0, -s}, {0, 1, 0}, {s, 0, c}};
}
inline Mat3 rotation_z(double angle) {
  const auto [s, c] = sin_cos(angle);
  return {{c, s, 0}, {-s, c, 0}, {0, 0, 1}};
}

/// Rotation of the quaternion (w, v), which need not be a unit one.
inline Mat3 rotation_of(double w, Vec3 v) {
  const double scale = 2.0 / (w * w + dot(v, v));
  const double xx = scale * v.x * v.x, yy = scale * v.y * v.y, zz = scale * v.z * v.z;
  const double xy = scale * v.x * v.y, xz = scale * v.x * v.z, yz = scale * v.y * v.z;
  const double wx = scale * w * v.x, wy = scale * w * v.y, wz = scale * w * v.z;
  return {{1 - (yy + zz), xy + wz, xz - wy}, {xy - wz, 1 - (xx + zz), yz + wx}, {xz + wy, yz - wx, 1 - (xx + yy)}};
}

/// Each coordinate uniform in (-half, half).
inline Vec3 random_vector(Rng& rng, double half) {
  const double x = rng.symmetric(half);
  const double y = rng.symmetric(half);
  return {x, y, rng.symmetric(half)};
}

/// Uniformly distributed rotation: a point of the unit 4-ball, by rejection.
inline Mat3 random_rotation(Rng& rng) {
  while (true) {
    const double w = rng.symmetric(1);
    const Vec3 v = random_vector(rng, 1);
    const double length2 = w * w + dot(v, v);
    if (length2 <= 1 && length2 > 1e-3) return rotation_of(w, v);
  }
}

/// Two unit vectors that complete the unit vector n to a right-handed frame (n, first, second).
inline std::array<Vec3, 2> tangents_of(Vec3 n) {
  const double ax = n.x * n.x, ay = n.y * n.y, az = n.z * n.z;
  Vec3 axis{0, 0, 1};
  if (ax <= ay && ax <= az) {
    axis = {1, 0, 0};
  } else if (ay <= az) {
    axis = {0, 1, 0};
  }
  const Vec3 first = normalized(cross(axis, n));
  return {first, cross(n, first)};
}

/// Inertia about the centre, in world axes, of a solid with the given principal moments [kg m^2].
inline Mat3 world_inertia(const Mat3& rotation, Vec3 principal) {
  const Mat3 scaled{principal.x * rotation.x, principal.y * rotation.y, principal.z * rotation.z};
  Mat3 world = scaled * transposed(rotation);
  // Rounding leaves the two triangles a last bit apart; a mass matrix is symmetric.
  world.x.y = world.y.x;
  world.x.z = world.z.x;
  world.y.z = world.z.y;
  return world;
}

inline Vec3 box_inertia(double mass, Vec3 half) {
  const double xx = half.x * half.x, yy = half.y * half.y, zz = half.z * half.z;
  return (mass / 3) * Vec3{yy + zz, xx + zz, xx + yy};
}

inline Vec3 sphere_inertia(double mass, double radius) {
  const double i = 0.4 * mass * radius * radius;
  return {i, i, i};
}

/// Slender cylinder along the unit vector `axis`, about its centre, in world axes.
inline Mat3 rod_inertia(double mass, double length, double radius, Vec3 axis) {
  const double along = 0.5 * mass * radius * radius;
  const double across = mass * (3 * radius * radius + length * length) / 12;
  const double d = along - across;
  return {{across + d * axis.x * axis.x, d * axis.x * axis.y, d * axis.x * axis.z},
          {d * axis.x * axis.y, across + d * axis.y * axis.y, d * axis.y * axis.z},
          {d * axis.x * axis.z, d * axis.y * axis.z, across + d * axis.z * axis.z}};
}

}  // namespace stiction::scenes
