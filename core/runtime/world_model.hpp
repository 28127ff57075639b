#pragma once

#include <vector>

#include "core/job/world_job.hpp"

namespace stiction {

/// \throws Error(invalid_argument) that names what is out of range, its value and the rule.
void check_description(const WorldDescription& description);

/// A description as kernels read it.
template <class Real>
class WorldModel {
 public:
  WorldModel(const WorldDescription& description, const WorldOptions& options);
  [[nodiscard]] const WorldModelView<Real>& view() const { return view_; }

 private:
  std::vector<WorldBodyData<Real>> body_;
  std::vector<WorldShapeData<Real>> shape_;
  std::vector<WorldPair<Real>> pair_;
  WorldModelView<Real> view_;
};

}  // namespace stiction
