#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "stiction/jacobian.hpp"
#include "tests/support/golden/case.hpp"
#include "tests/support/golden/matrices.hpp"
#include "tests/support/systems/box_jacobians.hpp"
#include "tests/support/systems/jacobian_systems.hpp"
#include "tests/support/systems/roomy_jacobians.hpp"
#include "tests/support/systems/velocity_cases.hpp"

/// Golden rows of Jacobian batches. "jacobian/..." is for every form of J and M, "factor/..." for environments whose A
/// is kept as a factor. "jacobian/chains/..." have no A.
namespace stiction::test {

struct GoldenJacobian {
  const char* name;
  Index mass_block;
  MassForm mass;
  bool sparse;
};

/// The lower triangle of a random M, read as a factor, is one: its diagonal is positive.
inline constexpr GoldenJacobian kGoldenJacobians[] = {{"dense", 0, MassForm::matrix, false},
                                                      {"sparse", 0, MassForm::matrix, true},
                                                      {"diagonal", 1, MassForm::matrix, false},
                                                      {"blocks", 6, MassForm::matrix, true},
                                                      {"cholesky", 0, MassForm::factor, false}};

/// Small environments, empty ones, one without degrees of freedom and one that is a factor by its size.
template <class Real>
JacobianBatch<Real> golden_jacobians(const GoldenJacobian& form, Law law) {
  const Index block = form.mass_block;
  JacobianBatch<Real> batch(law, form.mass, block);
  for (const JacobianRecipe& recipe :
       {JacobianRecipe{kGoldenSeed, 3, 2, 12, block}, JacobianRecipe{1, 0, 0, 6, block},
        JacobianRecipe{2, 25, 9, 18, block}, JacobianRecipe{3, 2, 3, 6, block}, JacobianRecipe{4, 1, 1, 0, block},
        JacobianRecipe{5, 4, 1, 24, block}, JacobianRecipe{6, 3, 2, 12, block}}) {
    JacobianEnvironment<double> env = random_jacobian(recipe);
    if (form.sparse) thin_out(env);
    batch.add(cast<Real>(env));
  }
  return batch;
}

template <class Real>
std::uint64_t jacobian_hash(const JacobianSolution<Real>& solution) {
  return Digest()
      .add(solution.contact.lambda)
      .add(solution.contact.w)
      .add(solution.velocity)
      .add(std::span<const EnvStatus>(solution.contact.status))
      .value();
}

/// Adds the results of assemble(), on the CPU whatever the device, and of a solve of the form.
inline void add_jacobian_goldens(GoldenCases& cases) {
  for (const GoldenJacobian& form : kGoldenJacobians) {
    const std::string name = std::string("jacobian/") + form.name;
    for (const auto& [use, suffix] : {std::pair{FactorUse::never, "assembled"}, {FactorUse::always, "factored"}})
      add_precisions(cases, name + "/" + suffix, [form, use = use](auto real, Device) {
        const auto batch = assemble(golden_jacobians<decltype(real)>(form, Law::convex).view(), use, 1);
        return Digest().add(batch.arrays().A).add(batch.arrays().factor).add(batch.arrays().b).value();
      });
    for (const SolverKind solver : {SolverKind::npgs, SolverKind::automatic})
      add_laws(cases, name + "/" + to_string(solver), [form, solver](auto real, Law law, Device device) {
        const auto batch = golden_jacobians<decltype(real)>(form, law);
        return jacobian_hash(solve(batch, golden_options(solver), device));
      });
  }
}

/// Newton's method in velocities, to a tolerance: cold, and from the answer less a twentieth.
inline void add_velocity_goldens(GoldenCases& cases) {
  for (const double start : {0.0, 0.95})
    add_laws(cases, std::string("jacobian/chains/") + (start > 0.0 ? "warm" : "cold"),
             [start](auto real, Law law, Device device) {
               using Real = decltype(real);
               JacobianBatch<Real> batch(law);
               for (std::uint64_t seed = 1; seed <= 7; ++seed)
                 batch.add(cast<Real>(random_chain({seed, static_cast<Index>(3 + 2 * seed),
                                                    seed % 2 == 0 ? cones_of_every_kind() : ChainRecipe{}.cones, 0.0,
                                                    seed == 7 ? 0.0 : 0.01})));
               SolverOptions options = golden_options(SolverKind::automatic);
               options.tolerance = sizeof(Real) == sizeof(float) ? 1e-4 : 1e-8;
               options.max_iterations = 200;
               auto guess = solve(batch, options).contact.lambda;
               for (Real& reaction : guess) reaction = reaction * static_cast<Real>(start);
               if (start == 0.0) guess.clear();
               return jacobian_hash(solve(batch, options, device, std::span<const Real>(guess)));
             });
}

/// Chains, and bodies of which more than 64 degrees of freedom are coupled, with M and with its factor.
inline void add_large_and_factored_goldens(GoldenCases& cases) {
  for (const MassForm form : {MassForm::matrix, MassForm::factor})
    add_laws(cases, std::string("jacobian/bodies/") + (form == MassForm::matrix ? "matrix" : "cholesky"),
             [form](auto real, Law law, Device device) {
               using Real = decltype(real);
               JacobianBatch<Real> batch(law, form);
               const auto add = [&](const JacobianEnvironment<double>& env) {
                 batch.add(cast<Real>(in_form(form == MassForm::factor ? reversed(env) : env, form)));
               };
               for (std::uint64_t seed = 1; seed <= 5; ++seed) {
                 add(random_chain({seed, static_cast<Index>(3 + 4 * seed), cones_of_every_kind()}));
                 add(bodies_in_contact({seed, 9 + 2 * seed, 3, 2 * seed}));
               }
               SolverOptions options = golden_options(SolverKind::automatic);
               options.tolerance = sizeof(Real) == sizeof(float) ? 1e-4 : 1e-8;
               options.max_iterations = 200;
               return jacobian_hash(solve(batch, options, device));
             });
}

/// Boxes on boxes: more than 64 coupled degrees of freedom, which Newton's method takes in blocks. With each form of M,
/// J in stored entries.
inline void add_block_goldens(GoldenCases& cases) {
  for (const MassForm form : {MassForm::matrix, MassForm::factor})
    add_laws(cases, std::string("jacobian/boxes/") + (form == MassForm::matrix ? "matrix" : "cholesky"),
             [form](auto real, Law law, Device device) {
               using Real = decltype(real);
               JacobianBatch<Real> batch(law, form, 6);
               for (const auto& scene : {scenes::box_tower(12), scenes::box_wall(4, 4), scenes::box_pyramid(3)})
                 batch.add(cast<Real>(
                     in_form(boxes_as_jacobian(scene, {.compliance = 1e-3, .heavy = 10.0, .push = 0.5}), form, 6)));
               SolverOptions options = golden_options(SolverKind::automatic);
               options.tolerance = sizeof(Real) == sizeof(float) ? 1e-4 : 1e-8;
               options.max_iterations = 200;
               return jacobian_hash(solve(batch, options, device));
             });
}

/// Every solver on environments that are all kept as factors.
inline void add_factor_goldens(GoldenCases& cases) {
  std::vector<SolverKind> solvers(std::begin(kEverySolver), std::end(kEverySolver));
  solvers.push_back(SolverKind::automatic);
  for (const SolverKind solver : solvers)
    for (const Law law : kBothLaws) {
      if (!answers_in_its_own_way(solver, law)) continue;
      add_law(cases, std::string("factor/random/") + to_string(solver), law,
              [solver](auto real, Law now, Device device) {
                const auto batch = golden_jacobians<decltype(real)>(kGoldenJacobians[0], now);
                return jacobian_hash(solve(batch, golden_options(solver), device, {}, FactorUse::always));
              });
    }
}

}  // namespace stiction::test
