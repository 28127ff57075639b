#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "tests/support/oracles/oracle.hpp"

/// Boxed friction decided from the law itself, in extended precision and from no header of core/algorithm. All
/// combinations of contact states by enumeration, and a certificate of an answer.
namespace stiction::oracle {

/// Every solution that some combination of states has. Each row of an environment is in one of a few states, and one
/// equation holds for it in each. The solution of the linear system of all rows is checked against the inequalities.
/// Rows of friction are inside their box, or at its upper or lower end. Small systems only: up to 3 states a row.
class BoxFrictionStates {
 public:
  explicit BoxFrictionStates(const Environment<double>& env)
      : env_(env), n_(env.b.size()), a_(detail::dense_matrix(env)) {
    std::size_t row = 0;
    for (const auto& cone : env.cones)
      for (Index k = 0; k < cone.row_count; ++k) {
        kind_.push_back(cone.kind);
        normal_.push_back(row - static_cast<std::size_t>(k));
        ++row;
      }
    state_.assign(n_, kMoves);
    matrix_.assign(n_ * n_, 0);
    right_.assign(n_, 0);
    choose(0);
  }

  std::vector<std::vector<double>> found;  ///< reactions of each solution

 private:
  enum State { kMoves, kLow, kHigh };

  [[nodiscard]] bool rubs(std::size_t i) const { return normal_[i] != i; }

  /// The states that row i may be in. A row of friction of an open contact has no choice.
  [[nodiscard]] std::vector<State> states_of(std::size_t i) const {
    if (rubs(i)) {
      if (state_[normal_[i]] == kLow || env_.mu[i] == 0.0) return {kLow};
      return {kMoves, kLow, kHigh};
    }
    if (kind_[i] == ConeKind::free) return {kMoves};
    if (kind_[i] == ConeKind::box) {
      std::vector<State> states{kMoves};
      if (std::isfinite(env_.lo[i])) states.push_back(kLow);
      if (std::isfinite(env_.hi[i])) states.push_back(kHigh);
      return states;
    }
    return {kMoves, kLow};
  }

  void choose(std::size_t i) {
    if (i == n_) return solve();
    for (const State state : states_of(i)) {
      state_[i] = state;
      choose(i + 1);
    }
  }

  void solve() {
    for (std::size_t i = 0; i < n_; ++i) {
      Number* const line = &matrix_[i * n_];
      std::fill(line, line + n_, Number(0));
      if (state_[i] == kMoves) {
        std::copy(&a_[i * n_], &a_[i * n_] + n_, line);
        right_[i] = -static_cast<Number>(env_.b[i]);
        continue;
      }
      line[i] = 1;
      right_[i] = 0;
      const Number side = state_[i] == kHigh ? 1 : -1;
      if (rubs(i)) line[normal_[i]] -= side * static_cast<Number>(env_.mu[i]);
      if (kind_[i] == ConeKind::box) right_[i] = state_[i] == kHigh ? env_.hi[i] : env_.lo[i];
    }
    const auto x = detail::solve_linear(matrix_, right_);
    if (!x || !holds(*x)) return;
    found.emplace_back(x->begin(), x->end());
  }

  [[nodiscard]] bool holds(const std::vector<Number>& x) const {
    constexpr Number kRounding = 1e-12L;
    for (std::size_t i = 0; i < n_; ++i) {
      Number w = env_.b[i];
      for (std::size_t j = 0; j < n_; ++j) w += a_[i * n_ + j] * x[j];
      const bool coasts = rubs(i) && (env_.mu[i] == 0.0 || state_[normal_[i]] == kLow);
      if (coasts) continue;
      if (state_[i] == kLow && w < -kRounding) return false;
      if (state_[i] == kHigh && w > kRounding) return false;
      if (state_[i] != kMoves || kind_[i] == ConeKind::free) continue;
      Number low = 0, high = static_cast<Number>(HUGE_VALL);
      if (rubs(i)) high = static_cast<Number>(env_.mu[i]) * x[normal_[i]], low = -high;
      if (kind_[i] == ConeKind::box) low = env_.lo[i], high = env_.hi[i];
      if (x[i] < low - kRounding || x[i] > high + kRounding) return false;
    }
    return true;
  }

  const Environment<double>& env_;
  std::size_t n_;
  std::vector<Number> a_, matrix_, right_;
  std::vector<ConeKind> kind_;
  std::vector<std::size_t> normal_;
  std::vector<State> state_;
};

/// The largest violation of the law of boxed friction over the environment's cones of that kind, relative to max|b| or
/// to the largest reaction. Products, not a projection: (mu x_n - x_k) max(0, -w_k) and (x_k + mu x_n) max(0, w_k).
inline double box_friction_violation(const Environment<double>& env, const std::vector<double>& lambda) {
  const std::size_t n = env.b.size();
  const std::vector<Number> a = detail::dense_matrix(env);
  Number motion = 0, reaction = 0, worst = 0;
  for (std::size_t i = 0; i < n; ++i) {
    motion = std::max(motion, std::abs(static_cast<Number>(env.b[i])));
    reaction = std::max(reaction, std::abs(static_cast<Number>(lambda[i])));
  }
  if (reaction == 0) reaction = 1;
  const auto see = [&](Number by) { worst = std::max(worst, by); };
  std::size_t row = 0;
  for (const auto& cone : env.cones) {
    const auto m = static_cast<std::size_t>(cone.row_count);
    for (std::size_t k = 0; cone.kind == ConeKind::box_friction && k < m; ++k) {
      const std::size_t i = row + k;
      Number w = env.b[i];
      for (std::size_t j = 0; j < n; ++j) w += a[i * n + j] * static_cast<Number>(lambda[j]);
      const Number x = lambda[i];
      if (k == 0) {
        see(-x / reaction);
        see(-w / motion);
        see(std::abs(x * w) / (reaction * motion));
        continue;
      }
      const Number bound = static_cast<Number>(env.mu[i]) * static_cast<Number>(lambda[row]);
      see((std::abs(x) - bound) / reaction);
      see((bound - x) * std::max(-w, Number(0)) / (reaction * motion));
      see((bound + x) * std::max(w, Number(0)) / (reaction * motion));
    }
    row += m;
  }
  return static_cast<double>(worst);
}

}  // namespace stiction::oracle
