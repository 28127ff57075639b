#pragma once

#include <array>
#include <span>
#include <vector>

#include "core/base/extents.hpp"
#include "core/job/world_job.hpp"

namespace stiction {

/// \throws Error(invalid_argument) that names the value out of range and the rule.
void check_description(const WorldDescription& description);
void check_world_options(const WorldOptions& options);

/// Normalises a quaternion, in double, into four numbers. One without a direction leaves them as they are.
template <class Real>
void put_unit(const std::array<double, 4>& quaternion, Real* to);

/// Shapes up to which all pairs of an environment are listed once and tested in every step. More are sorted into a
/// tree in every step. Both find the same contacts, so this reaches speed and memory only (docs/howto/stepping.md).
inline constexpr std::size_t kMostListed = 128;

/// A description as kernels read it.
template <class Real>
class WorldModel {
 public:
  WorldModel(const WorldDescription& description, const WorldOptions& options, std::size_t most_listed = kMostListed);
  /// The world's shapes and some bodies of another model, in its order, with their data there. A tree finds their
  /// pairs. `bodies`: their places there, ascending.
  WorldModel(const WorldModelView<Real>& whole, std::span<const Index> bodies);
  WorldModel(const WorldModel&) = delete;
  WorldModel& operator=(const WorldModel&) = delete;
  [[nodiscard]] const WorldModelView<Real>& view() const { return view_; }
  /// The description's shape that kernels have in a place of theirs; in a model of some bodies, the whole's.
  [[nodiscard]] Index described(Index shape) const { return order_[at(shape)]; }

 private:
  /// Points the view at the arrays.
  void view_arrays();

  std::vector<Index> order_;
  std::vector<WorldBodyData<Real>> body_;
  std::vector<WorldShapeData<Real>> shape_;
  std::vector<BodyShapes> shapes_of_;
  std::vector<WorldPair<Real>> pair_;
  WorldModelView<Real> view_{};
};

}  // namespace stiction
