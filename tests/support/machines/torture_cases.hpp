#pragma once

#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "core/plan/plan.hpp"
#include "cuda/emulated/emulated_device.hpp"
#include "cuda/machine/engine.hpp"
#include "scenes/scenes.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/small_systems.hpp"

/// One environment solved on the emulated device's teams of every width, by threads that race unless the algorithm
/// syncs, in memory that is not zero. Each must give the bits of the public solver.
namespace stiction::test {

/// More lanes than leaves of a sum, fewer, odd, one.
inline constexpr Index kWidths[] = {1, 2, 3, 8, 16, 33};

/// Cones of every kind a scene has: joints, joint friction, limits, torsional contacts.
inline Environment<double> small_dense() {
  return scenes::make("grasp", 5, 0, 2).system;
}
/// A stack too tall to be dense: many colours, manifolds of four contacts.
inline Environment<double> small_sparse() {
  return scenes::make("stack", 5, 0, 16).system;
}

/// Options of a chunk and a part of one.
inline SolverOptions torture_options(SolverKind solver) {
  SolverOptions result = options(solver, 1e-3, 5);
  result.invalid = InvalidPolicy::isolate;
  return result;
}

/// A guess of that many reactions, or none.
template <class Real>
std::vector<Real> torture_guess(bool warm, Offset rows) {
  std::vector<Real> guess;
  for (Offset i = 0; warm && i < rows; ++i) guess.push_back(static_cast<Real>(static_cast<double>(i % 5) * 0.125));
  return guess;
}

/// A batch solved by teams of `width` lanes, an environment at a time, whatever its size. The emulated device's memory
/// is the host's: a read before a write would show.
template <class Real>
Solution<Real> solve_on_teams(const ContactBatch<Real>& batch, const SolverOptions& options, Index width,
                              const std::vector<Real>& guess = {}) {
  const auto rows = static_cast<std::size_t>(batch.row_count());
  const Real none = std::numeric_limits<Real>::quiet_NaN();
  Solution<Real> solution{std::vector<Real>(rows, none), std::vector<Real>(rows, none),
                          std::vector<EnvStatus>(static_cast<std::size_t>(batch.env_count()))};
  ContactBatchView<Real> view = batch.view();
  view.space = MemorySpace::cuda;
  cuda::EmulatedDevice device({width, 2, static_cast<std::uint64_t>(width)});
  cuda::Engine engine(device, cuda::ClassRules::from(SizeClass::dense_block));
  engine.reserve(Capacity::of(batch.view()), options.solver, Capacity::of(batch.view()).precision);
  const cuda::Stream stream(device);
  engine.solve(SolveRequest<Real>{nullptr,
                                  view,
                                  {solution.lambda.data(), solution.w.data(), solution.status.data()},
                                  guess.empty() ? nullptr : guess.data(),
                                  batch.law(),
                                  options,
                                  StreamRef(stream.get())});
  device.synchronize(stream.get());
  return solution;
}

template <class Real>
void expect_the_same_on_teams(const ContactBatch<Real>& batch, const SolverOptions& options, bool warm) {
  const std::vector<Real> guess = torture_guess<Real>(warm, batch.row_count());
  const Solution<Real> expected = solve(batch, options, Device::cpu(), std::span<const Real>(guess));
  for (const Index width : kWidths)
    EXPECT_TRUE(same_bits(expected, solve_on_teams(batch, options, width, guess)))
        << label(options.solver, batch.law()) << ", " << (sizeof(Real) == 4 ? "f32" : "f64") << ", width " << width;
}

/// Runs both laws and precisions of a solver on both kinds of system.
inline void torture_solver(SolverKind solver) {
  const SolverOptions options = torture_options(solver);
  for (const Law law : kBothLaws) {
    const ContactBatch<double> dense = batch_of({small_dense()}, law), sparse = batch_of({small_sparse()}, law);
    ASSERT_EQ(make_plan(dense.view()).path[0], EnvPath::dense);
    ASSERT_EQ(make_plan(sparse.view()).path[0], EnvPath::sparse);
    const bool warm = law == Law::coulomb;
    expect_the_same_on_teams(convert<float>(dense), options, warm);
    expect_the_same_on_teams(dense, options, warm);
    expect_the_same_on_teams(convert<float>(sparse), options, !warm);
    expect_the_same_on_teams(sparse, options, !warm);
  }
}

}  // namespace stiction::test
