#pragma once

#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

#include "stiction/batch.hpp"

/// A slow, dense solver in extended precision, written from the mathematics and from no header of core/algorithm: twins
/// that share a text share its mistakes. It answers small systems only.
///
/// Convex law: accelerated projected gradient on 1/2 z'Bz + c'z with a step from Gershgorin's bound. Coordinates make
/// friction cones circular and give each cone's block a unit mean diagonal. Momentum restarts when the objective's
/// gradient points against the step. Now and then Newton's method on the natural map tries to finish. Coulomb law: the
/// fixed point s = norm(mu w_t(s)), where w(s) solves the convex problem with s added to the normal rows of b. If mu *
/// sqrt(condition of A) < 1 that map contracts in the norm of A^-1, and its fixed point is the only solution.
namespace stiction::oracle {

using Number = long double;

struct Answer {
  std::vector<double> lambda, w;
  double residual = 0;     ///< natural map of the scaled problem with a unit step over its Lipschitz bound, relative
  bool converged = false;  ///< residual below 1e-14, and the outer iteration at rest
};

namespace detail {

/// The system in circular coordinates: lambda = scale * z, w = motion / scale (rows with scale 0 are held at zero).
struct Scaled {
  std::size_t n = 0;
  std::vector<Number> B, c, scale, lo, hi;
  std::vector<Environment<double>::Cone> cones;
  Number lipschitz = 0;
  Number c_norm = 0;
};

inline std::vector<Number> dense_matrix(const Environment<double>& env) {
  const std::size_t n = env.b.size();
  std::vector<Number> a(n * n, 0);
  for (std::size_t i = 0; i < n; ++i) {
    for (auto k = static_cast<std::size_t>(env.row_offsets[i]); k < static_cast<std::size_t>(env.row_offsets[i + 1]);
         ++k)
      a[i * n + static_cast<std::size_t>(env.column[k])] += static_cast<Number>(env.A[k]);
    if (!env.R.empty()) a[i * n + i] += static_cast<Number>(env.R[i]);
  }
  return a;
}

inline Scaled scaled(const Environment<double>& env) {
  Scaled s;
  s.n = env.b.size();
  s.cones = env.cones;
  const std::vector<Number> a = dense_matrix(env);
  s.scale.assign(s.n, 1);
  s.lo.assign(s.n, 0);
  s.hi.assign(s.n, 0);
  std::size_t row = 0;
  for (const auto& cone : env.cones) {
    const auto m = static_cast<std::size_t>(cone.row_count);
    if (cone.kind == ConeKind::friction)
      for (std::size_t k = 1; k < m; ++k) s.scale[row + k] = env.mu.empty() ? 0 : static_cast<Number>(env.mu[row + k]);
    Number trace = 0;
    for (std::size_t k = 0; k < m; ++k) trace += a[(row + k) * (s.n + 1)] * s.scale[row + k] * s.scale[row + k];
    const Number unit = trace > 0 ? std::sqrt(static_cast<Number>(m) / trace) : Number(1);
    for (std::size_t k = 0; k < m; ++k) s.scale[row + k] *= unit;
    if (cone.kind == ConeKind::box) {
      s.lo[row] = static_cast<Number>(env.lo[row]) / s.scale[row];
      s.hi[row] = static_cast<Number>(env.hi[row]) / s.scale[row];
    }
    row += m;
  }
  s.B.resize(s.n * s.n);
  s.c.resize(s.n);
  for (std::size_t i = 0; i < s.n; ++i) {
    Number row_sum = 0;
    for (std::size_t j = 0; j < s.n; ++j) {
      s.B[i * s.n + j] = s.scale[i] * a[i * s.n + j] * s.scale[j];
      row_sum += std::abs(s.B[i * s.n + j]);
    }
    if (row_sum > s.lipschitz) s.lipschitz = row_sum;
    s.c[i] = s.scale[i] * static_cast<Number>(env.b[i]);
    if (std::abs(s.c[i]) > s.c_norm) s.c_norm = std::abs(s.c[i]);
  }
  if (s.lipschitz == 0) s.lipschitz = 1;
  if (s.c_norm == 0) s.c_norm = 1;
  return s;
}

/// z onto the product of the cones.
inline void project(const Scaled& s, std::vector<Number>& z) {
  std::size_t row = 0;
  for (const auto& cone : s.cones) {
    Number& normal = z[row];
    if (cone.kind == ConeKind::unilateral && normal < 0) normal = 0;
    if (cone.kind == ConeKind::box) normal = normal < s.lo[row] ? s.lo[row] : normal > s.hi[row] ? s.hi[row] : normal;
    if (cone.kind == ConeKind::friction) {
      const auto m = static_cast<std::size_t>(cone.row_count);
      Number length = 0;
      for (std::size_t k = 1; k < m; ++k) {
        if (s.scale[row + k] == 0) z[row + k] = 0;
        length = std::hypot(length, z[row + k]);
      }
      if (length > normal) {
        const Number onto = normal + length > 0 ? (normal + length) / 2 : 0;
        for (std::size_t k = 1; k < m; ++k) z[row + k] *= length > 0 ? onto / length : 0;
        normal = onto;
      }
    }
    row += static_cast<std::size_t>(cone.row_count);
  }
}

inline std::vector<Number> motion(const Scaled& s, const std::vector<Number>& z) {
  std::vector<Number> y = s.c;
  for (std::size_t i = 0; i < s.n; ++i)
    for (std::size_t j = 0; j < s.n; ++j) y[i] += s.B[i * s.n + j] * z[j];
  return y;
}

/// The largest |z - P(z - y / L)| L, relative to max|c|.
inline Number natural_map(const Scaled& s, const std::vector<Number>& z) {
  const std::vector<Number> y = motion(s, z);
  std::vector<Number> p = z;
  for (std::size_t i = 0; i < s.n; ++i) p[i] -= y[i] / s.lipschitz;
  project(s, p);
  Number largest = 0;
  for (std::size_t i = 0; i < s.n; ++i) {
    const Number r = std::abs(z[i] - p[i]) * s.lipschitz;
    if (!(r <= largest)) largest = r;
  }
  return largest / s.c_norm;
}

/// x with M x = q by Gaussian elimination with partial pivoting; nothing if M is singular to working precision.
inline std::optional<std::vector<Number>> solve_linear(std::vector<Number> m, std::vector<Number> q) {
  const std::size_t n = q.size();
  for (std::size_t k = 0; k < n; ++k) {
    std::size_t pivot = k;
    for (std::size_t i = k + 1; i < n; ++i)
      if (std::abs(m[i * n + k]) > std::abs(m[pivot * n + k])) pivot = i;
    if (std::abs(m[pivot * n + k]) < 1e-12L) return std::nullopt;
    for (std::size_t j = 0; j < n; ++j) std::swap(m[k * n + j], m[pivot * n + j]);
    std::swap(q[k], q[pivot]);
    for (std::size_t i = k + 1; i < n; ++i) {
      const Number factor = m[i * n + k] / m[k * n + k];
      for (std::size_t j = k; j < n; ++j) m[i * n + j] -= factor * m[k * n + j];
      q[i] -= factor * q[k];
    }
  }
  for (std::size_t k = n; k-- > 0;) {
    for (std::size_t j = k + 1; j < n; ++j) q[k] -= m[k * n + j] * q[j];
    q[k] /= m[k * n + k];
  }
  return q;
}

/// The derivative of the projection at z, row-major: one element of Clarke's.
inline std::vector<Number> projection_derivative(const Scaled& s, const std::vector<Number>& z) {
  std::vector<Number> d(s.n * s.n, 0);
  std::size_t row = 0;
  for (const auto& cone : s.cones) {
    const auto m = static_cast<std::size_t>(cone.row_count);
    const Number normal = z[row];
    if (cone.kind == ConeKind::free) d[row * (s.n + 1)] = 1;
    if (cone.kind == ConeKind::unilateral) d[row * (s.n + 1)] = normal > 0 ? 1 : 0;
    if (cone.kind == ConeKind::box) d[row * (s.n + 1)] = normal > s.lo[row] && normal < s.hi[row] ? 1 : 0;
    if (cone.kind == ConeKind::friction) {
      std::vector<Number> t(m, 0);
      Number length = 0;
      for (std::size_t k = 1; k < m; ++k) {
        t[k] = s.scale[row + k] == 0 ? 0 : z[row + k];
        length = std::hypot(length, t[k]);
      }
      for (std::size_t k = 0; k < m && length <= normal; ++k)
        d[(row + k) * (s.n + 1)] = k == 0 || s.scale[row + k] != 0 ? 1 : 0;
      if (length > normal && length > -normal) {
        d[row * (s.n + 1)] = 0.5L;
        for (std::size_t k = 1; k < m; ++k) {
          d[row * s.n + row + k] = d[(row + k) * s.n + row] = t[k] / (2 * length);
          for (std::size_t l = 1; l < m; ++l)
            d[(row + k) * s.n + row + l] = -normal * t[k] * t[l] / (2 * length * length * length);
          if (s.scale[row + k] != 0) d[(row + k) * (s.n + 1)] += (normal + length) / (2 * length);
        }
      }
    }
    row += m;
  }
  return d;
}

/// Semismooth Newton steps on z - P(z - y / L) from z; true, and z replaced, if they reach the tolerance.
inline bool polish(const Scaled& s, std::vector<Number>& z, Number tolerance) {
  std::vector<Number> trial = z;
  for (int step = 0; step < 25; ++step) {
    const std::vector<Number> y = motion(s, trial);
    std::vector<Number> point = trial;
    for (std::size_t i = 0; i < s.n; ++i) point[i] -= y[i] / s.lipschitz;
    const std::vector<Number> d = projection_derivative(s, point);
    project(s, point);
    std::vector<Number> jacobian(s.n * s.n), gap(s.n);
    for (std::size_t i = 0; i < s.n; ++i) {
      gap[i] = point[i] - trial[i];
      for (std::size_t j = 0; j < s.n; ++j) {
        Number sum = (i == j ? Number(1) : Number(0)) - d[i * s.n + j];
        for (std::size_t k = 0; k < s.n; ++k) sum += d[i * s.n + k] * s.B[k * s.n + j] / s.lipschitz;
        jacobian[i * s.n + j] = sum;
      }
    }
    const auto move = solve_linear(jacobian, gap);
    if (!move) return false;
    for (std::size_t i = 0; i < s.n; ++i) trial[i] += (*move)[i];
    std::vector<Number> inside = trial;
    project(s, inside);
    if (natural_map(s, inside) <= tolerance) {
      z = inside;
      return true;
    }
  }
  return false;
}

/// Minimises from z on; the residual that was reached.
inline Number minimise(const Scaled& s, std::vector<Number>& z, Number tolerance, int max_iterations) {
  std::vector<Number> before = z, point = z;
  Number t = 1;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    if (iteration % 16 == 0 && natural_map(s, z) <= tolerance) break;
    if (iteration % 512 == 511 && polish(s, z, tolerance)) break;
    const std::vector<Number> gradient = motion(s, point);
    std::vector<Number> next = point;
    for (std::size_t i = 0; i < s.n; ++i) next[i] -= gradient[i] / s.lipschitz;
    project(s, next);
    Number against = 0;
    for (std::size_t i = 0; i < s.n; ++i) against += (point[i] - next[i]) * (next[i] - z[i]);
    const Number t_next = against > 0 ? Number(1) : (1 + std::sqrt(1 + 4 * t * t)) / 2;
    const Number beta = against > 0 ? Number(0) : (t - 1) / t_next;
    before = z;
    z = next;
    for (std::size_t i = 0; i < s.n; ++i) point[i] = z[i] + beta * (z[i] - before[i]);
    t = t_next;
  }
  return natural_map(s, z);
}

inline constexpr Number kTolerance = 1e-14L;
inline constexpr int kMaxIterations = 50000;

inline Answer answer(const Environment<double>& env, const Scaled& s, const std::vector<Number>& z, Number residual) {
  Answer result;
  const std::vector<Number> a = dense_matrix(env);
  for (std::size_t i = 0; i < s.n; ++i) result.lambda.push_back(static_cast<double>(s.scale[i] * z[i]));
  for (std::size_t i = 0; i < s.n; ++i) {
    Number w = static_cast<Number>(env.b[i]);
    for (std::size_t j = 0; j < s.n; ++j) w += a[i * s.n + j] * s.scale[j] * z[j];
    result.w.push_back(static_cast<double>(w));
  }
  result.residual = static_cast<double>(residual);
  return result;
}

}  // namespace detail

/// The convex law's minimiser.
inline Answer solve_convex(const Environment<double>& env) {
  const detail::Scaled s = detail::scaled(env);
  std::vector<Number> z(s.n, 0);
  const Number residual = detail::minimise(s, z, detail::kTolerance, detail::kMaxIterations);
  Answer result = detail::answer(env, s, z, residual);
  result.converged = residual <= detail::kTolerance;
  return result;
}

/// The exact Coulomb law, where the fixed point over de Saxce's term is found within 2000 rounds.
inline Answer solve_coulomb(const Environment<double>& env) {
  detail::Scaled s = detail::scaled(env);
  const std::vector<Number> c = s.c;
  std::vector<Number> z(s.n, 0);
  bool at_rest = false;
  Number residual = 1;
  for (int round = 0; round < 2000 && !at_rest; ++round) {
    residual = detail::minimise(s, z, detail::kTolerance, detail::kMaxIterations);
    // The motion without the term that was added: the subject of the law.
    std::vector<Number> y = detail::motion(s, z);
    for (std::size_t i = 0; i < s.n; ++i) y[i] += c[i] - s.c[i];
    std::size_t row = 0;
    at_rest = true;
    for (const auto& cone : s.cones) {
      if (cone.kind == ConeKind::friction) {
        Number sliding = 0;
        for (Index k = 1; k < cone.row_count; ++k) sliding = std::hypot(sliding, y[row + static_cast<std::size_t>(k)]);
        if (std::abs(c[row] + sliding - s.c[row]) > 10 * detail::kTolerance * s.c_norm) at_rest = false;
        s.c[row] = c[row] + sliding;
      }
      row += static_cast<std::size_t>(cone.row_count);
    }
  }
  Answer result = detail::answer(env, s, z, residual);
  result.converged = at_rest && residual <= detail::kTolerance;
  return result;
}

inline Answer solve(const Environment<double>& env, Law law) {
  return law == Law::convex ? solve_convex(env) : solve_coulomb(env);
}

/// Every basic solution of the linear complementarity problem of an environment of unilateral rows (at most 12): all
/// 2^n choices of which rows are active.
inline std::vector<Answer> solve_lcp_by_enumeration(const Environment<double>& env) {
  const std::size_t n = env.b.size();
  const std::vector<Number> a = detail::dense_matrix(env);
  std::vector<Answer> found;
  for (std::size_t active = 0; active < (std::size_t{1} << n); ++active) {
    // lambda on active rows and w on the others: B u = -b with column j of A, or of -I.
    std::vector<Number> basis(n * n, 0), q(n);
    for (std::size_t i = 0; i < n; ++i) {
      q[i] = -static_cast<Number>(env.b[i]);
      for (std::size_t j = 0; j < n; ++j)
        basis[i * n + j] = ((active >> j) & 1U) != 0 ? a[i * n + j] : (i == j ? Number(-1) : Number(0));
    }
    const auto u = detail::solve_linear(basis, q);
    if (!u) continue;
    Answer answer;
    bool feasible = true;
    for (std::size_t j = 0; j < n; ++j) {
      feasible = feasible && (*u)[j] >= -1e-15L;
      const bool on = ((active >> j) & 1U) != 0;
      answer.lambda.push_back(on ? static_cast<double>((*u)[j]) : 0.0);
      answer.w.push_back(on ? 0.0 : static_cast<double>((*u)[j]));
    }
    answer.converged = true;
    if (feasible) found.push_back(answer);
  }
  return found;
}

}  // namespace stiction::oracle
