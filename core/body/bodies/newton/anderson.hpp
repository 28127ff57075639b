#pragma once

#include "core/body/linear/conjugate_gradient.hpp"

/// Anderson's acceleration of the fixed point in the lagged de Saxce terms, s <- g(s) (Walker and Ni 2011, the
/// unconstrained form): the next s is where differences of the last residuals f = g - s say that f vanishes.
namespace stiction::inline STICTION_ISA {

inline constexpr int kAndersonDepth = 3;

/// Vectors of one number per contact.
struct ShiftHistory {
  Index n = 0;
  double* memory = nullptr;

  static constexpr Offset kDoubles = 2 + 2 * kAndersonDepth;

  [[nodiscard]] STICTION_HD double* last_value() const { return memory; }                         ///< g
  [[nodiscard]] STICTION_HD double* last_residual() const { return memory + n; }                  ///< f
  [[nodiscard]] STICTION_HD double* value_change(int k) const { return memory + (2 + 2 * k) * static_cast<Offset>(n); }
  [[nodiscard]] STICTION_HD double* residual_change(int k) const {
    return memory + (3 + 2 * k) * static_cast<Offset>(n);
  }
};

/// Solves the normal equations of `used` columns in place, by Gaussian elimination of a symmetric matrix; a column that
/// is all but a combination of the ones before gets no weight.
STICTION_HD void solve_weights(int used, double (&G)[kAndersonDepth][kAndersonDepth], double (&w)[kAndersonDepth]) {
  double pivot[kAndersonDepth];
  for (int j = 0; j < used; ++j) {
    const double whole = G[j][j];
    pivot[j] = whole;
    for (int k = 0; k < j; ++k) pivot[j] = fma_(0.0 - (G[j][k] * G[j][k]), pivot[k], pivot[j]);
    const bool is_new = pivot[j] > 1e-10 * whole;
    pivot[j] = is_new ? pivot[j] : 0.0;
    for (int i = j + 1; i < used; ++i) {
      double entry = G[i][j];
      for (int k = 0; k < j; ++k) entry = fma_(0.0 - (G[i][k] * G[j][k]), pivot[k], entry);
      G[i][j] = is_new ? div_(entry, pivot[j]) : 0.0;
    }
  }
  for (int i = 0; i < used; ++i)
    for (int k = 0; k < i; ++k) w[i] = fma_(0.0 - G[i][k], w[k], w[i]);
  for (int i = used - 1; i >= 0; --i) {
    w[i] = pivot[i] > 0.0 ? div_(w[i], pivot[i]) : 0.0;
    for (int k = i + 1; k < used; ++k) w[i] = fma_(0.0 - G[k][i], w[k], w[i]);
  }
}

/// One step from s = now(i) and g(s) = value(i): store(i, the next s), which is not negative. `steps` counts those since
/// the history began.
template <Block B, class Now, class Value, class Store>
STICTION_HD void accelerate_shift(B& block, const ShiftHistory& history, int steps, Now&& now, Value&& value,
                                  Store&& store) {
  const Index n = history.n;
  const int slot = (steps + kAndersonDepth - 1) % kAndersonDepth;
  for_each(block, n, [&](Index i) {
    const double fresh = value(i);
    const double residual = fresh - now(i);
    if (steps > 0) {
      history.value_change(slot)[i] = fresh - history.last_value()[i];
      history.residual_change(slot)[i] = residual - history.last_residual()[i];
    }
    history.last_value()[i] = fresh;
    history.last_residual()[i] = residual;
  });
  const int used = steps < kAndersonDepth ? steps : kAndersonDepth;
  double G[kAndersonDepth][kAndersonDepth] = {};
  double weight[kAndersonDepth] = {};
  for (int i = 0; i < used; ++i) {
    weight[i] = dot_product(block, n, history.residual_change(i), history.last_residual());
    for (int j = 0; j <= i; ++j)
      G[i][j] = dot_product(block, n, history.residual_change(i), history.residual_change(j));
  }
  solve_weights(used, G, weight);
  for_each(block, n, [&](Index i) {
    double next = history.last_value()[i];
    for (int k = 0; k < used; ++k) next = fma_(0.0 - weight[k], history.value_change(k)[i], next);
    store(i, max_(next, 0.0));
  });
}

}  // namespace stiction::inline STICTION_ISA
