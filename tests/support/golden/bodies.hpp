#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "scenes/body_scenes.hpp"
#include "scenes/box_scenes.hpp"
#include "tests/support/golden/case.hpp"
#include "tests/support/golden/matrices.hpp"
#include "tests/support/systems/body_systems.hpp"
#include "tests/support/systems/worlds.hpp"

/// Golden rows of rigid bodies: "bodies/..." for one step, "worlds/..." for many.
namespace stiction::test {

/// A way to solve bodies, by the name it has in the table.
struct GoldenMethod {
  std::string name;
  BodySolverOptions options;
  bool warm = false;
};

inline BodySolverOptions golden_impulses() {
  BodySolverOptions options;
  options.iterations = kGoldenIterations;
  options.threads = 1;
  return options;
}
inline BodySolverOptions golden_newton(const BodySpaceOptions& space) {
  BodySolverOptions options;
  options.method = BodyMethod::newton;
  options.space = space;
  options.iterations = 6;
  options.threads = 1;
  return options;
}

/// Sequential impulses with each of their options, and Newton's method with each preconditioner.
inline std::vector<GoldenMethod> golden_methods() {
  std::vector<GoldenMethod> methods{{"si momentum", golden_impulses()},  {"si plain", golden_impulses()},
                                    {"si substeps", golden_impulses()},  {"si omega 1.3", golden_impulses()},
                                    {"si 9 deepest", golden_impulses()}, {"si warm", golden_impulses(), true},
                                    {"si pairs", golden_impulses()}};
  methods[1].options.momentum = false;
  methods[2].options.substeps = 3;
  methods[3].options.omega = 1.3;
  methods[4].options.max_contacts_per_env = 9;
  methods[6].options.blocks = BlockMode::pairs;
  for (int k = 0; k < kBodyPreconditionerCount; ++k) {
    BodySpaceOptions space;
    space.preconditioner = static_cast<BodyPreconditioner>(k);
    methods.push_back({std::string("newton ") + to_string(space.preconditioner), golden_newton(space)});
  }
  return methods;
}

/// Boxed friction, which no law of the options reaches, by sequential impulses with options that differ.
inline std::vector<GoldenMethod> golden_boxed_methods() {
  std::vector<GoldenMethod> methods{{"si boxed", golden_impulses()},
                                    {"si boxed plain substeps", golden_impulses()},
                                    {"si boxed warm", golden_impulses(), true}};
  for (GoldenMethod& method : methods) method.options.box_friction = true;
  methods[1].options.momentum = false;
  methods[1].options.substeps = 3;
  return methods;
}

/// Adds the changes by a preconditioner's own options; the orderings are those that every build has.
inline void add_orderings(std::vector<GoldenMethod>& methods) {
  for (const BodyPreconditioner ordered : {BodyPreconditioner::incomplete_cholesky, BodyPreconditioner::factor}) {
    BodySpaceOptions space;
    space.preconditioner = ordered;
    space.ordering = Ordering::natural;
    methods.push_back({std::string("newton ") + to_string(ordered) + " natural", golden_newton(space)});
  }
}
inline GoldenMethod golden_multigrid(const std::string& name, Prolongation prolongation, Cycle cycle) {
  BodySpaceOptions space;
  space.multigrid = {prolongation, cycle};
  return {"newton " + name, golden_newton(space)};
}

struct GoldenBodies {
  std::string name;
  std::vector<BodyEnvironment<double>> envs;
  TimeStepping stepping;
  std::vector<GoldenMethod> methods;
};

/// Between them they have environments that share a pack, one that is too large for it, and an empty one. There are
/// bodies that are moved, bounces, gaps, overlaps, contacts that yield and contacts that do not. There are one, two
/// and three levels of multigrid.
inline std::vector<GoldenBodies> golden_bodies() {
  const std::vector<GoldenMethod> all = golden_methods();
  GoldenBodies crowd{"crowd", {}, {}, all}, stack{"stack", {}, {}, all}, pile{"pile", {}, {}, all},
      wall{"wall", {}, {}, all}, high{"high wall", {}, {}, {}};
  for (std::uint64_t e = 0; e < 20; ++e)
    crowd.envs.push_back(
        random_bodies(kGoldenSeed + e, 2 + static_cast<Index>(e % 5), 1 + static_cast<Index>(7 * e % 23)));
  crowd.envs.emplace_back();
  for (std::uint64_t e = 0; e < 3; ++e) stack.envs.push_back(scenes::make_body_stack(kGoldenSeed + e, 5));
  pile.envs = {scenes::make_body_pile(kGoldenSeed, 90)};
  wall.envs = {scenes::box_bodies(scenes::box_wall(9, 8), 0.5)};
  high.envs = {scenes::box_bodies(scenes::box_wall(20, 20), 0.5)};
  for (GoldenBodies* yielding : {&stack, &wall, &high}) yielding->stepping.cfm = 1e-4;
  add_orderings(pile.methods);
  add_orderings(wall.methods);
  // On the pile six steps are no better than the sweeps before them.
  for (GoldenMethod& method : pile.methods)
    if (method.options.method == BodyMethod::newton) method.options.iterations = 24;
  wall.methods.push_back(golden_multigrid("multigrid plain", Prolongation::plain, Cycle::v));
  high.methods = {golden_multigrid("multigrid", Prolongation::smoothed, Cycle::v),
                  golden_multigrid("multigrid plain", Prolongation::plain, Cycle::v),
                  golden_multigrid("multigrid w", Prolongation::smoothed, Cycle::w)};
  return {crowd, stack, pile, wall, high};
}

template <class Real>
std::uint64_t bodies_hash(const BodySolution<Real>& solution) {
  return Digest()
      .add(solution.impulse)
      .add(solution.twist)
      .add(solution.w)
      .add(std::span<const EnvStatus>(solution.status))
      .value();
}

inline void add_body_goldens(GoldenCases& cases) {
  for (GoldenBodies& scene : golden_bodies()) {
    const auto shared = std::make_shared<const GoldenBodies>(std::move(scene));
    const auto hash_of = [shared](const GoldenMethod& method) {
      return [=](auto real, Law law, Device device) {
        using Real = decltype(real);
        std::vector<BodyEnvironment<Real>> envs;
        for (const auto& env : shared->envs) envs.push_back(as<Real>(env));
        const BodyBatch<Real> batch = batch_of<Real>(envs);
        const auto warm = method.warm ? golden_warm_start<Real>(3 * batch.contact_count()) : std::vector<Real>{};
        BodySolverOptions options = method.options;
        options.law = law;
        return bodies_hash(solve_bodies(batch, shared->stepping, options, device, std::span<const Real>(warm)));
      };
    };
    const std::string name = "bodies/" + shared->name + "/";
    for (const GoldenMethod& method : shared->methods) add_laws(cases, name + method.name, hash_of(method));
    if (shared->name == "high wall") continue;
    for (const GoldenMethod& method : golden_boxed_methods())
      add_law(cases, name + method.name, Law::coulomb, hash_of(method));
  }
}

/// Long enough for all worlds to be in contact.
inline constexpr int kGoldenSteps = 90;

template <class Real>
std::uint64_t world_hash(const World<Real>& world) {
  Digest digest;
  digest.add(world.hash()).add(world.status()).add(hash_bits(world.impulses()));
  for (const Offset offset : world.contact_offsets()) digest.add(static_cast<std::uint64_t>(offset));
  for (const WorldMotion& motion : world.motion())
    digest.add(std::vector<double>{motion.kinetic, motion.potential, motion.momentum[0], motion.momentum[1],
                                   motion.momentum[2], motion.angular_momentum[0], motion.angular_momentum[1],
                                   motion.angular_momentum[2]});
  return digest.value();
}

inline void add_world_goldens(GoldenCases& cases) {
  const auto hash_of = [](const std::string& scene, const BodySolverOptions& solver) {
    return [=](auto real, Law law, Device device) {
      WorldOptions options;
      options.solver = solver;
      options.solver.law = law;
      auto world = started<decltype(real)>(scene, 3, options, device, kGoldenSeed);
      run(world, kGoldenSteps);
      return world_hash(world);
    };
  };
  for (const std::string& scene : scenes::world_names()) {
    add_laws(cases, "worlds/" + scene + "/si", hash_of(scene, golden_impulses()));
    add_laws(cases, "worlds/" + scene + "/newton", hash_of(scene, golden_newton({})));
  }
  for (const char* scene : {"pile", "walker"})
    add_law(cases, std::string("worlds/") + scene + "/si boxed", Law::coulomb,
            hash_of(scene, golden_boxed_methods().front().options));
}

}  // namespace stiction::test
