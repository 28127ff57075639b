#pragma once

#include <string>
#include <vector>

#include "scenes/scenes.hpp"
#include "stiction/io.hpp"
#include "stiction/stiction.hpp"

namespace stiction::bench {

/// Environments of J and M by name: recordings of a folder, scenes.
struct JacobianCase {
  std::string name;
  Law law = Law::convex;
  Index mass_block = 0;
  std::vector<JacobianEnvironment<double>> envs;

  /// The first `count` environments; from the first on again where there are fewer.
  template <class Real>
  [[nodiscard]] JacobianBatch<Real> batch(std::size_t count) const;
};

/// The first environments of a recording of J and M that have rows. Environments without rows have no derivative to
/// speak of.
JacobianCase recorded_case(const std::string& path, std::size_t most);

/// Environments of a scene. R is 1e-4 of the mean diagonal of A, so that reactions are determined.
JacobianCase scene_case(const std::string& scene, std::size_t count);

}  // namespace stiction::bench
