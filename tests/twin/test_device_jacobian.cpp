#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>

#include "cuda/emulated/emulated_device.hpp"
#include "stiction/captured_calls.hpp"
#include "stiction/error.hpp"
#include "stiction/jacobian_solver.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/machines/device_jacobians.hpp"
#include "tests/support/systems/roomy_jacobians.hpp"
#include "tests/support/systems/velocity_cases.hpp"

/// The Jacobian form on the emulated device. It gives the reactions, motion, velocities and records of the CPU, whose
/// batch is assembled by other code.
namespace stiction::test {
namespace {

template <class Real>
void expect_the_cpus_bits(const Form& form, const cuda::EmulatedDeviceOptions& options) {
  const auto batch = random_batch<Real>(options.seed + 1, form);
  const auto packed = batch.view();
  const SolverOptions chosen = some_iterations<Real>(form.solver);
  const auto expected = solve(packed, chosen, Device::cpu(), {}, form.use);
  for (const Index room : {0, 90}) {
    SCOPED_TRACE(room == 0 ? "packed" : "padded");
    const RoomyJacobians<Real> arrays(packed, room, 5);
    const auto view = arrays.view(MemorySpace::cuda);
    const auto device = std::make_shared<cuda::EmulatedDevice>(options);
    const cuda::Stream stream(*device);
    JacobianCapacity capacity = JacobianCapacity::of(packed, form.use);
    capacity.rows = view.row_count;
    capacity.cones = view.cone_count;
    Machine<Real> machine(device, capacity, form.use, chosen);
    Answer<Real> answer(view);
    for (int again = 0; again < 2; ++again) machine.solve(view, answer.view(), StreamRef(stream.get()));
    device->synchronize(stream.get());
    expect_all(view, answer, packed, expected);
  }
}

/// A batch in host memory, solved on the emulated device as it is.
void expect_the_same_on_a_device(const JacobianBatchView<float>& packed, const SolverOptions& chosen,
                                 const JacobianSolution<float>& expected) {
  const RoomyJacobians<float> arrays(packed, 0, 5);
  auto view = arrays.view(MemorySpace::cuda);
  view.env_tolerance = packed.env_tolerance;
  const auto device = std::make_shared<cuda::EmulatedDevice>(cuda::EmulatedDeviceOptions{2, 3, 5});
  const cuda::Stream stream(*device);
  JacobianCapacity capacity = JacobianCapacity::of(packed);
  capacity.rows = view.row_count;
  capacity.cones = view.cone_count;
  Machine<float> machine(device, capacity, FactorUse::by_size, chosen);
  Answer<float> answer(view);
  machine.solve(view, answer.view(), StreamRef(stream.get()));
  device->synchronize(stream.get());
  expect_all(view, answer, packed, expected);
}

TEST(DeviceJacobian, HasTheCpusBitsInEveryForm) {
  for (const FactorUse use : {FactorUse::never, FactorUse::by_size, FactorUse::always})
    for (const bool sparse : {false, true})
      for (const Index block : use == FactorUse::by_size ? std::vector<Index>{0, 6, 1} : std::vector<Index>{6})
        for (const MassForm mass : {MassForm::matrix, MassForm::factor}) {
          SCOPED_TRACE("use " + std::to_string(static_cast<int>(use)) + ", sparse " + std::to_string(sparse) +
                       ", block " + std::to_string(block));
          expect_the_cpus_bits<double>({mass, block, sparse, use}, {2, 3, static_cast<std::uint64_t>(block)});
        }
}

TEST(DeviceJacobian, HasTheCpusBitsWhereNewtonInVelocitiesGoesFirst) {
  for (const MassForm mass : {MassForm::matrix, MassForm::factor})
    for (const bool sparse : {false, true})
      for (const Index block : {0, 6, 1}) {
        SCOPED_TRACE("form " + std::to_string(static_cast<int>(mass)) + ", sparse " + std::to_string(sparse) +
                     ", block " + std::to_string(block));
        const Form form{mass, block, sparse, FactorUse::by_size, SolverKind::automatic};
        expect_the_cpus_bits<double>(form, {3, 1 + block % 2, static_cast<std::uint64_t>(block)});
        expect_the_cpus_bits<float>(form, {2, 1, static_cast<std::uint64_t>(block) + 1});
      }
}

// Some ask for steps in double, some of these in vain. Newton has too few iterations for half: they go on by A.
TEST(DeviceJacobian, HasTheCpusBitsWhereStepsAreInDouble) {
  JacobianBatch<float> batch(Law::convex);
  std::vector<double> tolerances;
  const double asked[] = {1e-4, 1e-6, 1e-8, -1.0};
  for (std::uint64_t seed = 1; seed <= 16; ++seed) {
    const auto chain = random_chain({seed, static_cast<Index>(9 + seed), cones_of_every_kind(), 0.0, 1e-3});
    batch.add(cast<float>(seed == 11 ? together({chain, random_chain({3, 50})}, true).env : chain));
    tolerances.push_back(asked[seed % 4]);
  }
  for (const bool own : {false, true}) {
    SolverOptions chosen = some_iterations<float>(SolverKind::automatic);
    chosen.max_iterations = 8;
    chosen.tolerance = 1e-6;
    auto packed = batch.view();
    packed.env_tolerance = own ? tolerances.data() : nullptr;
    const auto expected = solve(packed, chosen);
    const auto by_newton = std::ranges::count(expected.contact.status, SolverKind::velocity_newton, &EnvStatus::solver);
    EXPECT_TRUE(by_newton > 4 && by_newton < batch.env_count()) << by_newton << " by Newton";
    expect_the_same_on_a_device(packed, chosen, expected);
  }
}

TEST(DeviceJacobian, HasTheCpusBitsOfPartsOfLargeEnvironments) {
  for (const int form : {0, 1, 2, 3}) {
    const bool sparse = form % 2 == 1;
    const MassForm mass = form < 2 ? MassForm::matrix : MassForm::factor;
    std::vector<JacobianEnvironment<double>> chains;
    for (std::uint64_t seed = 1; seed <= 6; ++seed)
      chains.push_back(random_chain({seed, static_cast<Index>(9 + 2 * seed), cones_of_every_kind(), 0.0, 0.01}));
    JacobianBatch<float> batch(Law::convex, mass);
    for (const bool interleaved : {false, true}) {
      JacobianEnvironment<double> large = together(chains, interleaved).env, small = chains[0];
      if (sparse) store_nonzeros(large);
      if (sparse) store_nonzeros(small);
      batch.add(cast<float>(in_form(large, mass)));
      batch.add(cast<float>(in_form(small, mass)));
    }
    const SolverOptions chosen = some_iterations<float>(SolverKind::automatic);
    const auto packed = batch.view();
    const auto expected = solve(packed, chosen);
    for (const EnvStatus& status : expected.contact.status) EXPECT_EQ(status.solver, SolverKind::velocity_newton);
    expect_the_same_on_a_device(packed, chosen, expected);
  }
}

TEST(DeviceJacobian, HasTheCpusBitsWhereManyDegreesOfFreedomAreCoupled) {
  for (const MassForm mass : {MassForm::matrix, MassForm::factor}) {
    JacobianBatch<float> batch(Law::convex, mass);
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      const auto bodies = bodies_in_contact({seed, 9 + 4 * seed, 3, 3 * seed});
      batch.add(cast<float>(in_form(mass == MassForm::factor ? reversed(bodies) : bodies, mass)));
      batch.add(cast<float>(in_form(random_chain({seed, 17}), mass)));
    }
    const SolverOptions chosen = some_iterations<float>(SolverKind::automatic);
    const auto packed = batch.view();
    const auto expected = solve(packed, chosen);
    for (const EnvStatus& status : expected.contact.status) EXPECT_EQ(status.solver, SolverKind::velocity_newton);
    expect_the_same_on_a_device(packed, chosen, expected);
  }
}

TEST(DeviceJacobian, HasTheCpusBitsOnAnyLanesAndTeams) {
  for (const int lanes : {1, 3, 5})
    for (const std::uint64_t seed : {0, 1, 2}) {
      SCOPED_TRACE(std::to_string(lanes) + " lanes, seed " + std::to_string(seed));
      expect_the_cpus_bits<float>({}, {lanes, 1 + static_cast<Offset>(seed), seed});
    }
}

TEST(DeviceJacobian, TheObjectOnTheCpuAnswersAsTheFunctionDoes) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    JacobianSolver<float> solver(Device::cpu(), some_iterations<float>(), {});
    for (const bool sparse : {false, true})
      for (const Index room : {0, 90}) {
        const auto batch = random_batch<float>(seed + 10U * sparse, {MassForm::matrix, 6, sparse});
        const auto expected = solve(batch, some_iterations<float>());
        const RoomyJacobians<float> arrays(batch.view(), room, 0);
        const auto view = arrays.view(MemorySpace::host);
        Answer<float> answer(view);
        solver.solve(view, answer.view());
        expect_all(view, answer, batch.view(), expected);
      }
  }
}

TEST(DeviceJacobian, ABadMassStaysInItsEnvironment) {
  const auto batch = random_batch<double>(3, {});
  for (const FactorUse use : {FactorUse::never, FactorUse::always}) {
    RoomyJacobians<double> arrays(batch.view(), 0, 0);
    arrays.M[static_cast<std::size_t>(arrays.env_mass_offsets[3])] = -1.0;
    const auto bad = arrays.view(MemorySpace::host);
    const auto expected = solve(bad, some_iterations<double>(), Device::cpu(), {}, use);
    ASSERT_EQ(expected.contact.status[3].code, EnvCode::invalid_input);
    const auto device = std::make_shared<cuda::EmulatedDevice>();
    Machine<double> machine(device, JacobianCapacity::of(bad, use), use);
    Answer<double> answer(bad);
    // Contents of the matrices from an earlier batch must not reach a flag.
    RoomyJacobians<double> poisoned(batch.view(), 0, 0);
    poisoned.J.assign(poisoned.J.size(), std::numeric_limits<double>::quiet_NaN());
    machine.solve(poisoned.view(MemorySpace::cuda), answer.view(), StreamRef::default_stream());
    machine.solve(arrays.view(MemorySpace::cuda), answer.view(), StreamRef::default_stream());
    device->synchronize(nullptr);
    expect_all(bad, answer, bad, expected);
    for (Index k = 0; k < bad.env_dofs(3); ++k)
      EXPECT_EQ(answer.velocity[static_cast<std::size_t>(bad.env_dof_offsets[3] + k)],
                bad.v_free[bad.env_dof_offsets[3] + k]);
  }
}

/// Solves with less room than the batch needs; which environments are flagged so is returned, the others are right.
std::vector<Offset> flagged(const JacobianBatch<double>& batch, const JacobianCapacity& capacity) {
  const auto packed = batch.view();
  const auto expected = solve(packed, some_iterations<double>());
  const RoomyJacobians<double> arrays(packed, 0, 0);
  const auto view = arrays.view(MemorySpace::cuda);
  const auto device = std::make_shared<cuda::EmulatedDevice>(cuda::EmulatedDeviceOptions{2, 2, 5});
  Machine<double> machine(device, capacity, FactorUse::by_size);
  Answer<double> answer(view);
  machine.solve(view, answer.view(), StreamRef::default_stream());
  device->synchronize(nullptr);
  std::vector<Offset> found;
  for (Offset env = 0; env < view.env_count; ++env) {
    const EnvStatus& status = answer.status[static_cast<std::size_t>(env)];
    if ((status.flags & kFlagOverCapacity) == 0) {
      expect_env(view, answer, env, packed, expected);
      continue;
    }
    found.push_back(env);
    for (Offset row = view.env_row_offsets[env]; row < view.env_row_offsets[env + 1]; ++row)
      EXPECT_EQ(answer.lambda[static_cast<std::size_t>(row)], 0.0);
    for (Offset k = view.env_dof_offsets[env]; k < view.env_dof_offsets[env + 1]; ++k)
      EXPECT_EQ(answer.velocity[static_cast<std::size_t>(k)], view.v_free[k]);
  }
  return found;
}

TEST(DeviceJacobian, WhatDoesNotFitIsFlaggedAndLeavesTheOthersAlone) {
  const auto batch = random_batch<double>(2, {});
  const JacobianCapacity enough = JacobianCapacity::of(batch.view());
  EXPECT_EQ(flagged(batch, enough), std::vector<Offset>{});
  JacobianCapacity capacity = enough;
  capacity.matrix -= 1;
  EXPECT_EQ(flagged(batch, capacity), std::vector<Offset>{5}) << "the last that has rows and a matrix";
  capacity.matrix = 0;
  EXPECT_EQ(flagged(batch, capacity), (std::vector<Offset>{0, 3, 4, 5}));
  capacity = enough;
  capacity.factor -= 1;
  EXPECT_EQ(flagged(batch, capacity), std::vector<Offset>{2}) << "the only factor";
  capacity = enough;
  capacity.env_rows = 80;
  EXPECT_EQ(flagged(batch, capacity), std::vector<Offset>{2});
  capacity = enough;
  capacity.env_dofs = 12;
  EXPECT_EQ(flagged(batch, capacity), (std::vector<Offset>{2, 5}));
}

/// Damages the arrays; the environments named are flagged, the others are right.
template <class Damage>
void expect_broken(const Form& form, Index room, const std::vector<Offset>& broken, const Damage& damage) {
  const auto batch = random_batch<double>(1, form);
  const auto packed = batch.view();
  const auto expected = solve(packed, some_iterations<double>());
  RoomyJacobians<double> arrays(packed, room, 3);
  JacobianCapacity capacity = JacobianCapacity::of(packed);
  capacity.rows = arrays.view(MemorySpace::cuda).row_count;
  capacity.cones = arrays.view(MemorySpace::cuda).cone_count;
  damage(arrays);
  const auto view = arrays.view(MemorySpace::cuda);
  const auto device = std::make_shared<cuda::EmulatedDevice>(cuda::EmulatedDeviceOptions{2, 2, 3});
  Machine<double> machine(device, capacity, FactorUse::by_size);
  Answer<double> answer(view);
  machine.solve(view, answer.view(), StreamRef::default_stream());
  device->synchronize(nullptr);
  for (Offset other = 0; other < packed.env_count; ++other) {
    const std::uint32_t flags = answer.status[static_cast<std::size_t>(other)].flags;
    const bool is_broken = std::count(broken.begin(), broken.end(), other) > 0;
    EXPECT_EQ((flags & kFlagBadStructure) != 0, is_broken) << "env " << other;
    if (!is_broken) expect_env(view, answer, other, packed, expected);
  }
}

TEST(DeviceJacobian, BrokenIntegersAreFoundWhereTheyAre) {
  for (const Index room : {0, 90}) {
    expect_broken({}, room, {2, 3}, [](auto& arrays) { arrays.env_row_offsets[3] = -1; });
    expect_broken({}, room, {2, 3}, [](auto& arrays) { arrays.env_dof_offsets[3] = Offset{1} << 40; });
  }
  expect_broken({}, 90, {2}, [](auto& arrays) { arrays.env_row_counts[2] = 91; });
  expect_broken({}, 90, {2}, [](auto& arrays) { arrays.env_row_counts[2] = -1; });
  expect_broken({}, 90, {3}, [](auto& arrays) { arrays.env_cone_counts[3] += 1; });
  expect_broken({MassForm::matrix, 0, true}, 0, {2}, [](auto& arrays) {
    arrays.column[static_cast<std::size_t>(arrays.row_offsets[static_cast<std::size_t>(arrays.env_row_offsets[2])])] =
        18;
  });
  expect_broken({MassForm::matrix, 0, true}, 90, {0}, [](auto& arrays) { arrays.column[0] = -1; });
  expect_broken({}, 0, {5},
                [](auto& arrays) { arrays.cone_kind[arrays.cone_kind.size() - 4] = static_cast<ConeKind>(7); });
}

TEST(DeviceJacobian, ACapturedSolveIsReplayedWithOtherNumbersAndCounts) {
  for (const Index room : {0, 90}) {
    for (const std::uint64_t seed : {0, 6}) {
      const auto device = std::make_shared<cuda::EmulatedDevice>(cuda::EmulatedDeviceOptions{2, 3, seed});
      const cuda::Stream stream(*device);
      RoomyJacobians<float> arrays(random_batch<float>(3, {}).view(), room, 200);
      // The arrays of a shorter batch keep their room.
      const auto view = arrays.view(MemorySpace::cuda);
      JacobianCapacity capacity = JacobianCapacity::of_largest(view.env_count, 90, 40, 24);
      capacity.rows = view.row_count;
      capacity.cones = view.cone_count;
      Machine<float> machine(device, capacity, FactorUse::by_size);
      Answer<float> answer(view);
      const StreamRef own(stream.get());
      const std::uint64_t captured = captured_calls();
      device->begin_capture(stream.get());
      machine.solve(view, answer.view(), own);
      const auto graph = device->end_capture(stream.get());
      EXPECT_GT(captured_calls(), captured);
      for (const std::uint64_t step : {3, 4, 7, 2, 1}) {
        SCOPED_TRACE("step " + std::to_string(step));
        const auto batch = random_batch<float>(step, {});
        // The law is part of the captured work, as options are.
        auto packed = batch.view();
        packed.law = view.law;
        const auto expected = solve(packed, some_iterations<float>());
        arrays.refill(packed, room);
        const int allocations = device->calls(cuda::DeviceCall::allocate);
        device->launch(graph, stream.get());
        device->synchronize(stream.get());
        EXPECT_EQ(device->calls(cuda::DeviceCall::allocate), allocations);
        expect_all(view, answer, packed, expected);
      }
    }
  }
}

TEST(DeviceJacobian, NoEnvironmentsAreFine) {
  for (const Device device : {Device::cpu(), Device::emulated()}) {
    JacobianSolver<double> solver(device, {}, {});
    const JacobianBatch<double> batch;
    auto view = batch.view();
    view.space = device.kind == DeviceKind::cpu ? MemorySpace::host : MemorySpace::cuda;
    EXPECT_NO_THROW(solver.solve(view, {}));
    solver.synchronize();
  }
}

TEST(DeviceJacobian, AFailingDeviceLeavesNothingBehind) {
  const auto batch = random_batch<float>(1, {});
  const RoomyJacobians<float> arrays(batch.view(), 0, 0);
  const auto view = arrays.view(MemorySpace::cuda);
  const auto expected = solve(batch, some_iterations<float>());
  for (const auto call : {cuda::DeviceCall::allocate, cuda::DeviceCall::create, cuda::DeviceCall::copy,
                          cuda::DeviceCall::launch, cuda::DeviceCall::synchronize}) {
    const auto run = [&](const std::shared_ptr<cuda::EmulatedDevice>& device, Answer<float>& answer) {
      Machine<float> machine(device, JacobianCapacity::of(batch.view()), FactorUse::by_size);
      machine.solve(view, answer.view(), StreamRef::default_stream());
      device->synchronize(nullptr);
    };
    const auto sound = std::make_shared<cuda::EmulatedDevice>();
    Answer<float> fresh(view);
    run(sound, fresh);
    const int calls = sound->calls(call);
    int failures = 0;
    for (int n = 0; n < calls; ++n) {
      const auto device = std::make_shared<cuda::EmulatedDevice>();
      device->fail_call(call, n);
      Answer<float> answer(view);
      try {
        run(device, answer);
        expect_all(view, answer, batch.view(), expected);
      } catch (const Error&) {
        ++failures;
      }
      EXPECT_EQ(device->live_allocations(), 0U);
      EXPECT_EQ(device->live_handles(), 0U);
    }
    EXPECT_GT(failures, 0) << "call " << static_cast<int>(call);
  }
}

TEST(DeviceJacobian, ThePublicSolverWorksOnTheEmulatedDevice) {
  const auto batch = random_batch<double>(2, {});
  const RoomyJacobians<double> arrays(batch.view(), 90, 0);
  const auto here = arrays.view(MemorySpace::host), there = arrays.view(MemorySpace::cuda);
  JacobianSolver<double> on_cpu(Device::cpu(), some_iterations<double>(), {});
  JacobianSolver<double> on_device(Device::emulated(), some_iterations<double>(),
                                   JacobianCapacity::of_largest(here.env_count, 90, 90, 24));
  Answer<double> expected(here), answer(here);
  const std::vector<double> warm_start(expected.lambda.size(), 0.125);
  on_cpu.solve(here, expected.view(), warm_start.data());
  on_device.solve(there, answer.view(), warm_start.data());
  on_device.synchronize();
  EXPECT_TRUE(same_bits(std::span<const double>(expected.lambda), std::span<const double>(answer.lambda)));
  EXPECT_TRUE(same_bits(std::span<const double>(expected.w), std::span<const double>(answer.w)));
  EXPECT_TRUE(same_bits(std::span<const double>(expected.velocity), std::span<const double>(answer.velocity)));
  EXPECT_TRUE(same_bits(std::span<const EnvStatus>(expected.status), std::span<const EnvStatus>(answer.status)));

  JacobianSolutionView<double> only_reactions{answer.lambda.data(), nullptr, nullptr, answer.status.data()};
  EXPECT_NO_THROW(on_device.solve(there, only_reactions));
  on_device.synchronize();
  EXPECT_THROW(on_device.solve(here, answer.view()), Error) << "memory of the host";
  EXPECT_THROW(on_cpu.solve(there, answer.view()), Error) << "memory of a device";
  EXPECT_THROW(on_device.solve(there, {answer.lambda.data(), nullptr, nullptr, nullptr}), Error) << "no status";
  JacobianSolver<double> too_small(Device::emulated(), {},
                                   JacobianCapacity::of_largest(here.env_count - 1, 90, 90, 24));
  EXPECT_THROW(too_small.solve(there, answer.view()), Error);
  JacobianCapacity negative;
  negative.factor = -1;
  EXPECT_THROW(JacobianSolver<double>(Device::cpu(), {}, negative), Error);
}

}  // namespace
}  // namespace stiction::test
