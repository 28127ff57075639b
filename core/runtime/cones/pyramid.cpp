#include "stiction/pyramid.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "core/base/fp_env.hpp"
#include "core/runtime/check/defects.hpp"
#include "core/runtime/check/expect.hpp"

namespace stiction {
namespace {

/// An edge of a cone: its part of each of the cone's rows.
using Edge = std::array<double, kMaxConeRows>;

/// cos and sin of 2 pi i / sides, exactly symmetric and the same with every mathematics library.
std::pair<double, double> direction(int i, int sides) {
  constexpr double kHalf = 0.70710678118654752440;   // cos(pi / 4)
  constexpr double kLong = 0.92387953251128675613;   // cos(pi / 8)
  constexpr double kShort = 0.38268343236508977173;  // sin(pi / 8)
  constexpr std::array<std::pair<double, double>, 4> kQuarter{
      {{1.0, 0.0}, {kLong, kShort}, {kHalf, kHalf}, {kShort, kLong}}};
  const int quarter = sides / 4;
  const int place = i % quarter * (16 / sides);
  std::pair<double, double> result = kQuarter.at(static_cast<std::size_t>(place));
  for (int turn = 0; turn < i / quarter; ++turn) result = {0.0 - result.second, result.first};
  return result;
}

/// The edges of one cone.
template <class Real>
std::vector<Edge> edges_of(const ContactBatchView<Real>& batch, Offset cone, int sides) {
  const Offset first = batch.cone_row_offsets[cone];
  const auto size = static_cast<Index>(batch.cone_row_offsets[cone + 1] - first);
  const Edge normal{1.0};
  if (batch.cone_kind[cone] != ConeKind::friction) return {normal};
  std::vector<Index> axes;
  for (Index k = 1; k < size; ++k) {
    const Real mu = batch.mu[first + k];
    if (!(mu >= Real(0)) || !std::isfinite(mu)) {
      refuse("mu[cone " + std::to_string(cone) + ", row " + std::to_string(first + k) + "] = " + std::to_string(mu) +
             ": friction must be >= 0 and finite to have a pyramid; correct the batch (validate() lists every defect)");
    }
    if (mu > Real(0)) axes.push_back(k);
  }
  if (axes.empty()) return {normal};
  std::vector<Edge> edges;
  if (size == 3 && axes.size() == 2) {
    for (int i = 0; i < sides; ++i) {
      const auto [cosine, sine] = direction(i, sides);
      edges.push_back(
          {1.0, static_cast<double>(batch.mu[first + 1]) * cosine, static_cast<double>(batch.mu[first + 2]) * sine});
    }
    return edges;
  }
  for (const Index k : axes)
    for (const double sign : {1.0, -1.0}) {
      Edge edge = normal;
      edge.at(static_cast<std::size_t>(k)) = sign * static_cast<double>(batch.mu[first + k]);
      edges.push_back(edge);
    }
  return edges;
}

/// A block of A between two cones.
using ConeBlock = std::array<std::array<double, kMaxConeRows>, kMaxConeRows>;

/// Linearises one environment after the other, into arrays that grow.
template <class Real>
class Lineariser {
 public:
  Lineariser(const ContactBatchView<Real>& from, PyramidBatch<Real>& to, typename ContactBatch<Real>::Arrays& arrays)
      : from_(from), to_(to), arrays_(arrays) {}

  void environment(Offset env) {
    const Offset first_cone = from_.env_cone_offsets[env];
    const Offset end_cone = from_.env_cone_offsets[env + 1];
    const Offset first_row = from_.env_row_offsets[env];
    first_edge_ = static_cast<Offset>(arrays_.b.size());
    edges_.clear();
    cone_of_row_.clear();
    for (Offset cone = first_cone; cone < end_cone; ++cone) {
      edges_.push_back(edges_of(from_, cone, to_.sides));
      const Offset size = from_.cone_row_offsets[cone + 1] - from_.cone_row_offsets[cone];
      cone_of_row_.insert(cone_of_row_.end(), static_cast<std::size_t>(size), static_cast<Index>(cone - first_cone));
      to_.first_edge.push_back(to_.first_edge.back() + static_cast<Offset>(edges_.back().size()));
    }
    met_.assign(edges_.size(), Index{-1});
    for (Offset cone = first_cone; cone < end_cone; ++cone) add_cone(first_cone, first_row, cone);
    arrays_.env_row_offsets.push_back(static_cast<Offset>(arrays_.b.size()));
    arrays_.env_cone_offsets.push_back(static_cast<Offset>(arrays_.b.size()));
  }

 private:
  /// The blocks of A in the rows of a cone, by the cone of their columns; with diag R where a pyramid takes it in.
  void gather_blocks(Offset first_cone, Offset first_row, Offset cone) {
    const auto own = static_cast<Index>(cone - first_cone);
    const Offset begin = from_.cone_row_offsets[cone];
    columns_.clear();
    blocks_.clear();
    const auto block_of = [&](Index other) -> ConeBlock& {
      Index& place = met_[static_cast<std::size_t>(other)];
      if (place < 0) {
        place = static_cast<Index>(blocks_.size());
        columns_.push_back(other);
        blocks_.push_back({});
      }
      return blocks_[static_cast<std::size_t>(place)];
    };
    for (Offset row = begin; row < from_.cone_row_offsets[cone + 1]; ++row) {
      const auto i = static_cast<std::size_t>(row - begin);
      for (Offset k = from_.row_offsets[row]; k < from_.row_offsets[row + 1]; ++k) {
        const Index column = from_.column[k];
        const Index other = cone_of_row_[static_cast<std::size_t>(column)];
        const Offset other_row = from_.cone_row_offsets[first_cone + other] - first_row;
        block_of(other)[i][static_cast<std::size_t>(column - other_row)] += static_cast<double>(from_.A[k]);
      }
      if (from_.cone_kind[cone] == ConeKind::friction) block_of(own)[i][i] += static_cast<double>(from_.R[row]);
    }
    order_ = columns_;
    std::sort(order_.begin(), order_.end());
  }

  void add_cone(Offset first_cone, Offset first_row, Offset cone) {
    gather_blocks(first_cone, first_row, cone);
    const Offset begin = from_.cone_row_offsets[cone];
    const auto size = static_cast<std::size_t>(from_.cone_row_offsets[cone + 1] - begin);
    const bool is_friction = from_.cone_kind[cone] == ConeKind::friction;
    for (const Edge& edge : edges_[static_cast<std::size_t>(cone - first_cone)]) {
      double b = 0.0;
      for (std::size_t i = 0; i < size; ++i)
        b += edge.at(i) * static_cast<double>(from_.b[begin + static_cast<Offset>(i)]);
      for (const Index other : order_) {
        const ConeBlock& block = blocks_[static_cast<std::size_t>(met_[static_cast<std::size_t>(other)])];
        const Edge row = times(edge, block, size);
        const Offset column = to_.first_edge[static_cast<std::size_t>(first_cone + other)] - first_edge_;
        const auto& others = edges_[static_cast<std::size_t>(other)];
        for (std::size_t e = 0; e < others.size(); ++e) {
          double sum = 0.0;
          for (std::size_t j = 0; j < others[e].size(); ++j) sum += row.at(j) * others[e].at(j);
          arrays_.column.push_back(static_cast<Index>(column) + static_cast<Index>(e));
          arrays_.A.push_back(static_cast<Real>(sum));
        }
      }
      arrays_.row_offsets.push_back(static_cast<Offset>(arrays_.column.size()));
      arrays_.b.push_back(static_cast<Real>(b));
      arrays_.R.push_back(is_friction ? Real(0) : from_.R[begin]);
      arrays_.mu.push_back(Real(0));
      arrays_.lo.push_back(is_friction ? Real(0) : from_.lo[begin]);
      arrays_.hi.push_back(is_friction ? Real(0) : from_.hi[begin]);
      arrays_.cone_kind.push_back(is_friction ? ConeKind::unilateral : from_.cone_kind[cone]);
      arrays_.cone_row_offsets.push_back(static_cast<Offset>(arrays_.b.size()));
      if (from_.cone_group != nullptr) arrays_.cone_group.push_back(from_.cone_group[cone]);
    }
    for (const Index other : columns_) met_[static_cast<std::size_t>(other)] = -1;
  }

  /// edge' block.
  static Edge times(const Edge& edge, const ConeBlock& block, std::size_t rows) {
    Edge result{};
    for (std::size_t i = 0; i < rows; ++i)
      for (std::size_t j = 0; j < result.size(); ++j) result.at(j) += edge.at(i) * block.at(i).at(j);
    return result;
  }

  const ContactBatchView<Real>& from_;
  PyramidBatch<Real>& to_;
  typename ContactBatch<Real>::Arrays& arrays_;
  Offset first_edge_ = 0;                 ///< first row of the environment's pyramids
  std::vector<std::vector<Edge>> edges_;  ///< of each cone of the environment
  std::vector<Index> cone_of_row_;        ///< within the environment
  std::vector<Index> met_;                ///< which of blocks_ each cone has, or -1
  std::vector<Index> columns_, order_;    ///< cones that blocks_ belong to, as found and sorted
  std::vector<ConeBlock> blocks_;
};

}  // namespace

template <class Real>
PyramidBatch<Real> linearise(const ContactBatch<Real>& batch, int sides) {
  const ScopedFpEnv fp_env;
  if (sides != 4 && sides != 8 && sides != 16)
    refuse("sides = " + std::to_string(sides) + ", expected a pyramid of 4, 8 or 16 sides");
  const ContactBatchView<Real> view = batch.view();
  if (const auto defects = validate_structure(view, 1); !defects.empty()) refuse(defects.front().message);
  const ConeKind* const kinds_end = view.cone_kind + view.cone_count;
  if (std::find(view.cone_kind, kinds_end, ConeKind::semidefinite) != kinds_end)
    throw Error(ErrorCode::unsupported,
                "the batch has cones of semidefinite, which no half lines are; solve it as it is, by jacobi, apgd or "
                "admm");
  if (std::find(view.cone_kind, kinds_end, ConeKind::box_friction) != kinds_end)
    throw Error(ErrorCode::unsupported,
                "the batch has cones of box_friction, whose law is not that of a pyramid; solve it as it is, by pgs, "
                "npgs, nsgs or jacobi");
  for (Offset env = 0; env < view.env_count; ++env) {
    if (view.env_dofs(env) == 0) continue;
    throw Error(ErrorCode::unsupported,
                "env " + std::to_string(env) + " stores A as a factor, which a pyramid cannot be made of; assemble A");
  }
  PyramidBatch<Real> result;
  result.sides = sides;
  result.first_edge = {0};
  typename ContactBatch<Real>::Arrays arrays;
  arrays.env_row_offsets = arrays.env_cone_offsets = arrays.cone_row_offsets = arrays.row_offsets = {0};
  arrays.env_flags = batch.arrays().env_flags;
  Lineariser<Real> lineariser(view, result, arrays);
  for (Offset env = 0; env < view.env_count; ++env) lineariser.environment(env);
  result.batch = ContactBatch<Real>::from_arrays(Law::convex, std::move(arrays));
  return result;
}

template <class Real>
PyramidReactions<Real> reactions(const PyramidBatch<Real>& pyramids, const ContactBatch<Real>& original,
                                 std::span<const Real> f) {
  const ScopedFpEnv fp_env;
  const ContactBatchView<Real> view = original.view();
  expect_length("f", f.size(), static_cast<std::size_t>(pyramids.batch.row_count()), "one per row of the pyramids");
  expect_length("first_edge", pyramids.first_edge.size(), static_cast<std::size_t>(view.cone_count) + 1,
                "one per cone of the original batch, and one");
  const auto rows = static_cast<std::size_t>(view.row_count);
  std::vector<double> lambda(rows, 0.0);
  for (Offset cone = 0; cone < view.cone_count; ++cone) {
    const std::vector<Edge> edges = edges_of(view, cone, pyramids.sides);
    const Offset first_edge = pyramids.first_edge[static_cast<std::size_t>(cone)];
    const Offset first = view.cone_row_offsets[cone];
    for (std::size_t e = 0; e < edges.size(); ++e)
      for (Offset row = first; row < view.cone_row_offsets[cone + 1]; ++row)
        lambda[static_cast<std::size_t>(row)] += edges[e].at(static_cast<std::size_t>(row - first)) *
                                                 static_cast<double>(f[static_cast<std::size_t>(first_edge) + e]);
  }
  PyramidReactions<Real> result{std::vector<Real>(rows), std::vector<Real>(rows)};
  for (std::size_t i = 0; i < rows; ++i) result.lambda[i] = static_cast<Real>(lambda[i]);
  for (Offset env = 0; env < view.env_count; ++env) {
    const Offset first = view.env_row_offsets[env];
    for (Offset row = first; row < view.env_row_offsets[env + 1]; ++row) {
      double w = static_cast<double>(view.b[row]) +
                 static_cast<double>(view.R[row]) * static_cast<double>(result.lambda[static_cast<std::size_t>(row)]);
      for (Offset k = view.row_offsets[row]; k < view.row_offsets[row + 1]; ++k)
        w += static_cast<double>(view.A[k]) *
             static_cast<double>(result.lambda[static_cast<std::size_t>(first + view.column[k])]);
      result.w[static_cast<std::size_t>(row)] = static_cast<Real>(w);
    }
  }
  return result;
}

template PyramidBatch<float> linearise(const ContactBatch<float>&, int);
template PyramidBatch<double> linearise(const ContactBatch<double>&, int);
template PyramidReactions<float> reactions(const PyramidBatch<float>&, const ContactBatch<float>&,
                                           std::span<const float>);
template PyramidReactions<double> reactions(const PyramidBatch<double>&, const ContactBatch<double>&,
                                            std::span<const double>);

}  // namespace stiction
