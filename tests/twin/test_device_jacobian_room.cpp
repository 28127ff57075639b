#include <gtest/gtest.h>

#include <memory>

#include "cuda/emulated/emulated_device.hpp"
#include "cuda/machine/jacobian_machine.hpp"
#include "stiction/jacobian_solver.hpp"
#include "tests/support/machines/device_jacobians.hpp"
#include "tests/support/systems/jacobian_systems.hpp"
#include "tests/support/systems/roomy_jacobians.hpp"

/// Memory that a device takes when a solver of Jacobian batches is made, so that a solve allocates and loads nothing.
namespace stiction::test {
namespace {

TEST(DeviceJacobianRoom, TheVeryFirstSolveCanBeCaptured) {
  for (const SolverKind solver : {SolverKind::automatic, SolverKind::npgs}) {
    const auto batch = random_batch<double>(5, {});
    const auto packed = batch.view();
    const SolverOptions chosen = some_iterations<double>(solver);
    const auto expected = solve(packed, chosen);
    const RoomyJacobians<double> arrays(packed, 0, 5);
    const auto view = arrays.view(MemorySpace::cuda);
    const auto device = std::make_shared<cuda::EmulatedDevice>();
    const cuda::Stream stream(*device);
    JacobianCapacity capacity = JacobianCapacity::of(packed);
    capacity.rows = view.row_count;
    capacity.cones = view.cone_count;
    Machine<double> machine(device, capacity, FactorUse::by_size, chosen);
    Answer<double> answer(view);
    device->begin_capture(stream.get());
    machine.solve(view, answer.view(), StreamRef(stream.get()));
    const auto graph = device->end_capture(stream.get());
    for (int again = 0; again < 2; ++again) device->launch(graph, stream.get());
    device->synchronize(stream.get());
    expect_all(view, answer, packed, expected);
  }
}

// The rows of one and the degrees of freedom of another are no environment of the batch.
TEST(DeviceJacobianRoom, ManyRowsWithoutDegreesOfFreedomFitBesideOthers) {
  JacobianBatch<double> batch(Law::convex);
  JacobianEnvironment<double> fixed = random_jacobian({1, 30, 3, 0, 0});
  fixed.J.clear();
  fixed.M.clear();
  fixed.v_free.clear();
  batch.add(fixed);
  batch.add(random_jacobian({2, 4, 3, 12, 0}));
  const auto packed = batch.view();
  for (const FactorUse use : {FactorUse::by_size, FactorUse::always}) {
    const auto expected = solve(packed, some_iterations<double>(), Device::cpu(), {}, use);
    const RoomyJacobians<double> arrays(packed, 0, 0);
    const auto view = arrays.view(MemorySpace::cuda);
    JacobianSolver<double> solver(Device::emulated(), some_iterations<double>(), JacobianCapacity::of(packed, use),
                                  use);
    Answer<double> answer(view);
    solver.solve(view, answer.view());
    solver.synchronize();
    expect_all(view, answer, packed, expected);
  }
}

}  // namespace
}  // namespace stiction::test
