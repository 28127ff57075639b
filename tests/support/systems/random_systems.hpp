#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "scenes/rng.hpp"
#include "stiction/batch.hpp"

/// Random contact systems that are well posed by construction, for property tests. Everything follows from the seed.
namespace stiction::test {

/// Order of a random system's cones.
enum class ConeOrder {
  shuffled,        ///< kinds in random order, so that canonical order and file order differ
  friction_first,  ///< friction cones, then all others
  friction_last,
};

struct Recipe {
  std::uint64_t seed = 0;
  int contacts = 3;          ///< friction cones of 2 to 6 rows
  int others = 2;            ///< free, unilateral and box rows
  double rank = 1.5;         ///< degrees of freedom per row; below 1 A is singular
  double mass_ratio = 10;    ///< largest over smallest mass
  double compliance = 0.01;  ///< R over the row's diagonal
  double mu_max = 1.0;
  bool unilateral_only = false;
  Index friction_rows = 0;  ///< of every friction cone; 0: 2 to 6, as chance has it
  ConeOrder order = ConeOrder::shuffled;
};

/// One friction cone and nothing else.
inline Recipe lone_contact(std::uint64_t seed) {
  Recipe recipe;
  recipe.seed = seed;
  recipe.contacts = 1;
  recipe.others = 0;
  return recipe;
}

namespace detail {

inline void add_cones(const Recipe& recipe, scenes::Rng& rng, Environment<double>& env) {
  for (int k = 0; k < recipe.contacts + recipe.others; ++k) {
    if (recipe.unilateral_only || k >= recipe.contacts) {
      const int kind = recipe.unilateral_only ? 1 : rng.below(3);
      env.cones.push_back({static_cast<ConeKind>(kind), 1, -1});
    } else {
      const Index rows = recipe.friction_rows > 0 ? recipe.friction_rows : 2 + rng.below(5);
      env.cones.push_back({ConeKind::friction, rows, -1});
    }
  }
  if (recipe.order == ConeOrder::friction_last) std::reverse(env.cones.begin(), env.cones.end());
  if (recipe.order != ConeOrder::shuffled) return;
  for (std::size_t k = env.cones.size(); k > 1; --k)
    std::swap(env.cones[k - 1], env.cones[static_cast<std::size_t>(rng.below(static_cast<int>(k)))]);
}

inline void add_cone_numbers(const Recipe& recipe, scenes::Rng& rng, Environment<double>& env) {
  for (const auto& cone : env.cones) {
    // One axis in eight is frictionless, and axes differ.
    for (Index k = 0; k < cone.row_count; ++k) {
      const double mu = rng.chance(0.125) ? 0.0 : rng.uniform(0.1, 1.0) * recipe.mu_max;
      env.mu.push_back(cone.kind == ConeKind::friction && k > 0 ? mu : 0.0);
      const double bound = rng.uniform(0.05, 1.0);
      const bool open = rng.chance(0.25);
      env.lo.push_back(cone.kind == ConeKind::box ? -bound : 0.0);
      env.hi.push_back(cone.kind == ConeKind::box ? (open ? std::numeric_limits<double>::infinity() : 0.5 * bound)
                                                  : 0.0);
    }
  }
}

}  // namespace detail

/// A = J M^-1 J' and b = J v of random bodies: symmetric positive semidefinite, b in the range of J.
inline Environment<double> random_contacts(const Recipe& recipe) {
  scenes::Rng rng(recipe.seed);
  Environment<double> env;
  detail::add_cones(recipe, rng, env);
  detail::add_cone_numbers(recipe, rng, env);
  const std::size_t n = env.mu.size();
  const std::size_t dofs = std::max<std::size_t>(1, static_cast<std::size_t>(recipe.rank * static_cast<double>(n)));
  std::vector<double> J(n * dofs), inverse_mass(dofs), velocity(dofs);
  for (double& entry : J) entry = rng.symmetric(1.0);
  for (double& entry : inverse_mass) entry = std::pow(recipe.mass_ratio, -rng.uniform());
  for (double& entry : velocity) entry = rng.symmetric(1.0);
  std::vector<double> A(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    double b = 0.0;
    for (std::size_t d = 0; d < dofs; ++d) b += J[i * dofs + d] * velocity[d];
    env.b.push_back(b);
    for (std::size_t j = 0; j <= i; ++j) {
      double sum = 0.0;
      for (std::size_t d = 0; d < dofs; ++d) sum += J[i * dofs + d] * inverse_mass[d] * J[j * dofs + d];
      A[i * n + j] = A[j * n + i] = sum;
    }
    env.R.push_back(recipe.compliance * A[i * n + i]);
  }
  env.set_dense(A, static_cast<Index>(n));
  return env;
}

/// Makes A = Q diag(1 .. condition) Q' with Q a product of random reflections. The condition number is known exactly
/// up to rounding. Uniqueness under the Coulomb law is decided by it (support/oracle.hpp).
inline Environment<double> random_conditioned(const Recipe& recipe, double condition) {
  scenes::Rng rng(recipe.seed);
  Environment<double> env;
  detail::add_cones(recipe, rng, env);
  detail::add_cone_numbers(recipe, rng, env);
  const std::size_t n = env.mu.size();
  std::vector<double> A(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    A[i * n + i] = i == 0 ? 1.0 : i == 1 ? condition : rng.uniform(1.0, condition);
    env.b.push_back(rng.symmetric(1.0));
    env.R.push_back(0.0);
  }
  for (int reflection = 0; reflection < 4; ++reflection) {
    std::vector<double> v(n);
    double length = 0.0;
    for (double& entry : v) {
      entry = rng.symmetric(1.0);
      length += entry * entry;
    }
    // A <- H A H with H = I - 2 v v' / v'v.
    for (int side = 0; side < 2; ++side)
      for (std::size_t i = 0; i < n; ++i) {
        double dot = 0.0;
        for (std::size_t j = 0; j < n; ++j) dot += (side == 0 ? A[i * n + j] : A[j * n + i]) * v[j];
        for (std::size_t j = 0; j < n; ++j) (side == 0 ? A[i * n + j] : A[j * n + i]) -= 2 * dot / length * v[j];
      }
  }
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < i; ++j) A[i * n + j] = A[j * n + i];
  env.set_dense(A, static_cast<Index>(n));
  return env;
}

}  // namespace stiction::test
