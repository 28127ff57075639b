#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "scenes/rng.hpp"
#include "stiction/batch.hpp"

/// Random systems with semidefinite cones among others. Everything follows from the seed.
namespace stiction::test {

inline Environment<double>::Cone semidefinite(Index rows) {
  return {ConeKind::semidefinite, rows, -1};
}

/// Recipe of such a system.
struct MatrixRecipe {
  std::uint64_t seed = 0;
  int matrices = 3;    ///< cones of 3 and of 6 rows in turn
  int contacts = 2;    ///< friction cones of 3 rows
  int others = 2;      ///< free, unilateral and box rows in turn
  double shift = 0.3;  ///< addition to the diagonal of G G' / n: the smaller, the harder
};

/// A = G G' / n + shift, with G full of numbers in (-1, 1): symmetric and positive definite. Cones in a shuffled order.
inline Environment<double> random_with_matrices(const MatrixRecipe& recipe) {
  scenes::Rng rng(0x5eed0000 + recipe.seed);
  Environment<double> env;
  for (int k = 0; k < recipe.matrices; ++k) env.cones.push_back(semidefinite(k % 2 == 0 ? 3 : 6));
  for (int k = 0; k < recipe.contacts; ++k) env.cones.push_back({ConeKind::friction, 3, -1});
  for (int k = 0; k < recipe.others; ++k) env.cones.push_back({static_cast<ConeKind>(k % 3), 1, -1});
  for (std::size_t k = env.cones.size(); k > 1; --k)
    std::swap(env.cones[k - 1], env.cones[static_cast<std::size_t>(rng.below(static_cast<int>(k)))]);
  for (const auto& cone : env.cones)
    for (Index k = 0; k < cone.row_count; ++k) {
      env.mu.push_back(cone.kind == ConeKind::friction && k > 0 ? rng.uniform(0.2, 1.0) : 0.0);
      env.lo.push_back(cone.kind == ConeKind::box ? -rng.uniform() : 0.0);
      env.hi.push_back(cone.kind == ConeKind::box ? rng.uniform() : 0.0);
    }
  const std::size_t n = env.mu.size();
  std::vector<double> G(n * n), A(n * n, 0.0);
  for (double& entry : G) entry = rng.symmetric(1.0);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) {
      for (std::size_t k = 0; k < n; ++k) A[i * n + j] += G[i * n + k] * G[j * n + k];
      A[i * n + j] /= static_cast<double>(n);
      if (i == j) A[i * n + j] += recipe.shift;
    }
  for (std::size_t i = 0; i < n; ++i) env.b.push_back(rng.symmetric(2.0));
  env.R.assign(n, 0.01);
  env.set_dense(A, static_cast<Index>(n));
  return env;
}

}  // namespace stiction::test
