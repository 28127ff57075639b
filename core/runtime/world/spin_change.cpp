#include "core/runtime/world/spin_change.hpp"

#include <cmath>
#include <cstddef>

namespace stiction {

namespace {

using Three = std::array<double, 3>;
using Four = std::array<double, 4>;

Three cross(const Three& a, const Three& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
double dot(const Three& a, const Three& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
/// a + s b
Three plus(const Three& a, double s, const Three& b) {
  return {a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]};
}

/// (1, step spin / 2) q, of unit length.
Four turned(const Four& q, const Three& spin, double step) {
  const Three h = plus({0, 0, 0}, 0.5 * step, spin), v{q[1], q[2], q[3]};
  const Three turn = plus(plus(v, q[0], h), 1.0, cross(h, v));
  const double w = q[0] - dot(h, v), norm = std::sqrt(w * w + dot(turn, turn));
  return {w / norm, turn[0] / norm, turn[1] / norm, turn[2] / norm};
}
/// Change of turned()'s turn by a change of the spin: a rotation vector in world axes.
Three turn_change(const Three& spin, const Three& change, double step) {
  const Three a = plus({0, 0, 0}, 0.5 * step, spin), d = plus({0, 0, 0}, 0.5 * step, change);
  return plus({0, 0, 0}, 2.0 / (1.0 + dot(a, a)), plus(d, 1.0, cross(a, d)));
}

/// A diagonal matrix along a body's axes times a vector of the world.
Three stretched(const Four& q, const Three& diagonal, const Three& x) {
  const auto [w, a, b, c] = q;
  const std::array<Three, 3> axes{Three{1 - 2 * (b * b + c * c), 2 * (a * b + w * c), 2 * (a * c - w * b)},
                                  Three{2 * (a * b - w * c), 1 - 2 * (a * a + c * c), 2 * (b * c + w * a)},
                                  Three{2 * (a * c + w * b), 2 * (b * c - w * a), 1 - 2 * (a * a + b * b)}};
  Three sum{0, 0, 0};
  for (std::size_t k = 0; k < 3; ++k) sum = plus(sum, diagonal[k] * dot(axes[k], x), axes[k]);
  return sum;
}

/// The spin of a momentum, and how it changes with the momentum and a turn of the axes.
struct Spin {
  Three value, change;
};
Spin spin_of(const Four& q, const Three& inverse, const Three& momentum, const Three& momentum_change,
             const Three& turn) {
  const Three value = stretched(q, inverse, momentum);
  const Three within = plus(momentum_change, -1.0, cross(turn, momentum));
  return {value, plus(cross(turn, value), 1.0, stretched(q, inverse, within))};
}

}  // namespace

std::array<double, 9> spin_change(const Four& orientation, const Three& inertia, const Three& spin, double step) {
  const Three inverse{1 / inertia[0], 1 / inertia[1], 1 / inertia[2]};
  const Three momentum = stretched(orientation, inertia, spin);
  std::array<double, 9> derivative{};
  for (std::size_t k = 0; k < 3; ++k) {
    Three unit{0, 0, 0};
    unit[k] = 1.0;
    const Three momentum_change = stretched(orientation, inertia, unit);
    const Spin half_way = spin_of(turned(orientation, spin, 0.5 * step), inverse, momentum, momentum_change,
                                  turn_change(spin, unit, 0.5 * step));
    const Spin after = spin_of(turned(orientation, half_way.value, step), inverse, momentum, momentum_change,
                               turn_change(half_way.value, half_way.change, step));
    for (std::size_t i = 0; i < 3; ++i) derivative[3 * i + k] = after.change[i];
  }
  return derivative;
}

}  // namespace stiction
