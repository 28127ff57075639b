#pragma once

#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "stiction/batch.hpp"

/// Decides if a reaction is a solution, by the law itself in extended precision. lambda is in its cone, motion in the
/// dual cone, one orthogonal to the other. Shares no formula with the natural map.
namespace stiction::test {

/// Each is the largest over all cones, relative to the size of the compared numbers.
struct Certificate {
  long double primal = 0;           ///< by how much lambda leaves its cone       / largest reaction
  long double dual = 0;             ///< by how much the motion leaves its cone   / largest |b|
  long double complementarity = 0;  ///< products that should be zero           / largest reaction * largest |b|

  [[nodiscard]] long double worst() const { return std::max(primal, std::max(dual, complementarity)); }
};

inline Certificate certify(const Environment<double>& env, Law law, std::span<const double> lambda) {
  using Number = long double;
  const std::size_t n = env.b.size();
  std::vector<Number> w(n);
  Number reaction = std::numeric_limits<Number>::min();
  Number motion = std::numeric_limits<Number>::min();
  for (std::size_t i = 0; i < n; ++i) {
    w[i] = env.b[i];
    for (auto k = static_cast<std::size_t>(env.row_offsets[i]); k < static_cast<std::size_t>(env.row_offsets[i + 1]);
         ++k)
      w[i] += static_cast<Number>(env.A[k]) * static_cast<Number>(lambda[static_cast<std::size_t>(env.column[k])]);
    if (!env.R.empty()) w[i] += static_cast<Number>(env.R[i]) * static_cast<Number>(lambda[i]);
    reaction = std::max(reaction, std::abs(static_cast<Number>(lambda[i])));
    motion = std::max(motion, std::abs(static_cast<Number>(env.b[i])));
  }
  Certificate worst;
  const auto leaves_cone = [&](Number by) { worst.primal = std::max(worst.primal, by / reaction); };
  const auto moves = [&](Number by) { worst.dual = std::max(worst.dual, by / motion); };
  const auto product = [&](Number of) {
    worst.complementarity = std::max(worst.complementarity, std::abs(of) / (reaction * motion));
  };
  std::size_t row = 0;
  for (const auto& cone : env.cones) {
    const Number x = lambda[row];
    if (cone.kind == ConeKind::free) moves(std::abs(w[row]));
    if (cone.kind == ConeKind::unilateral) {
      leaves_cone(-x);
      moves(-w[row]);
      product(x * w[row]);
    }
    if (cone.kind == ConeKind::box) {
      const Number lo = env.lo[row], hi = env.hi[row];
      leaves_cone(lo - x);
      leaves_cone(x - hi);
      // Positive motion needs the lower bound under it, negative motion the upper one above.
      if (std::isinf(env.lo[row])) {
        moves(w[row]);
      } else {
        product(std::max(w[row], Number(0)) * (x - lo));
      }
      if (std::isinf(env.hi[row])) {
        moves(-w[row]);
      } else {
        product(std::max(-w[row], Number(0)) * (hi - x));
      }
    }
    const auto m = static_cast<std::size_t>(cone.row_count);
    if (cone.kind == ConeKind::friction) {
      Number radius = 0, sliding = 0, power = 0;
      for (std::size_t k = 1; k < m; ++k) {
        const Number mu = env.mu.empty() ? 0 : env.mu[row + k];
        if (mu > 0) radius = std::hypot(radius, static_cast<Number>(lambda[row + k]) / mu);
        if (mu == 0) leaves_cone(std::abs(static_cast<Number>(lambda[row + k])));
        sliding = std::hypot(sliding, mu * w[row + k]);
        power += static_cast<Number>(lambda[row + k]) * w[row + k];
      }
      const Number normal = w[row] + (law == Law::coulomb ? sliding : Number(0));
      leaves_cone(radius - x);
      moves(sliding - normal);
      product(x * normal + power);
    }
    row += m;
  }
  return worst;
}

}  // namespace stiction::test
