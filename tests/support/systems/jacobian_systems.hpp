#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "scenes/rng.hpp"
#include "stiction/jacobian.hpp"
#include "tests/support/systems/small_systems.hpp"

/// Contact systems in Jacobian form, and their algebra done the plain way: Gauss-Jordan, no factor, no triangle.
namespace stiction::test {

struct JacobianRecipe {
  std::uint64_t seed = 1;
  int contacts = 3;  ///< friction cones of 3 rows
  int others = 2;    ///< unilateral rows
  Index dofs = 7;
  Index mass_block = 0;
  double compliance = 0.01;  ///< R is one to five times this
};

/// Random rows on random bodies. M = B B' + 1/2 I in each block.
inline JacobianEnvironment<double> random_jacobian(const JacobianRecipe& recipe) {
  scenes::Rng rng(recipe.seed);
  JacobianEnvironment<double> env;
  for (int c = 0; c < recipe.contacts + recipe.others; ++c) {
    const bool contact = c % 2 == 0 ? c / 2 < recipe.contacts : c / 2 >= recipe.others;
    env.cones.push_back(contact ? friction(3) : unilateral());
    for (Index k = 0; k < env.cones.back().row_count; ++k) {
      env.mu.push_back(contact && k > 0 ? rng.uniform(0.2, 1.0) : 0.0);
      env.R.push_back(recipe.compliance * rng.uniform(1.0, 5.0));
      env.target.push_back(rng.symmetric(0.1));
    }
  }
  const auto dofs = static_cast<std::size_t>(recipe.dofs);
  for (std::size_t i = 0; i < env.mu.size() * dofs; ++i) env.J.push_back(rng.symmetric(1.0));
  for (std::size_t k = 0; k < dofs; ++k) env.v_free.push_back(rng.symmetric(1.0));
  const std::size_t block = recipe.mass_block == 0 ? dofs : static_cast<std::size_t>(recipe.mass_block);
  for (std::size_t first = 0; first < dofs; first += block) {
    std::vector<double> root(block * block);
    for (double& entry : root) entry = rng.symmetric(1.0);
    for (std::size_t i = 0; i < block; ++i)
      for (std::size_t j = 0; j < block; ++j) {
        double sum = i == j ? 0.5 : 0.0;
        for (std::size_t k = 0; k < block; ++k) sum += root[i * block + k] * root[j * block + k];
        env.M.push_back(sum);
      }
  }
  return env;
}

/// M as a square matrix.
inline std::vector<double> full_mass(const JacobianEnvironment<double>& env, Index mass_block) {
  const std::size_t dofs = env.v_free.size();
  const std::size_t block = mass_block == 0 ? dofs : static_cast<std::size_t>(mass_block);
  std::vector<double> M(dofs * dofs, 0.0);
  for (std::size_t i = 0; i < dofs; ++i)
    for (std::size_t j = 0; j < block; ++j) M[i * dofs + i / block * block + j] = env.M[i * block + j];
  return M;
}

/// M^-1 times the columns of `right` (n x width), by elimination with pivots.
inline std::vector<double> solve_columns(std::vector<double> M, std::vector<double> right, std::size_t n) {
  const std::size_t width = n == 0 ? 0 : right.size() / n;
  for (std::size_t k = 0; k < n; ++k) {
    std::size_t best = k;
    for (std::size_t i = k; i < n; ++i)
      if (std::abs(M[i * n + k]) > std::abs(M[best * n + k])) best = i;
    for (std::size_t j = 0; j < n; ++j) std::swap(M[k * n + j], M[best * n + j]);
    for (std::size_t j = 0; j < width; ++j) std::swap(right[k * width + j], right[best * width + j]);
    for (std::size_t i = 0; i < n; ++i) {
      if (i == k) continue;
      const double factor = M[i * n + k] / M[k * n + k];
      for (std::size_t j = 0; j < n; ++j) M[i * n + j] -= factor * M[k * n + j];
      for (std::size_t j = 0; j < width; ++j) right[i * width + j] -= factor * right[k * width + j];
    }
  }
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < width; ++j) right[i * width + j] /= M[i * n + i];
  return right;
}

/// J M^-1 J' and J v_free - target by their definitions, and M^-1 J' for velocities  (dofs x n).
struct JacobianOracle {
  std::vector<double> A, b, response;

  JacobianOracle(const JacobianEnvironment<double>& env, Index mass_block) {
    const std::size_t n = env.mu.size(), dofs = env.v_free.size();
    std::vector<double> transposed(dofs * n);
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t k = 0; k < dofs; ++k) transposed[k * n + i] = env.J[i * dofs + k];
    response = solve_columns(full_mass(env, mass_block), transposed, dofs);
    A.resize(n * n);
    for (std::size_t i = 0; i < n; ++i) {
      double motion = 0.0;
      for (std::size_t k = 0; k < dofs; ++k) {
        motion += env.J[i * dofs + k] * env.v_free[k];
        for (std::size_t j = 0; j < n; ++j) A[i * n + j] += env.J[i * dofs + k] * response[k * n + j];
      }
      b.push_back(motion - (env.target.empty() ? 0.0 : env.target[i]));
    }
  }
};

inline double largest_difference(std::span<const double> a, std::span<const double> b) {
  double largest = a.size() == b.size() ? 0.0 : std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < a.size() && i < b.size(); ++i) {
    const double difference = std::abs(a[i] - b[i]);
    if (!(difference <= largest)) largest = difference;
  }
  return largest;
}

}  // namespace stiction::test
