#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "scenes/scenes.hpp"

namespace stiction::scenes {

/// Dense row-major matrix; the scenes' sparse results are checked densely, by another method.
struct Dense {
  std::size_t rows = 0, cols = 0;
  std::vector<double> value;
  Dense(std::size_t r, std::size_t c) : rows(r), cols(c), value(r * c, 0.0) {}
  double& operator()(std::size_t i, std::size_t j) { return value[i * cols + j]; }
  double operator()(std::size_t i, std::size_t j) const { return value[i * cols + j]; }
};

template <class Pointers, class Columns>
Dense densify(const Pointers& ptr, const Columns& col, const std::vector<double>& val, std::size_t cols) {
  Dense dense(ptr.size() - 1, cols);
  for (std::size_t i = 0; i + 1 < ptr.size(); ++i) {
    for (auto k = static_cast<std::size_t>(ptr[i]); k < static_cast<std::size_t>(ptr[i + 1]); ++k) {
      dense(i, static_cast<std::size_t>(col[k])) += val[k];
    }
  }
  return dense;
}

inline std::size_t rows_of(const SceneEnv& env) {
  return env.system.b.size();
}
inline Dense dense_A(const SceneEnv& env) {
  return densify(env.system.row_offsets, env.system.column, env.system.A, rows_of(env));
}
inline Dense dense_J(const SceneEnv& env) {
  return densify(env.J.ptr, env.J.col, env.J.val, static_cast<std::size_t>(env.dof_count));
}
inline Dense dense_M(const SceneEnv& env) {
  return densify(env.M.ptr, env.M.col, env.M.val, static_cast<std::size_t>(env.dof_count));
}

/// X with M X = B by Gaussian elimination with partial pivoting.
inline Dense gauss_solve(Dense m, Dense b) {
  const std::size_t n = m.rows;
  for (std::size_t k = 0; k < n; ++k) {
    std::size_t pivot = k;
    for (std::size_t i = k + 1; i < n; ++i) {
      if (std::abs(m(i, k)) > std::abs(m(pivot, k))) pivot = i;
    }
    for (std::size_t j = 0; j < n; ++j) std::swap(m(k, j), m(pivot, j));
    for (std::size_t j = 0; j < b.cols; ++j) std::swap(b(k, j), b(pivot, j));
    for (std::size_t i = 0; i < n; ++i) {
      if (i == k || m(i, k) == 0) continue;
      const double factor = m(i, k) / m(k, k);
      for (std::size_t j = k; j < n; ++j) m(i, j) -= factor * m(k, j);
      for (std::size_t j = 0; j < b.cols; ++j) b(i, j) -= factor * b(k, j);
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < b.cols; ++j) b(i, j) /= m(i, i);
  }
  return b;
}

/// The smallest pivot of the Cholesky factorisation of A scaled to a unit diagonal, plus shift; positive exactly
/// when the shifted matrix is positive definite.
inline double smallest_pivot(Dense a, double shift) {
  const std::size_t n = a.rows;
  std::vector<double> scale(n);
  for (std::size_t i = 0; i < n; ++i) scale[i] = 1 / std::sqrt(a(i, i));
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) a(i, j) *= scale[i] * scale[j];
    a(i, i) += shift;
  }
  double smallest = 1;
  for (std::size_t k = 0; k < n; ++k) {
    smallest = std::min(smallest, a(k, k));
    if (!(a(k, k) > 0)) return a(k, k);
    for (std::size_t i = k + 1; i < n; ++i) {
      const double factor = a(i, k) / a(k, k);
      for (std::size_t j = k + 1; j < n; ++j) a(i, j) -= factor * a(k, j);
    }
  }
  return smallest;
}

inline std::size_t contact_count(const SceneEnv& env) {
  return static_cast<std::size_t>(std::count_if(env.system.cones.begin(), env.system.cones.end(),
                                                [](const auto& cone) { return cone.kind == ConeKind::friction; }));
}

}  // namespace stiction::scenes
