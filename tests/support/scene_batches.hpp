#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "bench/scenes/scenes.hpp"
#include "stiction/hash.hpp"
#include "stiction/solver.hpp"

/// Batches of the shared scenes, and the bits of an answer environment by environment.
namespace stiction::test {

/// Environments 0 .. envs-1 of a scene, under the law the scene is meant for.
inline ContactBatch<double> scene_batch(const std::string& scene, Offset envs, std::uint64_t seed, int size = 0) {
  Law law = Law::convex;
  for (const auto& info : scenes::list())
    if (info.name == scene) law = info.law;
  ContactBatch<double> batch(law);
  for (Offset e = 0; e < envs; ++e) batch.add(scenes::make(scene, seed, static_cast<std::uint64_t>(e), size).system);
  return batch;
}

/// A ragged batch: every scene, environments without rows, some on the dense and some on the sparse path.
inline ContactBatch<double> ragged_batch(Offset envs_each, std::uint64_t seed) {
  ContactBatch<double> batch(Law::coulomb);
  for (Offset e = 0; e < envs_each; ++e) {
    for (const auto& info : scenes::list()) {
      if (info.name == "pile" && e > 1) continue;
      batch.add(scenes::make(info.name, seed, static_cast<std::uint64_t>(e)).system);
    }
    batch.add(Environment<double>{});
  }
  return batch;
}

/// Hash of everything an environment was answered with: reactions, motion, and its status but for the solver's name.
template <class Real>
std::uint64_t env_hash(const ContactBatch<Real>& batch, const Solution<Real>& solution, Offset env) {
  const auto& offsets = batch.arrays().env_row_offsets;
  const auto first = static_cast<std::size_t>(offsets[static_cast<std::size_t>(env)]);
  const auto count = static_cast<std::size_t>(offsets[static_cast<std::size_t>(env) + 1]) - first;
  const EnvStatus& status = solution.status[static_cast<std::size_t>(env)];
  const double record[] = {status.residual, status.residual_absolute, static_cast<double>(status.flags),
                           static_cast<double>(status.iterations), static_cast<double>(status.code)};
  std::uint64_t hash = hash_bits(std::span<const Real>(solution.lambda).subspan(first, count));
  hash = hash * 0x100000001b3ULL + hash_bits(std::span<const Real>(solution.w).subspan(first, count));
  return hash * 0x100000001b3ULL + hash_bits(std::span<const double>(record));
}

template <class Real>
std::vector<std::uint64_t> env_hashes(const ContactBatch<Real>& batch, const Solution<Real>& solution) {
  std::vector<std::uint64_t> hashes;
  for (Offset e = 0; e < batch.env_count(); ++e) hashes.push_back(env_hash(batch, solution, e));
  return hashes;
}

/// Solves and hashes; the environments' hashes in the batch's order.
template <class Real>
std::vector<std::uint64_t> solve_hashes(const ContactBatch<Real>& batch, const SolverOptions& options,
                                        std::span<const Real> warm_start = {}) {
  return env_hashes(batch, solve(batch, options, Device::cpu(), warm_start));
}

}  // namespace stiction::test
