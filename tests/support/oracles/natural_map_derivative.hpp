#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "stiction/derivative.hpp"
#include "tests/support/systems/jacobian_systems.hpp"

/// The derivative of a solution by another way than the library's. The natural map F(x) = x - P(x - y / a) is
/// differentiated as a whole, without modes. Its derivative is a full matrix, and solved by elimination.
namespace stiction::test {

/// Cotangents of one environment's numbers.
struct EnvironmentGradient {
  std::vector<double> A;  ///< n x n, entries taken as independent
  std::vector<double> b, R, mu, lo, hi;
};

class NaturalMapDerivative {
 public:
  NaturalMapDerivative(const Environment<double>& env, Law law, const std::vector<double>& lambda)
      : env_(env), law_(law), n_(env.b.size()), lambda_(lambda), B_(n_ * n_), scale_(n_, 1.0) {
    for (std::size_t i = 0; i < n_; ++i) {
      for (auto k = static_cast<std::size_t>(env.row_offsets[i]); k < static_cast<std::size_t>(env.row_offsets[i + 1]);
           ++k)
        B_[i * n_ + static_cast<std::size_t>(env.column[k])] += env.A[k];
      B_[i * n_ + i] += env.R.empty() ? 0.0 : env.R[i];
    }
    w_ = env.b;
    for (std::size_t i = 0; i < n_; ++i)
      for (std::size_t j = 0; j < n_; ++j) w_[i] += B_[i * n_ + j] * lambda_[j];
    std::size_t row = 0;
    for (const auto& cone : env.cones) {
      for (Index k = 1; k < cone.row_count; ++k)
        scale_[row + static_cast<std::size_t>(k)] = env.mu[row + static_cast<std::size_t>(k)];
      differentiate(cone, row);
      row += static_cast<std::size_t>(cone.row_count);
    }
  }

  [[nodiscard]] EnvironmentGradient vjp(const std::vector<double>& lambda_bar, const std::vector<double>& w_bar) const {
    std::vector<double> effective = lambda_bar;
    for (std::size_t i = 0; i < n_; ++i)
      for (std::size_t j = 0; j < n_; ++j) effective[j] += B_[i * n_ + j] * w_bar[i];
    // K = dF/dx with y = S B S x + S b; its transpose is solved.
    std::vector<double> transposed(n_ * n_), right(n_);
    for (std::size_t i = 0; i < n_; ++i) {
      right[i] = scale_[i] * effective[i];
      for (std::size_t j = 0; j < n_; ++j) {
        double entry = (i == j ? 1.0 : 0.0) - P(i, j);
        for (std::size_t k = 0; k < n_; ++k) entry += PT(i, k) * scale_[k] * B_[k * n_ + j] * scale_[j];
        transposed[j * n_ + i] = entry;
      }
    }
    for (std::size_t i = 0; i < n_; ++i)
      if (scale_[i] == 0.0) transposed[i * n_ + i] = 1.0;  // an axis that does not exist
    const std::vector<double> q = solve_columns(transposed, right, n_);
    std::vector<double> nu(n_), rest(effective);
    for (std::size_t k = 0; k < n_; ++k) {
      double sum = 0.0;
      for (std::size_t i = 0; i < n_; ++i) sum -= PT(i, k) * q[i];
      nu[k] = scale_[k] * sum;
    }
    for (std::size_t i = 0; i < n_; ++i)
      for (std::size_t j = 0; j < n_; ++j) rest[j] += B_[i * n_ + j] * nu[i];
    EnvironmentGradient to{std::vector<double>(n_ * n_), nu, nu, std::vector<double>(n_), std::vector<double>(n_),
                           std::vector<double>(n_)};
    for (std::size_t i = 0; i < n_; ++i) {
      to.b[i] += w_bar[i];
      to.R[i] = to.b[i] * lambda_[i];
      for (std::size_t j = 0; j < n_; ++j) to.A[i * n_ + j] = to.b[i] * lambda_[j];
      to.lo[i] = at_lo_[i] ? q[i] : 0.0;
      to.hi[i] = at_hi_[i] ? q[i] : 0.0;
    }
    std::size_t row = 0;
    for (const auto& cone : env_.cones) {
      for (std::size_t i = row + 1; i < row + static_cast<std::size_t>(cone.row_count); ++i)
        if (scale_[i] > 0.0) to.mu[i] = rest[i] * lambda_[i] / scale_[i] + nu[i] / scale_[i] * w_[i];
      row += static_cast<std::size_t>(cone.row_count);
    }
    return to;
  }

 private:
  /// Derivative of the projection, and that times the derivative of y + shift by y, over the weight a.
  [[nodiscard]] double P(std::size_t i, std::size_t j) const { return P_[i * n_ + j]; }
  [[nodiscard]] double PT(std::size_t i, std::size_t j) const { return PT_[i * n_ + j]; }

  void differentiate(const Environment<double>::Cone& cone, std::size_t row) {
    if (P_.empty()) {
      P_.assign(n_ * n_, 0.0);
      PT_ = P_;
      at_lo_.assign(n_, false);
      at_hi_ = at_lo_;
    }
    const auto m = static_cast<std::size_t>(cone.row_count);
    double a = 0.0;
    for (std::size_t k = 0; k < m; ++k) a += B_[(row + k) * n_ + row + k] / static_cast<double>(m);
    std::vector<double> x(m), y(m), z(m), turn(m);
    double speed = 0.0, length = 0.0;
    for (std::size_t k = 0; k < m; ++k) {
      x[k] = scale_[row + k] > 0.0 ? lambda_[row + k] / scale_[row + k] : 0.0;
      y[k] = scale_[row + k] * w_[row + k];
      if (k > 0) speed = std::hypot(speed, y[k]);
    }
    for (std::size_t k = 0; k < m; ++k) {
      z[k] = x[k] - (y[k] + (k == 0 && law_ == Law::coulomb ? speed : 0.0)) / a;
      if (k > 0) {
        length = std::hypot(length, z[k]);
        turn[k] = law_ == Law::coulomb && speed > 0.0 ? y[k] / speed : 0.0;
      }
    }
    const auto set = [&](std::size_t i, std::size_t j, double value) { P_[(row + i) * n_ + row + j] = value; };
    if (cone.kind == ConeKind::friction) {
      if (length <= -z[0]) return;
      for (std::size_t i = 0; i < m; ++i)
        for (std::size_t j = 0; j < m; ++j) {
          if (length <= z[0]) {
            set(i, j, i == j ? 1.0 : 0.0);
          } else if (i == 0 || j == 0) {
            set(i, j, i == j ? 0.5 : 0.5 * z[i + j] / length);
          } else {
            const double both = z[i] * z[j] / (length * length);
            set(i, j, 0.5 * both + 0.5 * (z[0] + length) / length * ((i == j ? 1.0 : 0.0) - both));
          }
        }
    } else {
      at_lo_[row] = cone.kind == ConeKind::box && z[0] < env_.lo[row];
      at_hi_[row] = cone.kind == ConeKind::box && z[0] > env_.hi[row];
      const bool fixed = at_lo_[row] || at_hi_[row] || (cone.kind == ConeKind::unilateral && z[0] < 0.0);
      set(0, 0, fixed ? 0.0 : 1.0);
    }
    for (std::size_t i = 0; i < m; ++i)
      for (std::size_t j = 0; j < m; ++j) {
        const double own = P(row + i, row + j) + P(row + i, row) * turn[j];
        PT_[(row + i) * n_ + row + j] = own / a;
      }
  }

  const Environment<double>& env_;
  Law law_;
  std::size_t n_;
  std::vector<double> lambda_, B_, scale_, w_, P_, PT_;
  std::vector<bool> at_lo_, at_hi_;
};

}  // namespace stiction::test
