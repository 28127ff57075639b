#include "distributed/newton/schwarz.hpp"

#include <algorithm>
#include <numeric>

#include "core/base/extents.hpp"

namespace stiction::distributed {

namespace {

template <class Numbers>
auto* six(Numbers* numbers, Offset row) {
  return numbers + kBodyBlock * row;
}

}  // namespace

Schwarz::Schwarz(Transport& transport, const BlockPattern& pattern, const Domains& domains, const Reach& reach,
                 std::span<const Point> points, Ordering ordering)
    : domains_(domains),
      reach_(reach),
      points_(points),
      halo_(transport, reach.rounds),
      coarse_pattern_(domains.coarse_pattern()) {
  Offset most = 0;
  for (const int domain : reach.domains) {
    const std::vector<Index>& bodies = domains.extended[at(domain)];
    parts_.emplace_back(pattern, std::span<const Index>(bodies), ordering);
    most = std::max(most, static_cast<Offset>(bodies.size()));
  }
  right_.resize(at(kBodyBlock * most));
  left_.resize(right_.size());
  told_.resize(at(kBodyBlock * static_cast<Offset>(reach.slot_count() + domains.aggregates())));
  if (domains.aggregates() == 0) return;
  std::vector<Index> all(at(domains.aggregates()));
  std::iota(all.begin(), all.end(), Index{0});
  coarse_.emplace(coarse_pattern_, std::span<const Index>(all), ordering);
  coarse_blocks_.resize(at(kBlockEntries * static_cast<Offset>(coarse_pattern_.blocks())));
  moved_.resize(at(kBodyBlock * static_cast<Offset>(domains.aggregates())));
}

void Schwarz::prepare(const BlockMatrix& H) {
  for (PartFactor& part : parts_) part.prepare(H.pattern, H.values);
  if (coarse_) assemble_coarse(H, *coarse_);
}

void Schwarz::assemble_coarse(const BlockMatrix& H, PartFactor& factor) {
  std::fill(coarse_blocks_.begin(), coarse_blocks_.end(), 0.0);
  const BlockMatrix coarse{coarse_pattern_, coarse_blocks_.data()};
  for (const Index row : reach_.aggregates) {
    for (const Index body : domains_.members[at(row)]) {
      double left[kBlockEntries], right[kBlockEntries];
      rigid_block(point(body), root_of(row), left);
      for (Index k = H.pattern.offsets[body]; k < H.pattern.offsets[body + 1]; ++k) {
        const Index other = H.pattern.columns[k], column = domains_.aggregate[at(other)];
        if (column > row) continue;
        rigid_block(point(other), root_of(column), right);
        add_coarse_block(left, H.block(k), right, coarse.block(find_block(coarse_pattern_, row, column)));
      }
    }
    double* const own = coarse.block(find_block(coarse_pattern_, row, row));
    for (Index i = 0; i < kBodyBlock; ++i)
      for (Index j = 0; j < i; ++j) own[j * kBodyBlock + i] = own[i * kBodyBlock + j];
  }
  halo_.share(1, coarse_blocks_.data(), kBodyBlock);
  for (Index row = 0; row < coarse_pattern_.rows; ++row)
    for (Index k = coarse_pattern_.offsets[row]; k < coarse_pattern_.offsets[row + 1]; ++k) {
      const Index column = coarse_pattern_.columns[k];
      if (column > row) mirror_block(coarse.block(find_block(coarse_pattern_, column, row)), coarse.block(k));
    }
  factor.prepare(coarse_pattern_, coarse.values);
}

void Schwarz::correct(const double* r, double* z) {
  for (std::size_t which = 0; which < parts_.size(); ++which) {
    const std::vector<Index>& bodies = domains_.extended[at(reach_.domains[which])];
    for (std::size_t k = 0; k < bodies.size(); ++k)
      std::copy_n(six(r, bodies[k]), kBodyBlock, six(right_.data(), static_cast<Offset>(k)));
    parts_[which].solve(right_.data(), left_.data());
    for (std::size_t k = 0; k < bodies.size(); ++k)
      std::copy_n(six(left_.data(), static_cast<Offset>(k)), kBodyBlock, six(told_.data(), reach_.own_slots[which][k]));
  }
  for (const Index which : reach_.aggregates) {
    double sum[kBodyBlock] = {};
    for (const Index body : domains_.members[at(which)])
      restrict_to_root(point(body), root_of(which), six(r, body), sum);
    std::copy_n(sum, kBodyBlock, told_of(which));
  }
  halo_.share(0, told_.data(), kBodyBlock);
  if (coarse_) coarse_->solve(told_of(0), moved_.data());
  for (std::size_t k = 0; k < reach_.seen.size(); ++k) {
    const Index body = reach_.seen[k], which = domains_.aggregate.empty() ? -1 : domains_.aggregate[at(body)];
    double sum[kBodyBlock] = {};
    for (Index slot = reach_.slot_offsets[k]; slot < reach_.slot_offsets[k + 1]; ++slot)
      for (Index i = 0; i < kBodyBlock; ++i) sum[i] = sum[i] + six(told_.data(), slot)[i];
    if (which >= 0) move_with_root(point(body), root_of(which), six(moved_.data(), which), sum);
    std::copy_n(sum, kBodyBlock, six(z, body));
  }
}

}  // namespace stiction::distributed
