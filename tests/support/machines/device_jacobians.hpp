#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "core/facade/newton_job.hpp"
#include "cuda/emulated/emulated_device.hpp"
#include "cuda/machine/contact_machine.hpp"
#include "cuda/machine/jacobian_machine.hpp"
#include "stiction/jacobian_solver.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/jacobian_answer.hpp"
#include "tests/support/systems/jacobian_systems.hpp"
#include "tests/support/systems/roomy_jacobians.hpp"

/// Jacobian batches on an emulated device, and answers to compare with.
namespace stiction::test {

/// A form of Jacobian batches.
struct Form {
  MassForm mass = MassForm::matrix;
  Index mass_block = 0;
  bool sparse = false;
  FactorUse use = FactorUse::by_size;
  SolverKind solver = SolverKind::npgs;
};

/// Small environments, empty ones, one without degrees of freedom and one that is a factor by its size.
template <class Real>
JacobianBatch<Real> random_batch(std::uint64_t seed, const Form& form) {
  const Index block = form.mass_block;
  JacobianBatch<Real> batch(seed % 2 == 0 ? Law::convex : Law::coulomb, form.mass, block);
  const auto add = [&](const JacobianRecipe& recipe) {
    JacobianEnvironment<double> env = random_jacobian(recipe);
    if (form.sparse) thin_out(env);
    batch.add(cast<Real>(env));
  };
  const auto small = static_cast<int>(seed % 4);
  add({seed, 1 + small, 2, 12, block});
  add({seed + 100, 0, 0, 6, block});
  add({seed + 200, 25, 9, 18, block});
  add({seed + 300, small, 3, 6, block});
  add({seed + 400, 1, 1, 0, block});
  add({seed + 500, 4, small, 24, block});
  add({seed + 600, 0, 0, 6, block});
  return batch;
}

template <class Real>
SolverOptions some_iterations(SolverKind solver = SolverKind::npgs) {
  SolverOptions options;
  options.solver = solver;
  options.tolerance = 1e-5;
  options.max_iterations = 24;
  options.invalid = InvalidPolicy::isolate;
  options.threads = 1;
  return options;
}

/// An answer, filled with rubbish before the solve.
template <class Real>
struct Answer : JacobianAnswer<Real> {
  explicit Answer(const JacobianBatchView<Real>& room) : JacobianAnswer<Real>(room, kRubbish) {}
  static constexpr Real kRubbish = Real(-77);
};

/// One environment's answer is that of the same environment of a packed batch.
template <class Real>
void expect_env(const JacobianBatchView<Real>& batch, const Answer<Real>& answer, Offset env,
                const JacobianBatchView<Real>& packed, const JacobianSolution<Real>& expected) {
  SCOPED_TRACE("env " + std::to_string(env));
  const auto part = [](const std::vector<Real>& all, Offset first, Offset count) {
    return std::span<const Real>(all).subspan(static_cast<std::size_t>(first), static_cast<std::size_t>(count));
  };
  const Offset rows = packed.env_rows(env), row = expected.env_row_offsets[static_cast<std::size_t>(env)];
  const Offset own = batch.env_row_offsets[env];
  EXPECT_TRUE(same_bits(part(expected.contact.lambda, row, rows), part(answer.lambda, own, rows)));
  EXPECT_TRUE(same_bits(part(expected.contact.w, row, rows), part(answer.w, own, rows)));
  EXPECT_TRUE(same_bits(part(expected.velocity, packed.env_dof_offsets[env], packed.env_dofs(env)),
                        part(answer.velocity, batch.env_dof_offsets[env], packed.env_dofs(env))));
  const auto place = static_cast<std::size_t>(env);
  EXPECT_TRUE(
      same_bits(std::span(expected.contact.status).subspan(place, 1), std::span(answer.status).subspan(place, 1)));
}

template <class Real>
void expect_all(const JacobianBatchView<Real>& batch, const Answer<Real>& answer, const JacobianBatchView<Real>& packed,
                const JacobianSolution<Real>& expected) {
  for (Offset env = 0; env < packed.env_count; ++env) expect_env(batch, answer, env, packed, expected);
}

/// Parts of JacobianSolver, on a device of the test's.
template <class Real>
struct Machine {
  Machine(const std::shared_ptr<cuda::DeviceApi>& device, const JacobianCapacity& capacity, FactorUse use,
          const SolverOptions& chosen = some_iterations<Real>(), const cuda::VelocityRules& rules = {})
      : options(chosen), machine(device), jacobian(device, capacity, use, takes_newton(chosen), false, rules) {
    machine.reserve({capacity.envs, capacity.rows, capacity.cones, capacity.matrix, capacity.env_rows,
                     Offset{capacity.env_rows} * capacity.env_rows, capacity.env_dofs, Precision::f64},
                    options.solver);
  }
  void solve(const JacobianBatchView<Real>& batch, const JacobianSolutionView<Real>& solution, StreamRef stream) {
    if (takes_newton(options)) jacobian.solve_velocities(newton_job<Real>(batch, options, solution, {}), stream);
    jacobian.queue_rest(batch, stream, [&](StreamRef own) {
      const ContactBatchView<Real> contact = jacobian.assemble(batch, own);
      machine.solve(SolveRequest<Real>{
          nullptr, contact, {solution.lambda, solution.w, solution.status}, nullptr, contact.law, options, own});
    });
    jacobian.write(batch, solution, stream);
  }

  SolverOptions options;
  cuda::DeviceContactMachine machine;
  cuda::DeviceJacobianMachine<Real> jacobian;
};

}  // namespace stiction::test
