#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "core/base/fp_env.hpp"
#include "core/runtime/defects.hpp"
#include "stiction/error.hpp"
#include "stiction/residual.hpp"

// Written from docs/math/residual.md and from nothing else. No header of core/algorithm is included here, so that a
// mistake in the solvers' residual cannot hide in the judge. Everything is computed in f64, rows in stored order.

namespace stiction {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Keeps a scale that divides away from zero: an environment at rest (b = 0).
constexpr double kTiny = 1e-300;

/// The largest of the values seen; one that is not finite makes it infinite for good.
class Largest {
 public:
  void see(double value) {
    if (!std::isfinite(value)) value_ = kInfinity;
    if (value > value_) value_ = value;
  }
  [[nodiscard]] double value() const { return value_; }

 private:
  double value_ = 0.0;
};

/// The Euclidean norm; numbers whose squares over- or underflow do not spoil it, since they are scaled by a power of
/// two.
double norm(const double* values, std::size_t count) {
  Largest largest;
  for (std::size_t k = 0; k < count; ++k) largest.see(std::abs(values[k]));
  if (largest.value() == 0.0 || !std::isfinite(largest.value())) return largest.value();
  const int exponent = std::ilogb(largest.value());
  double sum = 0.0;
  for (std::size_t k = 0; k < count; ++k) {
    const double scaled = std::scalbn(values[k], -exponent);
    sum += scaled * scaled;
  }
  return std::scalbn(std::sqrt(sum), exponent);
}

/// The coordinates of one cone in which friction is the circular unit cone; up to kMaxConeRows of them.
struct ConeVector {
  std::array<double, kMaxConeRows> at{};
  std::size_t size = 0;

  void push(double value) { at[size++] = value; }
  [[nodiscard]] double tail_norm() const { return norm(at.data() + 1, size - 1); }
};

/// The nearest point of the cone n >= norm(t).
ConeVector project_circular(const ConeVector& z) {
  const double normal = z.at[0], tangential = z.tail_norm();
  if (tangential <= normal) return z;
  ConeVector result;
  result.size = z.size;
  if (tangential <= -normal) return result;
  const double onto = 0.5 * (normal + tangential);
  result.at[0] = onto;
  for (std::size_t k = 1; k < z.size; ++k) result.at[k] = onto * (z.at[k] / tangential);
  return result;
}

double clamp(double value, double lo, double hi) {
  if (value < lo) return lo;
  if (value > hi) return hi;
  return value;
}

/// r = a (x - P(x - y / a)) of a friction cone of m rows, and its norm. P of a cone commutes with a > 0. So r is
/// a x - P(a x - y), without a quotient that overflows where a is tiny.
template <class Real>
double friction_residual(const double* lambda, const double* w, const std::array<Real, kMaxConeRows>& mu, std::size_t m,
                         double a, Law law) {
  ConeVector x, y;
  x.push(lambda[0]);
  y.push(w[0]);
  double penalty = 0.0;  // an axis without friction has no coordinate in the cone: any reaction on it is an error
  for (std::size_t k = 1; k < m; ++k) {
    const auto axis = static_cast<double>(mu[k]);
    if (axis <= 0.0) {
      const double error = std::abs(lambda[k]) * a;
      if (error > penalty) penalty = error;
    } else {
      x.push(lambda[k] / axis);
      y.push(w[k] * axis);
    }
  }
  if (law == Law::coulomb) y.at[0] += y.tail_norm();

  ConeVector z;
  for (std::size_t k = 0; k < x.size; ++k) z.push(a * x.at[k] - y.at[k]);
  const ConeVector projected = project_circular(z);
  std::array<double, kMaxConeRows + 1> r{penalty};
  for (std::size_t k = 0; k < x.size; ++k) r[k + 1] = a * x.at[k] - projected.at[k];
  return norm(r.data(), x.size + 1);
}

/// The norm of r of a cone of boxed friction, in units of x = lambda / mu and y = mu w. r_n = a x_n - max(0, a x_n -
/// y_n), and r_k is a x_k less a x_k - y_k, held between -a x_n and a x_n.
template <class Real>
double box_friction_residual(const double* lambda, const double* w, const std::array<Real, kMaxConeRows>& mu,
                             std::size_t m, double a) {
  std::array<double, kMaxConeRows> r{};
  r[0] = a * lambda[0] - clamp(a * lambda[0] - w[0], 0.0, kInfinity);
  const double bound = lambda[0] > 0.0 ? a * lambda[0] : 0.0;
  for (std::size_t k = 1; k < m; ++k) {
    const auto axis = static_cast<double>(mu[k]);
    const double scaled = axis > 0.0 ? a * (lambda[k] / axis) : a * lambda[k];
    r[k] = axis > 0.0 ? scaled - clamp(scaled - w[k] * axis, -bound, bound) : scaled;
  }
  return norm(r.data(), m);
}

/// The nearest positive semidefinite matrix to one of order n, by rotations until nothing is left to turn.
void project_matrix(std::array<std::array<long double, 3>, 3>& S, std::size_t n) {
  std::array<std::array<long double, 3>, 3> V{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  for (int pass = 0; pass < 60; ++pass) {
    bool turned = false;
    for (std::size_t p = 0; p + 1 < n; ++p)
      for (std::size_t q = p + 1; q < n; ++q) {
        if (std::abs(S[p][q]) <= 1e-21L * (std::abs(S[p][p]) + std::abs(S[q][q]))) continue;
        turned = true;
        const long double angle = 0.5L * std::atan2(2 * S[p][q], S[q][q] - S[p][p]);
        const long double c = std::cos(angle), s = std::sin(angle);
        for (auto* M : {&S, &V})
          for (std::size_t k = 0; k < n; ++k) {
            const long double left = (*M)[k][p], right = (*M)[k][q];
            (*M)[k][p] = c * left - s * right;
            (*M)[k][q] = s * left + c * right;
          }
        for (std::size_t k = 0; k < n; ++k) {
          const long double upper = S[p][k], lower = S[q][k];
          S[p][k] = c * upper - s * lower;
          S[q][k] = s * upper + c * lower;
        }
      }
    if (!turned) break;
  }
  std::array<long double, 3> e{};
  for (std::size_t k = 0; k < n; ++k) e[k] = S[k][k];
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) {
      S[i][j] = 0;
      for (std::size_t k = 0; k < n; ++k)
        if (e[k] > 0) S[i][j] += e[k] * V[i][k] * V[j][k];
    }
}

/// The norm of r = a x - P(a x - y) of a semidefinite matrix. Its 3 or 6 rows are the upper triangle, column by column,
/// off-diagonals times sqrt(2).
double semidefinite_residual(const double* lambda, const double* w, std::size_t m, double a) {
  const std::size_t order = m == 3 ? 2 : 3;
  const long double root = std::sqrt(2.0L);
  std::array<std::array<long double, 3>, 3> S{};
  for (std::size_t j = 0, k = 0; j < order; ++j)
    for (std::size_t i = 0; i <= j; ++i, ++k)
      S[i][j] = S[j][i] = static_cast<long double>(a * lambda[k] - w[k]) / (i == j ? 1.0L : root);
  project_matrix(S, order);
  std::array<double, kMaxConeRows> r{};
  for (std::size_t j = 0, k = 0; j < order; ++j)
    for (std::size_t i = 0; i <= j; ++i, ++k)
      r[k] = a * lambda[k] - static_cast<double>(S[i][j] * (i == j ? 1.0L : root));
  return norm(r.data(), m);
}

/// `env_*` count from the environment's first row.
template <class Real>
double cone_residual(const ContactBatchView<Real>& batch, Offset cone, Offset env_first_row,
                     const std::vector<double>& env_lambda, const std::vector<double>& env_w,
                     const std::vector<double>& env_diagonal) {
  const Offset row = batch.cone_row_offsets[cone];
  const auto m = static_cast<std::size_t>(batch.cone_row_offsets[cone + 1] - row);
  // The cone's rows with the normal first, wherever the batch has it.
  std::array<double, kMaxConeRows> lambda{}, w{};
  std::array<Real, kMaxConeRows> mu{};
  double trace = 0.0;
  Offset tangential = row;
  for (std::size_t k = 0; k < m; ++k) {
    if (tangential == batch.normal_row(cone)) ++tangential;
    const Offset place = k == 0 ? batch.normal_row(cone) : tangential++;
    const auto at = static_cast<std::size_t>(place - env_first_row);
    lambda[k] = env_lambda[at];
    w[k] = env_w[at];
    if (k > 0 && carries_friction(batch.cone_kind[cone])) mu[k] = batch.mu[batch.mu_at(place)];
    trace += env_diagonal[at];
  }
  const double mean = trace / static_cast<double>(m);
  const double a = mean > 0.0 ? mean : 1.0;

  switch (batch.cone_kind[cone]) {
    case ConeKind::free:
      return std::abs(w[0]);
    case ConeKind::unilateral:
      return std::abs(a * lambda[0] - clamp(a * lambda[0] - w[0], 0.0, kInfinity));
    case ConeKind::box:
      return std::abs(a * lambda[0] - clamp(a * lambda[0] - w[0], a * static_cast<double>(batch.lo[row]),
                                            a * static_cast<double>(batch.hi[row])));
    case ConeKind::friction:
      return friction_residual(lambda.data(), w.data(), mu, m, a, batch.law);
    case ConeKind::box_friction:
      return box_friction_residual(lambda.data(), w.data(), mu, m, a);
    case ConeKind::semidefinite:
      return semidefinite_residual(lambda.data(), w.data(), m, a);
  }
  return kInfinity;
}

/// Room for one environment, kept from one to the next.
struct Scratch {
  std::vector<double> lambda, w, diagonal, velocity;
};

template <class Real>
Residual env_residual(const ContactBatchView<Real>& batch, Offset env, const Real* solution, Scratch& scratch) {
  const Offset first_row = batch.env_row_offsets[env];
  const auto rows = static_cast<std::size_t>(batch.env_rows(env));
  scratch.lambda.assign(solution + first_row, solution + first_row + rows);
  scratch.w.resize(rows);
  scratch.diagonal.resize(rows);

  // A = Y Y': the motion of a row is Y times the velocity Y' lambda.
  const auto dofs = static_cast<std::size_t>(batch.env_dofs(env));
  const Real* factor = dofs == 0 ? nullptr : batch.factor + batch.factor_offsets[env];
  scratch.velocity.assign(dofs, 0.0);
  for (std::size_t i = 0; i < rows; ++i)
    for (std::size_t k = 0; k < dofs; ++k)
      scratch.velocity[k] += static_cast<double>(factor[i * dofs + k]) * scratch.lambda[i];

  Largest b_largest, worst;
  for (std::size_t i = 0; i < rows; ++i) {
    const Offset row = first_row + static_cast<Offset>(i);
    const auto b = static_cast<double>(batch.b[row]);
    const auto compliance = static_cast<double>(batch.R[row]);
    double w = b + compliance * scratch.lambda[i];
    double diagonal = compliance;
    const Index* columns = batch.row_columns(row);
    for (Index k = 0; k < batch.row_entries(row); ++k) {
      const auto column = static_cast<std::size_t>(columns[k]);
      const auto entry = static_cast<double>(batch.A[batch.row_offsets[row] + k]);
      w += entry * scratch.lambda[column];
      if (column == i) diagonal += entry;
    }
    for (std::size_t k = 0; k < dofs; ++k) {
      const auto entry = static_cast<double>(factor[i * dofs + k]);
      w += entry * scratch.velocity[k];
      diagonal += entry * entry;
    }
    scratch.w[i] = w;
    scratch.diagonal[i] = diagonal;
    b_largest.see(std::abs(b));
    // Infinite reactions and motions can cancel in a cone's condition (w = +infinity lets a contact go): they are
    // an error whatever the cone says.
    if (!std::isfinite(scratch.lambda[i]) || !std::isfinite(w)) worst.see(kInfinity);
  }

  const Offset first_cone = batch.env_cone_offsets[env];
  for (Offset cone = first_cone; cone < first_cone + batch.env_cones(env); ++cone) {
    worst.see(cone_residual(batch, cone, first_row, scratch.lambda, scratch.w, scratch.diagonal));
  }
  if (!std::isfinite(worst.value())) return {kInfinity, kInfinity};
  const double scale = b_largest.value() > kTiny ? b_largest.value() : kTiny;
  return {worst.value() / scale, worst.value()};
}

}  // namespace

template <class Real>
std::vector<Residual> verify(const ContactBatchView<Real>& batch, std::span<const Real> lambda) {
  const ScopedFpEnv fp_env;
  const std::vector<Defect> defects = validate_structure(batch, 1);
  if (!defects.empty()) {
    throw Error(ErrorCode::invalid_argument, "batch cannot be verified: " + defects.front().message);
  }
  if (lambda.size() != static_cast<std::size_t>(batch.row_count)) {
    throw Error(ErrorCode::invalid_argument, "lambda has " + std::to_string(lambda.size()) + " entries, expected " +
                                                 std::to_string(batch.row_count) +
                                                 " (one per row of the batch); pass the solution of this batch");
  }
  std::vector<Residual> result;
  result.reserve(static_cast<std::size_t>(batch.env_count));
  Scratch scratch;
  for (Offset env = 0; env < batch.env_count; ++env) {
    result.push_back(env_residual(batch, env, lambda.data(), scratch));
  }
  return result;
}

template std::vector<Residual> verify(const ContactBatchView<float>&, std::span<const float>);
template std::vector<Residual> verify(const ContactBatchView<double>&, std::span<const double>);

}  // namespace stiction
