#pragma once

#include <cmath>
#include <vector>

#include "tests/support/jacobian_systems.hpp"

/// Environments for Newton's method in velocities: chains of links with cones of every kind.
namespace stiction::test {

struct ChainRecipe {
  std::uint64_t seed = 1;
  Index dofs = 12;
  std::vector<Cone> cones = {friction(3), unilateral(), friction(3)};
  double lowest = 0.0;       ///< share of the links, from the root on, that no cone is at
  double compliance = 0.01;  ///< R is one to three times this, the same along a cone once scaled by mu^2
};

/// A tree of links, each of which hangs on one before it: M has a link's ancestors in its row, J those of one link.
inline JacobianEnvironment<double> random_chain(const ChainRecipe& recipe) {
  scenes::Rng rng(recipe.seed);
  const auto dofs = static_cast<std::size_t>(recipe.dofs);
  std::vector<std::size_t> parent(dofs, 0);
  for (std::size_t k = 1; k < dofs; ++k)
    parent[k] = k % 5 == 0 ? static_cast<std::size_t>(rng.uniform(0.0, 0.999) * static_cast<double>(k)) : k - 1;
  const auto for_each_ancestor = [&](std::size_t k, const auto& f) {
    for (f(k); k != 0; f(k)) k = parent[k];
  };
  JacobianEnvironment<double> env;
  env.M.assign(dofs * dofs, 0.0);
  for (std::size_t link = 0; link < dofs; ++link) {
    std::vector<double> root(dofs, 0.0);
    for_each_ancestor(link, [&](std::size_t k) { root[k] = rng.symmetric(1.0); });
    root[link] += 1.5;
    for (std::size_t i = 0; i < dofs; ++i)
      for (std::size_t j = 0; j < dofs; ++j) env.M[i * dofs + j] += root[i] * root[j];
  }
  for (std::size_t k = 0; k < dofs; ++k) env.v_free.push_back(rng.symmetric(1.0));
  for (const Cone& cone : recipe.cones) {
    const auto link = static_cast<std::size_t>(rng.uniform(recipe.lowest, 0.999) * static_cast<double>(dofs));
    const double R = recipe.compliance * rng.uniform(1.0, 3.0), mu = rng.uniform(0.2, 1.0);
    env.cones.push_back(cone);
    for (Index row = 0; row < cone.row_count; ++row) {
      const double own = row > 2 ? 0.1 * mu : mu;
      const bool tangential = cone.kind == ConeKind::friction && row > 0;
      env.mu.push_back(tangential ? own : 0.0);
      env.R.push_back(tangential ? R / (own * own) : R);
      env.target.push_back(rng.symmetric(0.1));
      env.lo.push_back(cone.kind == ConeKind::box ? -rng.uniform(0.0, 0.2) : 0.0);
      env.hi.push_back(cone.kind == ConeKind::box ? rng.uniform(0.0, 0.2) : 0.0);
      std::vector<double> J(dofs, 0.0);
      for_each_ancestor(link, [&](std::size_t k) { J[k] = rng.symmetric(1.0); });
      env.J.insert(env.J.end(), J.begin(), J.end());
    }
  }
  return env;
}

/// Cones of every kind and size.
inline std::vector<Cone> cones_of_every_kind() {
  return {friction(3), free_row(), friction(6), box(), friction(2), unilateral(), friction(4), friction(5), box()};
}

}  // namespace stiction::test
