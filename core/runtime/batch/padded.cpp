#include "stiction/padded.hpp"

#include <string>

#include "core/base/extents.hpp"
#include "core/runtime/check/expect.hpp"
#include "stiction/status.hpp"

namespace stiction {

template <class Real>
void PaddedLayout<Real>::add(Index room, std::span<const Cone> cones, bool overflowed, Offset first_mu) {
  if (room < 0) refuse("room = " + std::to_string(room) + ", expected a number of rows >= 0");
  const bool per_cone = !mu_offsets_.empty();
  if (env_row_offsets_.back() > 0 && per_cone != (first_mu >= 0))
    refuse("first_mu = " + std::to_string(first_mu) + ", but the environments before have mu " +
           (per_cone ? "per friction cone" : "per row") + ": have it one way for all");
  Index rows = 0;
  std::size_t fitting = 0;
  for (std::size_t c = 0; c < cones.size(); ++c) {
    if (cones[c].row_count < 1)
      refuse("cones[" + std::to_string(c) + "].row_count = " + std::to_string(cones[c].row_count) +
             ", expected at least 1");
    if (fitting < c || cones[c].row_count > room - rows) continue;
    rows += cones[c].row_count;
    ++fitting;
  }

  const Offset first_row = env_row_offsets_.back();
  Offset row = first_row;
  for (const Cone& cone : cones.first(fitting)) {
    cone_row_offsets_.back() = row;
    row += cone.row_count;
    cone_row_offsets_.push_back(row);
    cone_kind_.push_back(cone.kind);
    cone_group_.push_back(cone.group);
  }
  // One place more than there are cones: its row is where the last cone ends, which the next environment's is not.
  cone_row_offsets_.back() = row;
  cone_row_offsets_.push_back(first_row + room);
  cone_kind_.push_back(ConeKind::free);
  cone_group_.push_back(-1);

  if (first_mu >= 0) {
    mu_offsets_.resize(static_cast<std::size_t>(first_row), 0);
    for (const Cone& cone : cones.first(fitting)) {
      const bool friction = carries_friction(cone.kind);
      mu_offsets_.resize(mu_offsets_.size() + static_cast<std::size_t>(cone.row_count), friction ? first_mu++ : 0);
      if (friction) mu_count_ = larger_of(mu_count_, first_mu);
    }
    mu_offsets_.resize(static_cast<std::size_t>(first_row + room), 0);
  }

  const Offset matrix = row_offsets_.back();
  const Offset stride = matrix_rows_ == MatrixRows::by_room ? room : rows;
  row_offsets_.pop_back();
  for (Index i = 0; i < room; ++i) {
    row_offsets_.push_back(matrix + stride * (i < rows || matrix_rows_ == MatrixRows::by_room ? i : rows));
    row_counts_.push_back(i < rows ? rows : 0);
  }
  row_offsets_.push_back(matrix + Offset{room} * room);
  // A dense row stores columns 0, 1, 2, ...: one list of them serves all.
  column_offsets_.resize(static_cast<std::size_t>(first_row + room), 0);
  for (auto j = static_cast<Index>(column_.size()); j < room; ++j) column_.push_back(j);

  env_row_offsets_.push_back(first_row + room);
  env_cone_offsets_.push_back(static_cast<Offset>(cone_kind_.size()));
  env_row_counts_.push_back(rows);
  env_cone_counts_.push_back(static_cast<Index>(fitting));
  env_flags_.push_back(overflowed || fitting < cones.size() ? kFlagContactsDropped : 0U);
}

template <class Real>
ContactBatchView<Real> PaddedLayout<Real>::view(const PaddedNumbers<Real>& numbers, Law law) const noexcept {
  ContactBatchView<Real> view;
  view.env_count = env_count();
  view.cone_count = static_cast<Offset>(cone_kind_.size());
  view.row_count = row_count();
  view.nonzero_count = row_offsets_.back();
  view.env_row_offsets = env_row_offsets_.data();
  view.env_cone_offsets = env_cone_offsets_.data();
  view.env_row_counts = env_row_counts_.data();
  view.env_cone_counts = env_cone_counts_.data();
  view.env_flags = env_flags_.data();
  view.cone_kind = cone_kind_.data();
  view.cone_row_offsets = cone_row_offsets_.data();
  view.cone_group = cone_group_.data();
  view.row_offsets = row_offsets_.data();
  view.row_counts = row_counts_.data();
  view.column = column_.data();
  view.column_offsets = column_offsets_.data();
  view.column_count = static_cast<Offset>(column_.size());
  view.A = numbers.A;
  view.b = numbers.b;
  view.R = numbers.R;
  view.mu = numbers.mu;
  view.mu_offsets = mu_offsets_.empty() ? nullptr : mu_offsets_.data();
  view.mu_count = mu_count_;
  view.normal_last = row_order_ == RowOrder::normal_last;
  view.lo = numbers.lo;
  view.hi = numbers.hi;
  view.law = law;
  view.space = MemorySpace::host;
  return view;
}

template class PaddedLayout<float>;
template class PaddedLayout<double>;

}  // namespace stiction
