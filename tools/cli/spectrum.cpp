#include "tools/cli/spectrum.hpp"

#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "core/graph/tridiagonal.hpp"

namespace stiction::cli {

namespace {

using Vector = std::vector<double>;

double dot(const Vector& x, const Vector& y) {
  double sum = 0;
  for (std::size_t i = 0; i < x.size(); ++i) sum += x[i] * y[i];
  return sum;
}

/// y = ((A + A') / 2 + diag R) x
Vector multiply(const ContactBatchView<double>& batch, Offset env, const Vector& x) {
  const Offset first = batch.env_row_offsets[env];
  Vector y(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) y[i] = batch.R[first + static_cast<Offset>(i)] * x[i];
  for (std::size_t i = 0; i < x.size(); ++i) {
    const Offset row = first + static_cast<Offset>(i);
    for (Offset k = batch.row_offsets[row]; k < batch.row_offsets[row + 1]; ++k) {
      const auto j = static_cast<std::size_t>(batch.column[k]);
      const double half = 0.5 * batch.A[k];
      y[i] += half * x[j];
      y[j] += half * x[i];
    }
  }
  return y;
}

/// Numbers in [-1, 1) without structure, the same in every run.
Vector start_vector(std::size_t size, std::uint64_t salt) {
  Vector x(size);
  std::uint64_t state = 0x9e3779b97f4a7c15ULL * (salt + 1);
  for (double& value : x) {
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    value = static_cast<double>(state >> 11) * 0x1p-52 - 1;
  }
  return x;
}

/// Twice, because once leaves what cancellation made of it.
void orthogonalise(Vector& x, const std::vector<Vector>& basis) {
  for (int pass = 0; pass < 2; ++pass) {
    for (const Vector& q : basis) {
      const double share = dot(q, x);
      for (std::size_t i = 0; i < x.size(); ++i) x[i] -= share * q[i];
    }
  }
}

graph::Tridiagonal lanczos(const ContactBatchView<double>& batch, Offset env, std::size_t rows, std::size_t steps) {
  graph::Tridiagonal T;
  std::vector<Vector> basis;
  Vector x = start_vector(rows, 0);
  double norm = std::sqrt(dot(x, x));
  double scale = 0;
  while (true) {
    for (double& value : x) value /= norm;
    basis.push_back(x);
    Vector y = multiply(batch, env, x);
    T.diagonal.push_back(dot(x, y));
    const double length = std::sqrt(dot(y, y));
    if (length > scale) scale = length;
    if (basis.size() == steps) return T;
    orthogonalise(y, basis);
    norm = std::sqrt(dot(y, y));
    if (norm <= 1e-13 * scale) {
      // An invariant subspace: the next direction is any other one, uncoupled.
      T.off.push_back(0);
      y = start_vector(rows, basis.size());
      orthogonalise(y, basis);
      norm = std::sqrt(dot(y, y));
    } else {
      T.off.push_back(norm);
    }
    x = std::move(y);
  }
}

bool all_finite(const ContactBatchView<double>& batch, Offset env) {
  const Offset first = batch.env_row_offsets[env];
  const Offset last = batch.env_row_offsets[env + 1];
  for (Offset row = first; row < last; ++row) {
    if (!std::isfinite(batch.R[row])) return false;
  }
  for (Offset k = batch.row_offsets[first]; k < batch.row_offsets[last]; ++k) {
    if (!std::isfinite(batch.A[k])) return false;
  }
  return true;
}

}  // namespace

double Spectrum::condition(Offset rows) const {
  const double rounding = static_cast<double>(rows) * std::numeric_limits<double>::epsilon() * largest;
  return smallest > rounding ? largest / smallest : std::numeric_limits<double>::infinity();
}

Spectrum estimate_spectrum(const ContactBatchView<double>& batch, Offset env) {
  Spectrum spectrum;
  const auto rows = static_cast<std::size_t>(batch.env_row_offsets[env + 1] - batch.env_row_offsets[env]);
  if (rows == 0 || !all_finite(batch, env)) return spectrum;
  const std::size_t steps = rows < kLanczosSteps ? rows : static_cast<std::size_t>(kLanczosSteps);
  const graph::Tridiagonal T = lanczos(batch, env, rows, steps);
  const double reach = graph::reach(T);
  if (!std::isfinite(reach)) return spectrum;
  spectrum.usable = true;
  spectrum.complete = steps == rows;
  spectrum.smallest = graph::eigenvalue(T, 0, -reach, reach);
  spectrum.largest = graph::eigenvalue(T, steps - 1, -reach, reach);
  return spectrum;
}

}  // namespace stiction::cli
