#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "stiction/batch.hpp"
#include "tests/support/systems/jacobian_systems.hpp"

/// The relaxed problem by its definition: reaction times motion is kappa, cone by cone, with both inside their cones.
/// Solved on the way down from a large kappa by Newton's method whose slopes are differences. It shares neither the
/// smooth projection nor a line of algebra with the library (docs/math/derivative.md, (22) and (23)).
namespace stiction::test {

/// One environment. Unknowns are lambda and, of box rows, the parts of the motion that the two bounds give.
class RelaxedOracle {
 public:
  RelaxedOracle(const Environment<double>& env, Law law, double kappa) : env_(env), law_(law), kappa_(kappa) {
    rows_ = env.b.size();
    exchange_.assign(env.cones.size(), 0.0);
    std::size_t row = 0;
    for (std::size_t cone = 0; cone < env.cones.size(); ++cone) {
      const auto size = static_cast<std::size_t>(env.cones[cone].row_count);
      for (std::size_t i = row; i < row + size; ++i)
        exchange_[cone] += (entry(i, i) + env.R[i]) / static_cast<double>(size);
      if (env.cones[cone].kind == ConeKind::box)
        first_part_.push_back(rows_ + 2 * boxes_++);
      else
        first_part_.push_back(0);
      row += size;
    }
    for (const double b : env.b) scale_ = std::max(scale_, std::abs(b));
  }

  /// Reactions; empty where Newton's method did not end.
  [[nodiscard]] std::vector<double> solve() const {
    std::vector<double> v = inside();
    for (double level = 10.0; level > kappa_; level *= 0.6)
      if (!newton(env_, v, level, 1e-3)) return {};
    if (!newton(env_, v, kappa_, 1e-13)) return {};
    return v;
  }

  /// Solves for numbers nearby, with the exchange rates and the rounding of this environment.
  [[nodiscard]] std::vector<double> solve_near(const Environment<double>& env, std::vector<double> v) const {
    if (!newton(env, v, kappa_, 1e-13)) return {};
    return v;
  }

  static std::vector<double> motion(const Environment<double>& env, const std::vector<double>& v) {
    std::vector<double> w = env.b;
    for (std::size_t i = 0; i < w.size(); ++i) {
      w[i] += env.R[i] * v[i];
      for (auto k = static_cast<std::size_t>(env.row_offsets[i]); k < static_cast<std::size_t>(env.row_offsets[i + 1]);
           ++k)
        w[i] += env.A[k] * v[static_cast<std::size_t>(env.column[k])];
    }
    return w;
  }

 private:
  [[nodiscard]] double entry(std::size_t i, std::size_t j) const {
    for (auto k = static_cast<std::size_t>(env_.row_offsets[i]); k < static_cast<std::size_t>(env_.row_offsets[i + 1]);
         ++k)
      if (static_cast<std::size_t>(env_.column[k]) == j) return env_.A[k];
    return 0.0;
  }

  /// Everything inside its cone and its bounds.
  [[nodiscard]] std::vector<double> inside() const {
    std::vector<double> v(rows_ + 2 * boxes_, 1.0);
    std::size_t row = 0;
    for (const auto& cone : env_.cones) {
      for (Index k = 1; k < cone.row_count; ++k) v[row + static_cast<std::size_t>(k)] = 0.0;
      if (cone.kind == ConeKind::free) v[row] = 0.0;
      if (cone.kind == ConeKind::box) {
        const double lo = env_.lo[row], hi = env_.hi[row];
        v[row] = std::isfinite(hi) && std::isfinite(lo) ? 0.5 * (lo + hi) : std::isfinite(lo) ? lo + 1.0 : hi - 1.0;
      }
      row += static_cast<std::size_t>(cone.row_count);
    }
    return v;
  }

  /// Returns the vector that is zero at the solution; `is_inside` tells if everything is inside.
  std::vector<double> defect(const Environment<double>& env, const std::vector<double>& v, double level,
                             bool& is_inside) const {
    std::vector<double> f(v.size());
    const std::vector<double> w = motion(env, v);
    is_inside = true;
    const auto need = [&](double number) { is_inside = is_inside && number > 0.0; };
    std::size_t row = 0;
    for (std::size_t c = 0; c < env.cones.size(); ++c) {
      const auto size = static_cast<std::size_t>(env.cones[c].row_count);
      const double a = exchange_[c];
      switch (env.cones[c].kind) {
        case ConeKind::free:
          f[row] = w[row];
          break;
        case ConeKind::unilateral:
          f[row] = v[row] * w[row] - level;
          need(v[row]);
          need(w[row]);
          break;
        case ConeKind::box: {
          const double lo = env.lo[row], hi = env.hi[row];
          const bool has_lo = std::isfinite(lo), has_hi = std::isfinite(hi);
          const std::size_t part = first_part_[c];
          const double up = has_lo ? v[part] : 0.0, down = has_hi ? v[part + 1] : 0.0;
          // The part of a bound that is not there is 1.
          f[part] = v[part] - 1.0;
          f[part + 1] = v[part + 1] - 1.0;
          f[row] = w[row] - (up - down);
          if (has_lo) {
            f[part] = (v[row] - lo + down / a) * up - level;
            need(v[row] - lo + down / a);
            need(up);
          }
          if (has_hi) {
            f[part + 1] = (hi - v[row] + up / a) * down - level;
            need(hi - v[row] + up / a);
            need(down);
          }
          break;
        }
        default: {
          double x_square = 0.0, y_square = 0.0, product = 0.0;
          for (std::size_t i = row + 1; i < row + size; ++i) {
            const double mu = env.mu[i];
            if (!(mu > 0.0)) continue;
            x_square += v[i] / mu * v[i] / mu;
            y_square += mu * w[i] * mu * w[i];
            product += v[i] * w[i];
          }
          double y = w[row];
          const double radius = a * kappa_ / std::max(scale_, std::sqrt(a * kappa_));
          if (law_ == Law::coulomb) y += std::sqrt(y_square + radius * radius) - radius;
          f[row] = v[row] * y + product - level;
          for (std::size_t i = row + 1; i < row + size; ++i)
            f[i] = env.mu[i] > 0.0 ? v[row] * env.mu[i] * w[i] + y * v[i] / env.mu[i] : v[i];
          need(v[row] - std::sqrt(x_square));
          need(y - std::sqrt(y_square));
        }
      }
      row += size;
    }
    return f;
  }

  /// Newton's method until the defect is that small.
  bool newton(const Environment<double>& env, std::vector<double>& v, double level, double small) const {
    const std::size_t m = v.size();
    const auto size = [](const std::vector<double>& f) {
      double sum = 0.0;
      for (const double number : f) sum += number * number;
      return std::sqrt(sum);
    };
    bool is_inside = false;
    std::vector<double> f = defect(env, v, level, is_inside);
    for (int step = 0; step < 200; ++step) {
      if (is_inside && size(f) < small * (1.0 + std::sqrt(level))) return true;
      std::vector<double> slopes(m * m), right(m);
      for (std::size_t j = 0; j < m; ++j) {
        constexpr double kStep = 1e-6;
        bool any = false;
        std::vector<double> up = v, down = v;
        up[j] += kStep;
        down[j] -= kStep;
        const std::vector<double> above = defect(env, up, level, any), below = defect(env, down, level, any);
        for (std::size_t i = 0; i < m; ++i) slopes[i * m + j] = (above[i] - below[i]) / (2 * kStep);
        right[j] = 0.0 - f[j];
      }
      const std::vector<double> change = solve_columns(slopes, right, m);
      double length = 1.0;
      bool is_better = false;
      for (int k = 0; k < 40 && !is_better; ++k) {
        std::vector<double> next = v;
        for (std::size_t j = 0; j < m; ++j) next[j] += length * change[j];
        const std::vector<double> g = defect(env, next, level, is_inside);
        is_better = is_inside && size(g) < size(f);
        if (is_better) {
          v = next;
          f = g;
        }
        length *= 0.5;
      }
      is_inside = true;
      // Bound that roundings allow.
      if (!is_better) return size(f) < 10 * small * (1.0 + std::sqrt(level));
    }
    return false;
  }

  Environment<double> env_;
  Law law_;
  double kappa_;
  std::size_t rows_, boxes_ = 0;
  double scale_ = 0.0;
  std::vector<std::size_t> first_part_;  ///< of a box row's cone: where the parts of its motion are
  std::vector<double> exchange_;         ///< mean diagonal of a cone [w / lambda]
};

}  // namespace stiction::test
