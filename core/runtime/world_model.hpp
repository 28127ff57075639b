#pragma once

#include <vector>

#include "core/base/extents.hpp"
#include "core/job/world_job.hpp"

namespace stiction {

/// \throws Error(invalid_argument) that names what is out of range, its value and the rule.
void check_description(const WorldDescription& description);

/// Shapes up to which all pairs of an environment are listed once and tested in every step. More are sorted into a
/// tree in every step. Both find the same contacts, so this reaches speed and memory only (docs/stepping.md).
inline constexpr std::size_t kMostListed = 128;

/// A description as kernels read it.
template <class Real>
class WorldModel {
 public:
  WorldModel(const WorldDescription& description, const WorldOptions& options, std::size_t most_listed = kMostListed);
  WorldModel(const WorldModel&) = delete;
  WorldModel& operator=(const WorldModel&) = delete;
  [[nodiscard]] const WorldModelView<Real>& view() const { return view_; }
  /// The description's shape that kernels have in a place of theirs.
  [[nodiscard]] Index described(Index shape) const { return order_[at(shape)]; }

 private:
  std::vector<Index> order_;
  std::vector<WorldBodyData<Real>> body_;
  std::vector<WorldShapeData<Real>> shape_;
  std::vector<BodyShapes> shapes_of_;
  std::vector<WorldPair<Real>> pair_;
  WorldModelView<Real> view_{};
};

}  // namespace stiction
