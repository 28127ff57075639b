#pragma once

#include <limits>
#include <vector>

#include "tests/support/systems/scene_batches.hpp"

/// Batches on which a device is compared with the CPU.
namespace stiction::test {

/// Threads' and blocks' environments, sparse ones, empty ones, and one that is poisoned.
inline ContactBatch<double> twin_batch() {
  ContactBatch<double> batch = ragged_batch(3, 11);
  Environment<double> poisoned = scenes::make("walker", 11, 7).system;
  poisoned.b[4] = std::numeric_limits<double>::quiet_NaN();
  batch.add(poisoned);
  for (std::uint64_t e = 0; e < 40; ++e) batch.add(scenes::make("stack", 11, e, 1 + static_cast<int>(e % 3)).system);
  return batch;
}

/// One environment of each scene.
inline ContactBatch<double> small_twin_batch() {
  return ragged_batch(1, 11);
}

/// Batches that differ in numbers, contacts and counts, for one graph to answer.
inline std::vector<ContactBatch<float>> different_batches(int count, Offset envs) {
  std::vector<ContactBatch<float>> batches;
  for (int i = 0; i < count; ++i) {
    const char* const scene = i % 3 == 0 ? "mixed" : i % 3 == 1 ? "walker" : "stack";
    batches.push_back(convert<float>(scene_batch(scene, envs, 100 + static_cast<std::uint64_t>(i))));
    batches.back().set_law(Law::coulomb);
  }
  return batches;
}

}  // namespace stiction::test
