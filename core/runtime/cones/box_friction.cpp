#include "stiction/box_friction.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "core/base/fp_env.hpp"
#include "core/runtime/check/defects.hpp"
#include "core/runtime/check/expect.hpp"

namespace stiction {
namespace {

/// Rows that a cone has once its boxed friction is written as half lines.
template <class Real>
Offset rows_made_of(const ContactBatchView<Real>& batch, Offset cone) {
  const Offset rows = batch.cone_row_offsets[cone + 1] - batch.cone_row_offsets[cone];
  return batch.cone_kind[cone] == ConeKind::box_friction ? 2 * rows - 1 : rows;
}

/// Writes one environment after the other, into arrays that grow.
template <class Real>
class Rewriter {
 public:
  Rewriter(const ContactBatchView<Real>& from, ComplementarityBatch<Real>& to,
           typename ContactBatch<Real>::Arrays& arrays)
      : from_(from), to_(to), arrays_(arrays) {}

  void environment(Offset env) {
    const Offset first = from_.env_cone_offsets[env], end = from_.env_cone_offsets[env + 1];
    first_row_ = from_.env_row_offsets[env];
    first_made_ = static_cast<Offset>(arrays_.b.size());
    cone_of_row_.clear();
    for (Offset cone = first; cone < end; ++cone) {
      cone_of_row_.resize(static_cast<std::size_t>(from_.cone_row_offsets[cone + 1] - first_row_), cone);
      to_.first_row.push_back(to_.first_row.back() + rows_made_of(from_, cone));
    }
    for (Offset cone = first; cone < end; ++cone) add_cone(cone);
    arrays_.env_row_offsets.push_back(static_cast<Offset>(arrays_.b.size()));
    arrays_.env_cone_offsets.push_back(static_cast<Offset>(arrays_.cone_kind.size()));
  }

 private:
  /// Row `k` of a cone's replacement, within the environment.
  [[nodiscard]] Index made(Offset cone, Offset k) const {
    return static_cast<Index>(to_.first_row[static_cast<std::size_t>(cone)] + k - first_made_);
  }
  [[nodiscard]] double friction(Offset row) const { return static_cast<double>(from_.mu[row]); }

  /// Adds value * lambda_column to the row that is being made.
  void add(Offset column, double value) {
    const Offset cone = cone_of_row_[static_cast<std::size_t>(column)];
    const Offset first = from_.cone_row_offsets[cone];
    const Offset k = first_row_ + column - first;
    entries_[made(cone, k)] += value;
    if (from_.cone_kind[cone] == ConeKind::box_friction && k > 0)
      entries_[made(cone, 0)] -= value * friction(first + k);
  }

  void finish_row(double b, Real compliance, Offset original) {
    for (const auto& [column, value] : entries_) {
      arrays_.column.push_back(column);
      arrays_.A.push_back(static_cast<Real>(value));
    }
    entries_.clear();
    arrays_.row_offsets.push_back(static_cast<Offset>(arrays_.column.size()));
    arrays_.b.push_back(static_cast<Real>(b));
    arrays_.R.push_back(compliance);
    for (const auto& [to, from] :
         {std::pair{&arrays_.mu, from_.mu}, std::pair{&arrays_.lo, from_.lo}, std::pair{&arrays_.hi, from_.hi}})
      to->push_back(original < 0 ? Real(0) : from[original]);
  }

  void add_cone(Offset cone) {
    const Offset first = from_.cone_row_offsets[cone], rows = from_.cone_row_offsets[cone + 1] - first;
    const bool is_boxed = from_.cone_kind[cone] == ConeKind::box_friction;
    for (Offset k = 0; k < rows; ++k) {
      const Offset row = first + k;
      for (Offset at = from_.row_offsets[row]; at < from_.row_offsets[row + 1]; ++at)
        add(from_.column[at], static_cast<double>(from_.A[at]));
      if (is_boxed) add(row - first_row_, static_cast<double>(from_.R[row]));
      if (is_boxed && k > 0) entries_[made(cone, rows - 1 + k)] += 1.0;
      finish_row(static_cast<double>(from_.b[row]), is_boxed ? Real(0) : from_.R[row], is_boxed ? -1 : row);
    }
    for (Offset k = 1; is_boxed && k < rows; ++k) {
      entries_[made(cone, 0)] = 2.0 * friction(first + k);
      entries_[made(cone, k)] = -1.0;
      finish_row(0.0, Real(0), -1);
    }
    const Offset cones = is_boxed ? rows_made_of(from_, cone) : 1;
    for (Offset c = 0; c < cones; ++c) {
      arrays_.cone_kind.push_back(is_boxed ? ConeKind::unilateral : from_.cone_kind[cone]);
      arrays_.cone_row_offsets.push_back(arrays_.cone_row_offsets.back() + (is_boxed ? 1 : rows));
      if (from_.cone_group != nullptr) arrays_.cone_group.push_back(from_.cone_group[cone]);
    }
  }

  const ContactBatchView<Real>& from_;
  ComplementarityBatch<Real>& to_;
  typename ContactBatch<Real>::Arrays& arrays_;
  Offset first_row_ = 0;             ///< of the environment
  Offset first_made_ = 0;            ///< of its replacement
  std::vector<Offset> cone_of_row_;  ///< in the batch
  std::map<Index, double> entries_;  ///< of the row that is being made, by column
};

template <class Real>
void check_friction(const ContactBatchView<Real>& view) {
  for (Offset cone = 0; cone < view.cone_count; ++cone) {
    if (view.cone_kind[cone] != ConeKind::box_friction) continue;
    for (Offset row = view.cone_row_offsets[cone] + 1; row < view.cone_row_offsets[cone + 1]; ++row)
      if (!(view.mu[row] >= Real(0)) || !std::isfinite(view.mu[row]))
        refuse("mu[cone " + std::to_string(cone) + ", row " + std::to_string(row) +
               "] = " + std::to_string(view.mu[row]) +
               ": friction must be >= 0 and finite; correct the batch (validate() lists " + "every defect)");
  }
}

}  // namespace

template <class Real>
ContactBatch<Real> with_box_friction(const ContactBatch<Real>& batch) {
  typename ContactBatch<Real>::Arrays arrays = batch.arrays();
  std::replace(arrays.cone_kind.begin(), arrays.cone_kind.end(), ConeKind::friction, ConeKind::box_friction);
  return ContactBatch<Real>::from_arrays(batch.law(), std::move(arrays));
}

template <class Real>
ComplementarityBatch<Real> as_complementarity(const ContactBatch<Real>& batch) {
  const ScopedFpEnv fp_env;
  const ContactBatchView<Real> view = batch.view();
  if (const auto defects = validate_structure(view, 1); !defects.empty()) refuse(defects.front().message);
  for (Offset env = 0; env < view.env_count; ++env)
    if (view.env_dofs(env) != 0)
      throw Error(ErrorCode::unsupported, "env " + std::to_string(env) +
                                              " stores A as a factor, which half lines cannot be made of; assemble A");
  check_friction(view);
  ComplementarityBatch<Real> result;
  result.first_row = {0};
  typename ContactBatch<Real>::Arrays arrays;
  arrays.env_row_offsets = arrays.env_cone_offsets = arrays.cone_row_offsets = arrays.row_offsets = {0};
  arrays.env_flags = batch.arrays().env_flags;
  Rewriter<Real> rewriter(view, result, arrays);
  for (Offset env = 0; env < view.env_count; ++env) rewriter.environment(env);
  result.batch = ContactBatch<Real>::from_arrays(batch.law(), std::move(arrays));
  return result;
}

template <class Real>
std::vector<Real> reactions(const ComplementarityBatch<Real>& made, const ContactBatch<Real>& original,
                            std::span<const Real> z) {
  const ScopedFpEnv fp_env;
  const ContactBatchView<Real> view = original.view();
  expect_length("z", z.size(), static_cast<std::size_t>(made.batch.row_count()), "one per row of half lines");
  expect_length("first_row", made.first_row.size(), static_cast<std::size_t>(view.cone_count) + 1,
                "one per cone of the original batch, and one");
  std::vector<Real> lambda(static_cast<std::size_t>(view.row_count));
  for (Offset cone = 0; cone < view.cone_count; ++cone) {
    const Offset first = view.cone_row_offsets[cone];
    const auto from = static_cast<std::size_t>(made.first_row[static_cast<std::size_t>(cone)]);
    for (Offset row = first; row < view.cone_row_offsets[cone + 1]; ++row) {
      const Real own = z[from + static_cast<std::size_t>(row - first)];
      const bool rubs = view.cone_kind[cone] == ConeKind::box_friction && row > first;
      lambda[static_cast<std::size_t>(row)] =
          rubs ? static_cast<Real>(static_cast<double>(own) -
                                   static_cast<double>(view.mu[row]) * static_cast<double>(z[from]))
               : own;
    }
  }
  return lambda;
}

template ContactBatch<float> with_box_friction(const ContactBatch<float>&);
template ContactBatch<double> with_box_friction(const ContactBatch<double>&);
template ComplementarityBatch<float> as_complementarity(const ContactBatch<float>&);
template ComplementarityBatch<double> as_complementarity(const ContactBatch<double>&);
template std::vector<float> reactions(const ComplementarityBatch<float>&, const ContactBatch<float>&,
                                      std::span<const float>);
template std::vector<double> reactions(const ComplementarityBatch<double>&, const ContactBatch<double>&,
                                       std::span<const double>);

}  // namespace stiction
