#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "core/algorithm/load/load_system.hpp"
#include "scenes/rng.hpp"

/// One friction cone without an environment around it, as a system that the step of a cone can read. Coulomb's law is
/// judged in long double.
namespace stiction::test {

template <class RealType, int M>
struct OneCone {
  using Real = RealType;
  std::array<std::array<Real, M>, M> B{};
  std::array<Real, M> start{};
  std::array<Real, 1> normal_step{}, tangential_step{};
  Strided<Real, 1> x{start.data()};
  Strided<Real, 1> inv_n{normal_step.data()};
  Strided<Real, 1> inv_t{tangential_step.data()};

  OneCone() = default;
  OneCone(const OneCone&) = delete;
  OneCone& operator=(const OneCone&) = delete;

  [[nodiscard]] Real block_entry(Index, int i, int j) const {
    return B[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
  }
  /// Sets a cone's steps as load_system.hpp does.
  void set_steps() {
    const Real whole = largest_eigenvalue_bound<M, 0>(*this, 0);
    const Real tangential = max_(largest_eigenvalue_bound<M, 1>(*this, 0), whole * Real(kSmallestTangential));
    normal_step[0] = div_(Real(1), B[0][0]);
    tangential_step[0] = div_(Real(1), tangential);
  }
};

/// Recipe of a random block.
struct ConeRecipe {
  double mu = 1;        ///< largest
  double spread = 1;    ///< largest over smallest mu
  double coupling = 0;  ///< 0: independent rows, towards 1: tangential rows like the normal one
  int rank = 8;
};

/// B = S J J' S and motion q, q_n < 0, as wide apart as contacts are.
template <int M>
void fill(OneCone<double, M>& cone, std::array<double, M>& q, const ConeRecipe& recipe, scenes::Rng& rng) {
  double J[M][8], mu[M];
  for (int i = 0; i < M; ++i) {
    mu[i] = i == 0 ? 1 : recipe.mu * std::pow(recipe.spread, -rng.uniform());
    for (int k = 0; k < 8; ++k) {
      const double own = k < recipe.rank ? rng.symmetric(1.0) : 0.0;
      J[i][k] = i == 0 ? own : (1 - recipe.coupling) * own + recipe.coupling * J[0][k];
    }
    q[static_cast<std::size_t>(i)] = mu[i] * rng.symmetric(1.0) * std::pow(10.0, rng.symmetric(3.0));
  }
  q[0] = -std::abs(q[0]);
  for (std::size_t i = 0; i < M; ++i)
    for (std::size_t j = 0; j < M; ++j) {
      cone.B[i][j] = 0;
      for (int k = 0; k < 8; ++k) cone.B[i][j] += mu[i] * J[i][k] * J[j][k] * mu[j];
    }
  cone.set_steps();
}

/// Distance of x from Coulomb's law on B x + q, relative to the largest of the numbers it is made of.
template <int M>
double law_violation(const OneCone<double, M>& cone, const std::array<double, M>& q, const double (&x)[M]) {
  long double w[M], pull = 0, speed = 0, along = 0, scale = 0;
  for (std::size_t i = 0; i < M; ++i) {
    w[i] = q[i];
    scale = std::max(scale, std::abs(w[i]));
    for (std::size_t j = 0; j < M; ++j) {
      const long double term = static_cast<long double>(cone.B[i][j]) * x[j];
      w[i] += term;
      scale = std::max(scale, std::abs(term));
    }
    if (i > 0) {
      pull += static_cast<long double>(x[i]) * x[i];
      speed += w[i] * w[i];
      along += x[i] * w[i];
    }
  }
  pull = std::sqrt(pull);
  speed = std::sqrt(speed);
  const long double stiffness = cone.B[0][0];
  // Feasible; w_n >= 0 and nothing carried where it is positive; where it slides, at the bound and opposed.
  const long double outside = std::max(pull - x[0], 0.0L) * stiffness;
  const long double inward = std::max(-w[0], 0.0L);
  const long double carried = std::min(x[0] * stiffness, std::abs(w[0]));
  const long double friction = x[0] > 0 ? (x[0] * speed + along) / x[0] : 0.0L;
  return static_cast<double>(std::max({outside, inward, carried, friction}) / scale);
}

}  // namespace stiction::test
