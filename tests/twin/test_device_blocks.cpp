#include <gtest/gtest.h>

#include <memory>

#include "stiction/jacobian_solver.hpp"
#include "tests/support/machines/device_jacobians.hpp"
#include "tests/support/systems/box_jacobians.hpp"
#include "tests/support/systems/roomy_jacobians.hpp"
#include "tests/support/systems/velocity_cases.hpp"

/// Environments in blocks on the emulated device.
namespace stiction::test {
namespace {

/// Boxes whose factor does not pay, and others that lanes take, with room between environments.
template <class Real>
void expect_the_cpus_bits_in_blocks(Law law, MassForm mass, const cuda::EmulatedDeviceOptions& options) {
  JacobianBatch<Real> batch(law, mass, 6);
  const auto add = [&](const scenes::BoxScene& scene, double compliance) {
    batch.add(cast<Real>(in_form(boxes_as_jacobian(scene, {.compliance = compliance, .push = 1.0}), mass, 6)));
  };
  add(scenes::box_pyramid(4), 1e-3);
  add(scenes::box_tower(2), 1e-2);
  add(scenes::box_wall(5, 5), 0.0);
  SolverOptions chosen = some_iterations<Real>(SolverKind::automatic);
  chosen.tolerance = 1e-4;
  chosen.max_iterations = 200;
  const auto packed = batch.view();
  const auto expected = solve(packed, chosen);
  for (const EnvStatus& status : expected.contact.status) EXPECT_EQ(status.solver, SolverKind::velocity_newton);
  const RoomyJacobians<Real> arrays(packed, 900, 5);
  const auto view = arrays.view(MemorySpace::cuda);
  const auto device = std::make_shared<cuda::EmulatedDevice>(options);
  const cuda::Stream stream(*device);
  JacobianCapacity capacity = JacobianCapacity::of(packed);
  capacity.rows = view.row_count;
  capacity.cones = view.cone_count;
  Machine<Real> machine(device, capacity, FactorUse::by_size, chosen);
  Answer<Real> answer(view);
  for (int again = 0; again < 2; ++again) machine.solve(view, answer.view(), StreamRef(stream.get()));
  device->synchronize(stream.get());
  expect_all(view, answer, packed, expected);
}

TEST(DeviceBlocks, HaveTheCpusBits) {
  expect_the_cpus_bits_in_blocks<double>(Law::convex, MassForm::matrix, {2, 3, 5});
  expect_the_cpus_bits_in_blocks<float>(Law::convex, MassForm::factor, {1, 7, 1});
  expect_the_cpus_bits_in_blocks<double>(Law::coulomb, MassForm::matrix, {3, 4, 2});
}

}  // namespace
}  // namespace stiction::test
