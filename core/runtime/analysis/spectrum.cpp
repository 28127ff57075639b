#include "stiction/spectrum.hpp"

#include <cmath>
#include <utility>
#include <vector>

#include "core/base/fp_env.hpp"
#include "core/graph/tridiagonal.hpp"
#include "core/runtime/analysis/environment_operator.hpp"
#include "core/runtime/analysis/start_vector.hpp"
#include "core/runtime/check/expect.hpp"

namespace stiction {
namespace {

using Vector = std::vector<double>;

double dot(const Vector& a, const Vector& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

/// Takes the parts along vectors of a basis out of w, twice: once leaves the rounding of the first.
void orthogonalise(const std::vector<Vector>& basis, Vector& w) {
  for (int turn = 0; turn < 2; ++turn)
    for (const Vector& q : basis) {
      const double share = dot(q, w);
      for (std::size_t i = 0; i < w.size(); ++i) w[i] -= share * q[i];
    }
}

/// The tridiagonal matrix of so many of Lanczos' steps, fewer where they exhaust the range of A.
graph::Tridiagonal lanczos(const EnvironmentOperator& A, Index steps) {
  graph::Tridiagonal T;
  Vector w = A.multiply(start_vector(A.rows()));
  const double scale = norm(w);
  double length = scale;
  std::vector<Vector> basis;
  constexpr double kExhausted = 1e-12;
  while (length > kExhausted * scale && static_cast<Index>(basis.size()) < steps && basis.size() < A.rows()) {
    if (!basis.empty()) T.off.push_back(length);
    for (double& value : w) value /= length;
    basis.push_back(w);
    w = A.multiply(basis.back());
    T.diagonal.push_back(dot(basis.back(), w));
    orthogonalise(basis, w);
    length = norm(w);
  }
  return T;
}

}  // namespace

double SpectrumEstimate::condition() const noexcept {
  if (std::isnan(largest)) return largest;
  return smallest > 0 ? largest / smallest : std::numeric_limits<double>::infinity();
}

template <class Real>
SpectrumEstimate estimate_spectrum(const ContactBatchView<Real>& batch, Offset env, Index steps) {
  const ScopedFpEnv fp_env;
  if (steps < 2) refuse("steps = " + std::to_string(steps) + ": an estimate of two extremes takes 2 or more");
  if (env < 0 || env >= batch.env_count)
    refuse("environment " + std::to_string(env) + ": the batch has " + std::to_string(batch.env_count));
  SpectrumEstimate seen;
  seen.rows = batch.env_rows(env);
  if (seen.rows == 0) return seen;
  const EnvironmentOperator A(batch, env, true);
  const auto n = static_cast<double>(seen.rows);
  seen.density = batch.env_dofs(env) > 0 ? 1.0 : static_cast<double>(A.nonzeros()) / (n * n);
  if (!A.is_finite()) return seen;
  const graph::Tridiagonal T = lanczos(A, steps);
  seen.steps = static_cast<Index>(T.diagonal.size()) + 1;
  if (T.diagonal.empty()) return seen;
  const double bound = 2 * graph::reach(T);
  seen.largest = A.unscaled(graph::eigenvalue(T, T.diagonal.size() - 1, -bound, bound));
  seen.smallest = A.unscaled(graph::eigenvalue(T, 0, -bound, bound));
  return seen;
}

SpectrumClass classify(const SpectrumEstimate& seen, const SpectrumRules& rules) noexcept {
  const double condition = seen.condition();
  if (condition < rules.direct_condition && seen.rows < rules.direct_rows) return SpectrumClass::direct;
  if (condition < rules.preconditioned_condition) return SpectrumClass::preconditioned;
  if (seen.density < rules.sparse_density) return SpectrumClass::decomposed;
  return SpectrumClass::otherwise;
}

SolverKind SpectrumRules::solver_of(SpectrumClass found) const noexcept {
  switch (found) {
    case SpectrumClass::direct:
      return direct;
    case SpectrumClass::preconditioned:
      return preconditioned;
    case SpectrumClass::decomposed:
      return decomposed;
    case SpectrumClass::otherwise:
      break;
  }
  return otherwise;
}

const char* to_string(SpectrumClass found) noexcept {
  switch (found) {
    case SpectrumClass::direct:
      return "direct";
    case SpectrumClass::preconditioned:
      return "preconditioned";
    case SpectrumClass::decomposed:
      return "decomposed";
    case SpectrumClass::otherwise:
      return "otherwise";
  }
  return "unknown";
}

const char* to_string(SolverChoice choice) noexcept {
  switch (choice) {
    case SolverChoice::named:
      return "named";
    case SolverChoice::spectrum:
      return "spectrum";
  }
  return "unknown";
}

SolverChoice solver_choice_from_string(const std::string& name) {
  for (const SolverChoice choice : {SolverChoice::named, SolverChoice::spectrum})
    if (name == to_string(choice)) return choice;
  throw Error(ErrorCode::invalid_argument, "choice '" + name + "' is not known; use one of: named, spectrum");
}

template SpectrumEstimate estimate_spectrum(const ContactBatchView<float>&, Offset, Index);
template SpectrumEstimate estimate_spectrum(const ContactBatchView<double>&, Offset, Index);

}  // namespace stiction
