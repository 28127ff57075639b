#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "core/base/fp_env.hpp"
#include "core/runtime/check/defects.hpp"
#include "core/runtime/judge/cone_error.hpp"
#include "stiction/error.hpp"
#include "stiction/residual.hpp"

// Written from docs/math/residual.md and from nothing else. No header of core/algorithm is included here, so that a
// mistake in the solvers' residual cannot hide in the judge. Motions are computed in f64, rows in stored order.

namespace stiction {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Share of the largest |b| of a cone that its island's scale is at least.
constexpr double kIdle = 1e-4;

/// Which cones belong together.
class Islands {
 public:
  void reset(std::size_t cones) {
    above_.resize(cones);
    for (std::size_t cone = 0; cone < cones; ++cone) above_[cone] = cone;
  }
  [[nodiscard]] std::size_t of(std::size_t cone) {
    while (above_[cone] != cone) cone = above_[cone] = above_[above_[cone]];
    return cone;
  }
  void join(std::size_t a, std::size_t b) {
    const std::size_t first = of(a), second = of(b);
    if (first < second) above_[second] = first;
    if (second < first) above_[first] = second;
  }

 private:
  std::vector<std::size_t> above_;
};

/// Room for one environment, kept from one to the next.
struct Scratch {
  std::vector<double> lambda, w, diagonal, largest, velocity, error, scale;
  std::vector<std::size_t> cone_of;  ///< of each row
  Islands islands;
};

constexpr std::size_t kNoCone = std::numeric_limits<std::size_t>::max();

/// Cones are of one island if an entry of A couples them, or a degree of freedom that two rows of Y share.
template <class Real>
void find_islands(const ContactBatchView<Real>& batch, Offset env, Scratch& scratch) {
  const Offset first_row = batch.env_row_offsets[env], first_cone = batch.env_cone_offsets[env];
  const auto rows = static_cast<std::size_t>(batch.env_rows(env));
  const auto cones = static_cast<std::size_t>(batch.env_cones(env));
  scratch.islands.reset(cones);
  scratch.cone_of.assign(rows, 0);
  for (std::size_t cone = 0; cone < cones; ++cone) {
    const Offset at = first_cone + static_cast<Offset>(cone);
    for (Offset row = batch.cone_row_offsets[at]; row < batch.cone_row_offsets[at + 1]; ++row)
      scratch.cone_of[static_cast<std::size_t>(row - first_row)] = cone;
  }
  for (std::size_t i = 0; i < rows; ++i) {
    const Offset row = first_row + static_cast<Offset>(i);
    const Index* columns = batch.row_columns(row);
    for (Index k = 0; k < batch.row_entries(row); ++k)
      if (batch.A[batch.row_offsets[row] + k] != Real(0))
        scratch.islands.join(scratch.cone_of[i], scratch.cone_of[static_cast<std::size_t>(columns[k])]);
  }
  const auto dofs = static_cast<std::size_t>(batch.env_dofs(env));
  for (std::size_t k = 0; k < dofs; ++k) {
    const Real* factor = batch.factor + batch.factor_offsets[env];
    std::size_t before = kNoCone;
    for (std::size_t i = 0; i < rows; ++i) {
      if (factor[i * dofs + k] == Real(0)) continue;
      if (before != kNoCone) scratch.islands.join(before, scratch.cone_of[i]);
      before = scratch.cone_of[i];
    }
  }
}

/// w = (A + diag R) lambda + b in stored order, the diagonal of A + R and each row's largest entry.
template <class Real>
void find_motion(const ContactBatchView<Real>& batch, Offset env, Scratch& scratch) {
  const Offset first_row = batch.env_row_offsets[env];
  const auto rows = static_cast<std::size_t>(batch.env_rows(env));
  scratch.w.resize(rows);
  scratch.diagonal.resize(rows);
  scratch.largest.assign(rows, 0.0);
  // A = Y Y': the motion of a row is Y times the velocity Y' lambda.
  const auto dofs = static_cast<std::size_t>(batch.env_dofs(env));
  const Real* factor = dofs == 0 ? nullptr : batch.factor + batch.factor_offsets[env];
  scratch.velocity.assign(dofs, 0.0);
  for (std::size_t i = 0; i < rows; ++i)
    for (std::size_t k = 0; k < dofs; ++k)
      scratch.velocity[k] += static_cast<double>(factor[i * dofs + k]) * scratch.lambda[i];

  for (std::size_t i = 0; i < rows; ++i) {
    const Offset row = first_row + static_cast<Offset>(i);
    const auto compliance = static_cast<double>(batch.R[row]);
    double w = static_cast<double>(batch.b[row]) + compliance * scratch.lambda[i];
    double diagonal = compliance;
    const Index* columns = batch.row_columns(row);
    for (Index k = 0; k < batch.row_entries(row); ++k) {
      const auto column = static_cast<std::size_t>(columns[k]);
      const auto entry = static_cast<double>(batch.A[batch.row_offsets[row] + k]);
      w += entry * scratch.lambda[column];
      if (column == i) diagonal += entry;
      if (std::abs(entry) > scratch.largest[i]) scratch.largest[i] = std::abs(entry);
    }
    for (std::size_t k = 0; k < dofs; ++k) {
      const auto entry = static_cast<double>(factor[i * dofs + k]);
      w += entry * scratch.velocity[k];
      diagonal += entry * entry;
    }
    scratch.w[i] = w;
    scratch.diagonal[i] = diagonal < 0 ? 0 : diagonal;
  }
}

template <class Real>
ConeRows rows_of(const ContactBatchView<Real>& batch, Offset cone, Offset env_first_row, const Scratch& scratch) {
  ConeRows rows;
  const Offset row = batch.cone_row_offsets[cone];
  rows.size = static_cast<std::size_t>(batch.cone_row_offsets[cone + 1] - row);
  Offset tangential = row;
  for (std::size_t k = 0; k < rows.size; ++k) {
    if (tangential == batch.normal_row(cone)) ++tangential;
    const Offset place = k == 0 ? batch.normal_row(cone) : tangential++;
    const auto at = static_cast<std::size_t>(place - env_first_row);
    rows.lambda[k] = scratch.lambda[at];
    rows.w[k] = scratch.w[at];
    rows.diagonal[k] = k == 0 && scratch.diagonal[at] == 0 ? scratch.largest[at] : scratch.diagonal[at];
    if (k > 0 && carries_friction(batch.cone_kind[cone]))
      rows.mu[k] = static_cast<double>(batch.mu[batch.mu_at(place)]);
  }
  if (batch.cone_kind[cone] == ConeKind::box) {
    rows.lo = static_cast<double>(batch.lo[row]);
    rows.hi = static_cast<double>(batch.hi[row]);
  }
  return rows;
}

/// A cone without any reaction.
template <class Real>
ConeRows without_reaction(ConeRows rows, const ContactBatchView<Real>& batch, Offset cone) {
  Offset tangential = batch.cone_row_offsets[cone];
  for (std::size_t k = 0; k < rows.size; ++k) {
    if (tangential == batch.normal_row(cone)) ++tangential;
    rows.lambda[k] = 0;
    rows.w[k] = static_cast<double>(batch.b[k == 0 ? batch.normal_row(cone) : tangential++]);
  }
  return rows;
}

double share(double error, double scale) {
  if (error == 0) return 0;
  if (!(error < kInfinity) || !(scale > 0)) return kInfinity;
  return error / scale;
}

template <class Real>
Residual env_residual(const ContactBatchView<Real>& batch, Offset env, const Real* solution, Scratch& scratch) {
  const Offset first_row = batch.env_row_offsets[env], first_cone = batch.env_cone_offsets[env];
  const auto cones = static_cast<std::size_t>(batch.env_cones(env));
  scratch.lambda.assign(solution + first_row, solution + first_row + batch.env_rows(env));
  find_motion(batch, env, scratch);
  find_islands(batch, env, scratch);
  scratch.error.assign(cones, 0.0);
  scratch.scale.assign(cones, 0.0);
  for (std::size_t cone = 0; cone < cones; ++cone) {
    const Offset at = first_cone + static_cast<Offset>(cone);
    const ConeRows rows = rows_of(batch, at, first_row, scratch);
    const ConeRows idle = without_reaction(rows, batch, at);
    scratch.error[cone] = cone_error(rows, batch.cone_kind[at], batch.law);
    double scale = cone_error(idle, batch.cone_kind[at], batch.law);
    for (std::size_t k = 0; k < idle.size; ++k)
      if (kIdle * std::abs(idle.w[k]) > scale) scale = kIdle * std::abs(idle.w[k]);
    double& largest = scratch.scale[scratch.islands.of(cone)];
    if (scale > largest) largest = scale;
  }

  Residual worst{0, 0, 0, -1};
  for (std::size_t cone = 0; cone < cones; ++cone) {
    const double scale = scratch.scale[scratch.islands.of(cone)];
    const double relative = share(scratch.error[cone], scale);
    if (scratch.error[cone] > worst.absolute) worst.absolute = scratch.error[cone];
    // Among contacts that are infinitely wrong, one with an infinite error comes first.
    const bool broken = !(scratch.error[cone] < kInfinity);
    const bool was_broken = worst.cone >= 0 && !(scratch.error[static_cast<std::size_t>(worst.cone)] < kInfinity);
    if (relative > worst.relative || (broken && !was_broken)) {
      worst.relative = relative;
      worst.scale = scale;
      worst.cone = static_cast<Index>(cone);
    }
  }
  return worst;
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
