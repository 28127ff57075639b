#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "stiction/box_friction.hpp"
#include "stiction/pyramid.hpp"
#include "tests/support/golden/case.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/semidefinite_systems.hpp"
#include "tests/support/systems/small_systems.hpp"

/// Golden rows of contact batches: "matrix/..." as scenes have them, "pyramid/..." without friction cones.
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
/// The scenes with fewer contacts, for methods that factorise: the baseline has its fused operations from the C
/// library.
inline constexpr GoldenScene kSmallGoldenScenes[] = {{"stack", 3, 5},      {"chain", 6, 5},  {"grasp", 0, 2},
                                                     {"walker", 0, 5},     {"mixed", 16, 4}, {"pile", 8, 2},
                                                     {"adversarial", 4, 4}};

inline ContactBatch<double> golden_batch(const GoldenScene& golden) {
  return scene_batch(golden.scene, golden.envs, kGoldenSeed, golden.size);
}

/// One number for a whole batch.
template <class Real>
std::uint64_t batch_hash(const ContactBatch<Real>& batch, const Solution<Real>& solution) {
  Digest digest;
  for (const std::uint64_t env : env_hashes(batch, solution)) digest.add(env);
  return digest.value();
}

inline SolverOptions golden_options(SolverKind solver) {
  return options(solver, 0, kGoldenIterations);
}

/// Scenes have friction cones, which lemke refuses; under the convex law nsgs takes the steps of pgs.
inline bool answers_in_its_own_way(SolverKind solver, Law law) {
  return solver != SolverKind::lemke && !(solver == SolverKind::nsgs && law == Law::convex);
}

using GoldenBatch = std::shared_ptr<const ContactBatch<double>>;

/// Numbers to start from, none of them an answer.
template <class Real>
std::vector<Real> golden_warm_start(Offset count) {
  std::vector<Real> warm(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < warm.size(); ++i) warm[i] = static_cast<Real>(i % 7) * Real(0.125) - Real(0.25);
  return warm;
}

/// Hash of a batch's answer under one law.
struct HashOfMatrix {
  GoldenBatch scene;
  SolverOptions options;
  bool warm = false;

  template <class Real>
  std::uint64_t operator()(Real, Law law, Device device) const {
    SolverOptions lawful = options;
    lawful.law = law;
    const ContactBatch<Real> batch = convert<Real>(*scene);
    const std::vector<Real> start = warm ? golden_warm_start<Real>(batch.row_count()) : std::vector<Real>{};
    return batch_hash(batch, solve(batch, lawful, device, std::span<const Real>(start)));
  }
};

/// Every scene by every solver, and by auto. With tolerance 0 every stage of auto runs, else those that are needed.
inline void add_matrix_goldens(GoldenCases& cases) {
  for (const GoldenScene& golden : kGoldenScenes) {
    const auto scene = std::make_shared<const ContactBatch<double>>(golden_batch(golden));
    for (const SolverKind solver : kEverySolver)
      for (const Law law : kBothLaws)
        if (answers_in_its_own_way(solver, law))
          add_law(cases, std::string("matrix/") + golden.scene + "/" + to_string(solver), law,
                  HashOfMatrix{scene, golden_options(solver)});
  }
  for (const GoldenScene& golden : kSmallGoldenScenes) {
    const auto scene = std::make_shared<const ContactBatch<double>>(golden_batch(golden));
    const std::string name = std::string("matrix/small ") + golden.scene;
    add_laws(cases, name + "/auto", HashOfMatrix{scene, golden_options(SolverKind::automatic)});
    add_laws(cases, name + "/auto to 1e-6", HashOfMatrix{scene, options(SolverKind::automatic, 1e-6, 100)});
  }
}

/// Options that reach the bits (docs/reference/determinism.md), on environments of several islands.
inline void add_option_goldens(GoldenCases& cases) {
  const auto scene = std::make_shared<const ContactBatch<double>>(golden_batch(kGoldenScenes[4]));
  const auto add = [&](const std::string& name, const SolverOptions& options, bool warm = false) {
    add_laws(cases, "matrix/mixed/" + name, HashOfMatrix{scene, options, warm});
  };
  add("npgs warm", golden_options(SolverKind::npgs), true);
  add("admm warm", golden_options(SolverKind::admm), true);
  SolverOptions apart = golden_options(SolverKind::npgs);
  apart.islands = IslandMode::apart;
  add("npgs apart", apart);
  SolverOptions relaxed = golden_options(SolverKind::pgs);
  relaxed.omega = 1.3;
  add("pgs omega 1.3", relaxed);
  add("npgs to 1e-3", options(SolverKind::npgs, 1e-3, 1000));
  SolverOptions impatient = options(SolverKind::npgs, 0, 1000);
  impatient.stall_window = 32;
  add("npgs stall 32", impatient);
  const auto stacks = std::make_shared<const ContactBatch<double>>(golden_batch(kGoldenScenes[0]));
  SolverOptions blocks = golden_options(SolverKind::npgs);
  blocks.blocks = BlockMode::pairs;
  add_laws(cases, "matrix/stack/npgs pairs", HashOfMatrix{stacks, blocks});
  blocks.solver = SolverKind::nsgs;
  blocks.blocks = BlockMode::strong;
  add_laws(cases, "matrix/stack/nsgs strong", HashOfMatrix{stacks, blocks});
  const auto piles = std::make_shared<const ContactBatch<double>>(golden_batch(kGoldenScenes[5]));
  blocks.solver = SolverKind::pgs;
  add_laws(cases, "matrix/pile/pgs strong", HashOfMatrix{piles, blocks});
}

/// The batch with boxed friction in every other of its friction cones.
inline ContactBatch<double> half_boxed(const ContactBatch<double>& batch) {
  ContactBatch<double>::Arrays arrays = batch.arrays();
  std::size_t met = 0;
  for (ConeKind& kind : arrays.cone_kind)
    if (kind == ConeKind::friction && met++ % 2 == 1) kind = ConeKind::box_friction;
  return ContactBatch<double>::from_arrays(batch.law(), std::move(arrays));
}

/// Boxed friction. If all is boxed, no law of the batch reaches a bit, and nsgs visits as pgs does. Beside friction
/// cones both count.
inline void add_box_friction_goldens(GoldenCases& cases) {
  for (const std::size_t k : {0, 2, 4}) {
    const GoldenScene& golden = kGoldenScenes[k];
    const ContactBatch<double> scene = golden_batch(golden);
    const auto all = std::make_shared<const ContactBatch<double>>(with_box_friction(scene));
    const std::string name = std::string("matrix/boxed ") + golden.scene + "/";
    for (const SolverKind solver : {SolverKind::pgs, SolverKind::npgs, SolverKind::jacobi})
      add_law(cases, name + to_string(solver), Law::convex, HashOfMatrix{all, golden_options(solver)});
    const auto half = std::make_shared<const ContactBatch<double>>(half_boxed(scene));
    const std::string half_name = std::string("matrix/half boxed ") + golden.scene + "/";
    add_laws(cases, half_name + "npgs", HashOfMatrix{half, golden_options(SolverKind::npgs)});
    add_law(cases, half_name + "nsgs", Law::coulomb, HashOfMatrix{half, golden_options(SolverKind::nsgs)});
  }
}

/// Cones of semidefinite beside others, up to and beyond the rows that are dense without them.
inline void add_semidefinite_goldens(GoldenCases& cases) {
  ContactBatch<double> batch(Law::convex);
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    MatrixRecipe recipe;
    recipe.seed = seed;
    recipe.matrices = seed == 6 ? 16 : static_cast<int>(seed);
    recipe.contacts = static_cast<int>(seed % 3);
    batch.add(random_with_matrices(recipe));
  }
  const auto shared = std::make_shared<const ContactBatch<double>>(std::move(batch));
  for (const SolverKind solver : {SolverKind::jacobi, SolverKind::apgd, SolverKind::admm, SolverKind::automatic})
    add_laws(cases, std::string("matrix/semidefinite/") + to_string(solver),
             HashOfMatrix{shared, golden_options(solver)});
  add_laws(cases, "matrix/semidefinite/apgd warm", HashOfMatrix{shared, golden_options(SolverKind::apgd), true});
}

/// The environments of a batch with all friction zero, so that a pyramid is its normal row.
inline ContactBatch<double> without_friction(const ContactBatch<double>& batch) {
  ContactBatch<double> result(batch.law());
  for (Offset e = 0; e < batch.env_count(); ++e) {
    Environment<double> env = environment_of(batch.view(), e);
    env.mu.assign(env.mu.size(), 0.0);
    result.add(env);
  }
  return result;
}

/// Rows of pyramids instead of friction cones, which lemke answers; the hash holds the edges' answer and E f.
inline void add_pyramid_goldens(GoldenCases& cases) {
  const auto add = [&](const std::string& name, const GoldenBatch& scene, int sides) {
    for (const SolverKind solver : {SolverKind::lemke, SolverKind::pgs, SolverKind::ipm, SolverKind::automatic})
      add_precisions(cases, "pyramid/" + name + "/" + to_string(solver), [=](auto real, Device device) {
        using Real = decltype(real);
        const ContactBatch<Real> original = convert<Real>(*scene);
        const PyramidBatch<Real> pyramids = linearise(original, sides);
        const Solution<Real> solution =
            solve(pyramids.batch, options(solver, 1e-6, solver == SolverKind::lemke ? 2000 : 60), device);
        const auto back = reactions(pyramids, original, std::span<const Real>(solution.lambda));
        return Digest().add(batch_hash(pyramids.batch, solution)).add(back.lambda).add(back.w).value();
      });
  };
  for (const GoldenScene& golden : kSmallGoldenScenes) {
    const auto scene = std::make_shared<const ContactBatch<double>>(golden_batch(golden));
    add(std::string(golden.scene) + " 4 sides", scene, 4);
    if (std::string(golden.scene) == "walker") {
      add("walker 8 sides", scene, 8);
      add("walker 16 sides", scene, 16);
    }
    if (std::string(golden.scene) == "stack")
      add("stack without friction", std::make_shared<const ContactBatch<double>>(without_friction(*scene)), 4);
  }
}

}  // namespace stiction::test
