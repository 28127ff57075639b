#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stiction/types.hpp"
#include "tests/support/scene_batches.hpp"
#include "tests/support/small_systems.hpp"

/// The golden hashes: what every build, compiler and machine must answer within one numerics epoch.
namespace stiction::test {

struct GoldenScene {
  const char* scene;
  int size;
  Offset envs;
};

/// Between them: every kind of cone, both paths, environments without rows, numbers that no solver likes.
inline constexpr GoldenScene kGoldenScenes[] = {{"stack", 3, 5},      {"chain", 6, 5},   {"grasp", 0, 4},
                                                {"walker", 0, 5},     {"mixed", 48, 12}, {"pile", 30, 2},
                                                {"adversarial", 4, 8}};
inline constexpr std::uint64_t kGoldenSeed = 20;
/// Not a multiple of the chunk, and past one refresh of the motion.
inline constexpr Index kGoldenIterations = 22;

struct Golden {
  const char* scene;
  SolverKind solver;
  Precision precision;
  Law law;
  std::uint64_t hash;
};

inline const std::vector<Golden>& goldens() {
  static const std::vector<Golden> table{
#include "tests/support/golden.inc"
  };
  return table;
}

/// One number for a whole batch.
template <class Real>
std::uint64_t batch_hash(const ContactBatch<double>& scene, SolverKind solver, Law law, Device device = Device::cpu()) {
  SolverOptions options;
  options.solver = solver;
  options.law = law;
  options.tolerance = 0;
  options.max_iterations = kGoldenIterations;
  options.threads = 1;
  const ContactBatch<Real> batch = convert<Real>(scene);
  std::uint64_t hash = 0;
  for (const std::uint64_t env : env_hashes(batch, solve(batch, options, device))) hash = hash * 0x100000001b3ULL + env;
  return hash;
}

/// Scenes have friction cones, which lemke refuses; under the convex law nsgs takes the steps of pgs.
inline bool answers_in_its_own_way(SolverKind solver, Law law) {
  return solver != SolverKind::lemke && !(solver == SolverKind::nsgs && law == Law::convex);
}

/// The whole table, computed here and now; the order is that of golden.inc.
inline std::vector<Golden> compute_goldens(Device device = Device::cpu()) {
  std::vector<Golden> result;
  for (const GoldenScene& golden : kGoldenScenes) {
    const ContactBatch<double> scene = scene_batch(golden.scene, golden.envs, kGoldenSeed, golden.size);
    for (const SolverKind solver : kEverySolver)
      for (const Law law : {Law::convex, Law::coulomb}) {
        if (!answers_in_its_own_way(solver, law)) continue;
        result.push_back({golden.scene, solver, Precision::f32, law, batch_hash<float>(scene, solver, law, device)});
        result.push_back({golden.scene, solver, Precision::f64, law, batch_hash<double>(scene, solver, law, device)});
      }
  }
  return result;
}

}  // namespace stiction::test
