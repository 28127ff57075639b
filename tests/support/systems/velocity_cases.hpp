#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "tests/support/systems/jacobian_systems.hpp"

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

struct BodiesRecipe {
  std::uint64_t seed = 1;
  std::size_t bodies = 20;
  std::size_t points = 3;    ///< friction cones of three rows between bodies that touch
  std::size_t branch = 0;    ///< every so many bodies touch one of all before them; 0: each touches the one before
  double compliance = 0.01;  ///< R is one to three times this, the same along a cone once scaled by mu^2
};

/// Bodies of six degrees of freedom, each of which touches one before it. M is in one matrix.
inline JacobianEnvironment<double> bodies_in_contact(const BodiesRecipe& recipe) {
  scenes::Rng rng(recipe.seed);
  const std::size_t dofs = 6 * recipe.bodies;
  JacobianEnvironment<double> env;
  env.M.assign(dofs * dofs, 0.0);
  for (std::size_t body = 0; body < recipe.bodies; ++body) {
    double root[6][6];
    for (auto& row : root)
      for (double& entry : row) entry = rng.symmetric(0.3);
    for (std::size_t i = 0; i < 6; ++i)
      for (std::size_t j = 0; j < 6; ++j) {
        double sum = i == j ? 0.5 : 0.0;
        for (std::size_t k = 0; k < 6; ++k) sum += root[i][k] * root[j][k];
        env.M[(6 * body + i) * dofs + 6 * body + j] = sum;
      }
    for (int k = 0; k < 6; ++k) env.v_free.push_back(rng.symmetric(1.0));
    const bool jumps = recipe.branch > 0 && body % recipe.branch == 0;
    const auto any = static_cast<std::size_t>(rng.uniform(0.0, 0.999) * static_cast<double>(body));
    const std::size_t other = body == 0 ? 0 : jumps ? any : body - 1;
    for (std::size_t point = 0; point < recipe.points; ++point) {
      const double R = recipe.compliance * rng.uniform(1.0, 3.0), mu = rng.uniform(0.2, 1.0);
      env.cones.push_back(friction(3));
      for (int row = 0; row < 3; ++row) {
        env.mu.push_back(row > 0 ? mu : 0.0);
        env.R.push_back(row > 0 ? R / (mu * mu) : R);
        env.target.push_back(rng.symmetric(0.1));
        std::vector<double> J(dofs, 0.0);
        for (const std::size_t of : {body, other})
          for (std::size_t k = 0; k < 6; ++k) J[6 * of + k] = rng.symmetric(1.0);
        env.J.insert(env.J.end(), J.begin(), J.end());
      }
    }
  }
  env.lo = env.hi = std::vector<double>(env.R.size(), 0.0);
  return env;
}

/// Environments beside one another as one, and where each one's degrees of freedom and rows are in it.
struct Together {
  JacobianEnvironment<double> env;
  std::vector<std::vector<std::size_t>> dofs, rows;
};

/// `interleaved`: degrees of freedom and cones take turns, else each one's follow one another. Dense J and M.
inline Together together(const std::vector<JacobianEnvironment<double>>& parts, bool interleaved) {
  Together all;
  const std::size_t count = parts.size();
  all.dofs.resize(count);
  all.rows.resize(count);
  // Pairs (part, number in it) in the order of the whole.
  const auto order = [&](const auto& size_of) {
    std::vector<std::pair<std::size_t, std::size_t>> pairs;
    for (std::size_t p = 0; p < count; ++p)
      for (std::size_t k = 0; k < size_of(parts[p]); ++k) pairs.emplace_back(p, k);
    if (interleaved)
      std::stable_sort(pairs.begin(), pairs.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
    return pairs;
  };
  std::size_t dofs = 0;
  for (const auto& [p, k] : order([](const auto& part) { return part.v_free.size(); })) {
    all.dofs[p].push_back(dofs++);
    all.env.v_free.push_back(parts[p].v_free[k]);
  }
  all.env.M.assign(dofs * dofs, 0.0);
  for (std::size_t p = 0; p < count; ++p) {
    const std::vector<std::size_t>& at = all.dofs[p];
    for (std::size_t i = 0; i < at.size(); ++i)
      for (std::size_t j = 0; j < at.size(); ++j) all.env.M[at[i] * dofs + at[j]] = parts[p].M[i * at.size() + j];
  }
  for (const auto& [p, cone] : order([](const auto& part) { return part.cones.size(); })) {
    const JacobianEnvironment<double>& part = parts[p];
    all.env.cones.push_back(part.cones[cone]);
    for (Index k = 0; k < part.cones[cone].row_count; ++k) {
      const std::size_t row = all.rows[p].size(), own = all.dofs[p].size();
      all.rows[p].push_back(all.env.R.size());
      for (const auto& [to, from] :
           {std::pair{&all.env.target, &part.target}, std::pair{&all.env.R, &part.R}, std::pair{&all.env.mu, &part.mu},
            std::pair{&all.env.lo, &part.lo}, std::pair{&all.env.hi, &part.hi}})
        to->push_back((*from)[row]);
      std::vector<double> J(dofs, 0.0);
      for (std::size_t c = 0; c < own; ++c) J[all.dofs[p][c]] = part.J[row * own + c];
      all.env.J.insert(all.env.J.end(), J.begin(), J.end());
    }
  }
  return all;
}

/// Degrees of freedom in the opposite order, links before their parents. M's Cholesky factor then has no entries but
/// between a link and its ancestors. Dense J and M.
inline JacobianEnvironment<double> reversed(JacobianEnvironment<double> env) {
  const auto dofs = static_cast<std::ptrdiff_t>(env.v_free.size());
  std::reverse(env.M.begin(), env.M.end());
  std::reverse(env.v_free.begin(), env.v_free.end());
  for (auto row = env.J.begin(); row != env.J.end(); row += dofs) std::reverse(row, row + dofs);
  return env;
}

/// The factor of M in the place of M, block by block. Above the diagonal are numbers that must not be read.
inline JacobianEnvironment<double> with_factor(JacobianEnvironment<double> env, Index mass_block = 0) {
  const std::size_t dofs = env.v_free.size(), block = mass_block == 0 ? dofs : static_cast<std::size_t>(mass_block);
  for (std::size_t first = 0; first < dofs; first += block) {
    double* const L = env.M.data() + first * block;
    for (std::size_t i = 0; i < block; ++i)
      for (std::size_t j = 0; j < block; ++j) {
        double sum = L[i * block + j];
        for (std::size_t k = 0; k < j && j <= i; ++k) sum -= L[i * block + k] * L[j * block + k];
        L[i * block + j] = j > i    ? std::numeric_limits<double>::quiet_NaN()
                           : i == j ? std::sqrt(sum)
                                    : sum / L[j * block + j];
      }
  }
  return env;
}

/// The environment in the form that a batch has M in.
inline JacobianEnvironment<double> in_form(const JacobianEnvironment<double>& env, MassForm form,
                                           Index mass_block = 0) {
  return form == MassForm::factor ? with_factor(env, mass_block) : env;
}

/// Keeps the numbers of J that are not zero, in stored entries.
inline void store_nonzeros(JacobianEnvironment<double>& env) {
  const std::size_t dofs = env.v_free.size();
  std::vector<double> values;
  env.row_offsets = {0};
  for (std::size_t i = 0; i < env.J.size(); ++i) {
    if (env.J[i] != 0.0) {
      env.column.push_back(static_cast<Index>(i % dofs));
      values.push_back(env.J[i]);
    }
    if (i % dofs == dofs - 1) env.row_offsets.push_back(static_cast<Index>(values.size()));
  }
  env.J = values;
}

}  // namespace stiction::test
