#pragma once

#include <cstdint>
#include <vector>

#include "core/base/extents.hpp"
#include "core/plan/islands.hpp"
#include "scenes/merge.hpp"
#include "tests/support/systems/random_systems.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/small_systems.hpp"

/// Environments of several islands, and the islands as separate environments.
namespace stiction::test {

inline SolverOptions apart(SolverOptions options) {
  options.islands = IslandMode::apart;
  return options;
}

inline Environment<double> random_system(std::uint64_t seed, int contacts = 3, int others = 3) {
  Recipe recipe;
  recipe.seed = seed;
  recipe.contacts = contacts;
  recipe.others = others;
  return random_contacts(recipe);
}

/// Systems of one island each. Between them they have every kind of cone, boxes, manifolds, easy ones and hard ones,
/// all but the last few small. `tall` is a stack that is solved sparsely.
inline std::vector<Environment<double>> systems(std::uint64_t seed, bool tall) {
  std::vector<Environment<double>> all{random_system(seed),           random_system(seed + 1, 1, 0),
                                       random_system(seed + 2, 0, 1), scenes::make("stack", seed, 0, 2).system,
                                       random_system(seed + 3, 6, 2), scenes::make("grasp", seed, 1, 2).system};
  if (tall) all.push_back(scenes::make("stack", seed, 1, 16).system);
  for (double& b : all[1].b) b *= 1e3;  // scales differ from island to island
  for (double& b : all[4].b) b *= 1e-4;
  std::erase_if(all, [](const Environment<double>& one) { return find_islands(batch_of({one}).view()).count[0] != 1; });
  return all;
}

/// Merged environments among others, and their systems as environments of a separate batch.
template <class Real>
struct Family {
  explicit Family(Law law = Law::coulomb) : whole(law), alone(law) {
    ContactBatch<double> merged_batch(law), system_batch(law);
    for (std::uint64_t e = 0; e < 4; ++e) {
      const auto parts = systems(10 * e + 1, e == 2);
      merged.push_back(scenes::merge(parts, e));
      env.push_back(merged_batch.env_count());
      merged_batch.add(merged.back().system);
      merged_batch.add(e == 1 ? Environment<double>{} : random_system(77 + e));
      first_system.push_back(system_batch.env_count());
      for (const auto& part : parts) system_batch.add(part);
    }
    whole = convert<Real>(merged_batch);
    alone = convert<Real>(system_batch);
    for (Offset row = 0; row < whole.row_count(); ++row) warm.push_back(Real(0.01) * static_cast<Real>(row % 7));
    warm_alone.resize(at(alone.row_count()));
    each_row([&](std::size_t there, std::size_t here) { warm_alone[there] = warm[here]; });
  }

  /// visit(row of the systems' batch, row of the merged one)
  template <class Visit>
  void each_row(const Visit& visit) const {
    for (std::size_t m = 0; m < merged.size(); ++m)
      for (std::size_t s = 0; s < merged[m].rows.size(); ++s)
        for (std::size_t i = 0; i < merged[m].rows[s].size(); ++i)
          visit(at(alone.arrays().env_row_offsets[at(first_system[m]) + s]) + i,
                at(whole.arrays().env_row_offsets[at(env[m])]) + at(merged[m].rows[s][i]));
  }

  ContactBatch<Real> whole, alone;
  std::vector<Real> warm, warm_alone;
  std::vector<scenes::Merged> merged;
  std::vector<Offset> env, first_system;  ///< place in `whole`; place of its first system in `alone`
};

}  // namespace stiction::test
