#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "scenes/scenes.hpp"
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

/// One environment of a batch, to be added to another.
template <class Real>
Environment<Real> environment_of(const ContactBatchView<Real>& batch, Offset env) {
  Environment<Real> one;
  const Offset row = batch.env_row_offsets[env], cone = batch.env_cone_offsets[env];
  const Index rows = batch.env_rows(env);
  for (Index c = 0; c < batch.env_cones(env); ++c)
    one.cones.push_back({batch.cone_kind[cone + c],
                         static_cast<Index>(batch.cone_row_offsets[cone + c + 1] - batch.cone_row_offsets[cone + c]),
                         batch.cone_group == nullptr ? -1 : batch.cone_group[cone + c]});
  const Offset entry = batch.row_offsets[row], last = batch.row_offsets[row + rows];
  for (Index i = 0; i < rows; ++i)
    one.row_offsets.push_back(static_cast<Index>(batch.row_offsets[row + i + 1] - entry));
  one.column.assign(batch.column + entry, batch.column + last);
  one.A.assign(batch.A + entry, batch.A + last);
  for (const auto& [to, from] : {std::pair{&one.b, batch.b}, std::pair{&one.R, batch.R}, std::pair{&one.mu, batch.mu},
                                 std::pair{&one.lo, batch.lo}, std::pair{&one.hi, batch.hi}})
    to->assign(from + row, from + row + rows);
  return one;
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
