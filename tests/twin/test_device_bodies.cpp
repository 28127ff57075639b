#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "cuda/emulated/emulated_device.hpp"
#include "cuda/machine/body_machine.hpp"
#include "scenes/body_scenes.hpp"
#include "scenes/box_scenes.hpp"
#include "stiction/error.hpp"
#include "tests/support/machines/body_methods.hpp"

/// Bodies on the emulated device: the work that the GPU's host code queues gives the CPU's bits.
namespace stiction::test {
namespace {

using scenes::box_bodies;
using scenes::box_tower;

template <class Real>
BodyBatch<Real> batch_in(const std::vector<BodyEnvironment<double>>& envs) {
  BodyBatch<Real> batch;
  for (const auto& env : envs) {
    if constexpr (std::is_same_v<Real, float>) {
      batch.add(scenes::rounded(env));
    } else {
      batch.add(env);
    }
  }
  return batch;
}

template <class Real>
BodyBatch<Real> mixed_batch() {
  std::vector<BodyEnvironment<double>> envs;
  for (std::uint64_t seed = 0; seed < 8; ++seed) envs.push_back(random_bodies(seed, 5, static_cast<Index>(13 * seed)));
  envs.push_back({});
  envs.push_back(scenes::make_body_stack(3, 4));
  envs.push_back(scenes::make_body_pile(4, 550));
  envs[2].contacts[1].mu = -1;
  return batch_in<Real>(envs);
}

/// Scenes around the sizes at which a single lane gives way to a team, among larger ones, in no order. There are more
/// than a bundle of each class, so that lanes take new scenes while others go on. Some cannot be solved.
std::vector<BodyEnvironment<double>> small_scenes() {
  std::vector<BodyEnvironment<double>> envs;
  for (std::uint64_t seed = 0; seed < 120; ++seed) {
    const auto contacts = static_cast<Index>(seed * 8 % 21);
    const Index bodies = 2 + static_cast<Index>(seed % (contacts <= 4 ? 2 : 5));
    envs.push_back(random_bodies(seed, bodies, contacts));
    if (seed % 40 == 7) envs.push_back(random_bodies(seed, 9, 45));
  }
  envs.push_back({});
  envs.push_back(random_bodies(3, 200, 9));  // few contacts, and more bodies than a lane has room for
  for (const std::size_t env : {std::size_t{9}, std::size_t{77}})
    envs[env].bodies[0].twist[1] = std::numeric_limits<double>::quiet_NaN();
  return envs;
}

BodySolverOptions quick(Law law) {
  BodySolverOptions options;
  options.box_friction = law == kBoxFriction;
  if (!options.box_friction) options.law = law;
  options.iterations = 17;  // a chunk and a part of one
  options.substeps = 2;
  options.threads = 1;
  options.invalid = InvalidPolicy::isolate;
  return options;
}

template <class Real>
void expect_same(const BodySolution<Real>& a, const BodySolution<Real>& b) {
  expect_same_bodies(a, b, "");
}

template <class Real>
BodySolution<Real> room_for(const BodyBatch<Real>& batch) {
  const auto contacts = static_cast<std::size_t>(3 * batch.contact_count());
  return {std::vector<Real>(contacts), std::vector<Real>(static_cast<std::size_t>(6 * batch.body_count())),
          std::vector<Real>(contacts), std::vector<EnvStatus>(static_cast<std::size_t>(batch.env_count()))};
}

template <class Real>
BodyRequest<Real> request_of(const BodyBatch<Real>& batch, const BodyPlan& plan, const BodySolverOptions& options,
                             BodySolution<Real>& out, cuda::StreamHandle stream) {
  return {plan.shared(),    batch.view(),   {out.impulse.data(), out.twist.data(), out.w.data(), out.status.data()},
          nullptr,          TimeStepping{}, options,
          StreamRef(stream)};
}

}  // namespace

TEST(DeviceBodies, AnEmulatedDeviceGivesTheCpusBits) {
  for (const Law law : {Law::coulomb, Law::convex, kBoxFriction})
    for (const bool momentum : {false, true}) {
      BodySolverOptions options = quick(law);
      options.momentum = momentum;
      options.blocks = momentum == (law == Law::convex) ? BlockMode::pairs : BlockMode::cones;
      expect_same(solve_bodies(mixed_batch<float>(), {}, options),
                  solve_bodies(mixed_batch<float>(), {}, options, Device::emulated()));
      expect_same(solve_bodies(mixed_batch<double>(), {}, options),
                  solve_bodies(mixed_batch<double>(), {}, options, Device::emulated()));
    }
}

TEST(DeviceBodies, NewtonsMethodGivesTheCpusBitsOnAnyNumberOfLanes) {
  std::vector<BodyEnvironment<double>> envs;
  for (std::uint64_t seed = 0; seed < 6; ++seed) envs.push_back(random_bodies(seed, 5, static_cast<Index>(9 * seed)));
  envs.push_back({});
  envs.push_back(scenes::make_body_stack(3, 4));
  envs.push_back(box_bodies(box_tower(62), 0.5));  // 32 lanes, and bodies enough for two levels
  envs[2].contacts[1].mu = -1;
  const auto check = [&](auto real) {
    using Real = decltype(real);
    const auto batch = batch_in<Real>(envs);
    for (const Law law : {Law::coulomb, Law::convex})
      for (int kind = 0; kind < kBodyPreconditionerCount; ++kind) {
        BodySolverOptions options = quick(law);
        options.method = BodyMethod::newton;
        options.space.preconditioner = static_cast<BodyPreconditioner>(kind);
        SCOPED_TRACE(to_string(options.space.preconditioner));
        options.iterations = 2;
        options.tolerance = 1e-5;
        const auto expected = solve_bodies(batch, {}, options);
        const BodyPlan plan = BodySolver(Device::cpu(), {}, options).plan(batch.view());
        for (const int lanes : {1, 3}) {
          // One lane takes turns with itself: once for each kind of program is enough.
          if (lanes == 1 && options.space.preconditioner < BodyPreconditioner::factor) continue;
          cuda::DeviceBodyMachine machine(
              std::make_shared<cuda::EmulatedDevice>(cuda::EmulatedDeviceOptions{lanes, 2, 5}), true);
          auto out = room_for(batch);
          machine.solve(request_of(batch, plan, options, out, nullptr));
          expect_same(expected, out);
        }
      }
  };
  check(float{});
  check(double{});
}

TEST(DeviceBodies, APlanForNewtonsMethodServesImpulsesToo) {
  const auto batch = batch_in<double>({random_bodies(1, 5, 13), scenes::make_body_stack(3, 4)});
  BodySolverOptions options = quick(Law::coulomb);
  const auto expected = solve_bodies(batch, {}, options);
  BodySolverOptions newton = options;
  newton.method = BodyMethod::newton;
  newton.iterations = 1;
  const BodyPlan plan = BodySolver(Device::cpu(), {}, newton).plan(batch.view());
  cuda::DeviceBodyMachine machine(std::make_shared<cuda::EmulatedDevice>(cuda::EmulatedDeviceOptions{2, 2, 5}), true);
  for (const bool first : {true, false}) {
    auto out = room_for(batch);
    machine.solve(request_of(batch, plan, newton, out, nullptr));
    EXPECT_EQ(out.status[1].solver, SolverKind::multigrid) << first;
    machine.solve(request_of(batch, plan, options, out, nullptr));
    expect_same(expected, out);
  }
}

TEST(DeviceBodies, APlanServesEveryLawInTurn) {
  const auto batch = batch_in<double>({random_bodies(1, 5, 13), random_bodies(2, 2, 4), scenes::make_body_stack(3, 4)});
  const BodyPlan plan = BodySolver(Device::cpu(), {}, quick(Law::coulomb)).plan(batch.view());
  cuda::DeviceBodyMachine machine(std::make_shared<cuda::EmulatedDevice>(cuda::EmulatedDeviceOptions{2, 2, 5}), true);
  for (const Law law : {Law::coulomb, kBoxFriction, Law::convex, Law::coulomb}) {
    auto out = room_for(batch);
    machine.solve(request_of(batch, plan, quick(law), out, nullptr));
    expect_same(solve_bodies(batch, {}, quick(law)), out);
  }
}

/// The room in a device's fast memory decides which team works on a scene, and nothing else.
TEST(DeviceBodies, ALaneOfItsOwnGivesTheBitsOfATeam) {
  const auto check = [](auto real) {
    using Real = decltype(real);
    const auto batch = batch_in<Real>(small_scenes());
    for (const Law law : {Law::coulomb, Law::convex, kBoxFriction})
      for (const bool momentum : {false, true}) {
        BodySolverOptions options = quick(law);
        options.momentum = momentum;
        options.substeps = momentum ? 3 : 1;
        options.max_contacts_per_env = momentum ? 14 : 0;
        options.tolerance = 1e-3;  // lanes end at different times
        const std::vector<Real> warm(momentum ? static_cast<std::size_t>(3 * batch.contact_count()) : 0, Real(0.125));
        const auto expected = solve_bodies(batch, {}, options, Device::cpu(), std::span<const Real>(warm));
        const BodyPlan plan = BodySolver(Device::cpu(), {}, options).plan(batch.view());
        for (const std::size_t shared_kib : {std::size_t{227}, std::size_t{100}, std::size_t{0}}) {
          const auto device =
              std::make_shared<cuda::EmulatedDevice>(cuda::EmulatedDeviceOptions{2, 2, 5, shared_kib << 10});
          cuda::DeviceBodyMachine machine(device, true);
          auto out = room_for(batch);
          auto request = request_of(batch, plan, options, out, nullptr);
          request.warm_start = warm.empty() ? nullptr : warm.data();
          machine.solve(request);
          expect_same(expected, out);
        }
      }
  };
  check(float{});
  check(double{});
}

TEST(DeviceBodies, FastMemoryDecidesHowManyClassesThereAre) {
  std::vector<BodyEnvironment<double>> envs{random_bodies(1, 2, 4), random_bodies(2, 9, 16), random_bodies(3, 9, 17),
                                            random_bodies(4, 40, 16)};
  const auto batch = batch_in<float>(envs);
  const BodySolverOptions options = quick(Law::coulomb);
  const BodyPlan plan = BodySolver(Device::cpu(), {}, options).plan(batch.view());
  const auto launches = [&](std::size_t shared_bytes) {
    const auto device = std::make_shared<cuda::EmulatedDevice>(cuda::EmulatedDeviceOptions{1, 2, 0, shared_bytes});
    cuda::DeviceBodyMachine machine(device, true);
    auto out = room_for(batch);
    machine.solve(request_of(batch, plan, options, out, nullptr));
    return device->calls(cuda::DeviceCall::launch);
  };
  EXPECT_EQ(launches(std::size_t{227} << 10), 3);  // bundles of either size, and a team for two scenes
  EXPECT_EQ(launches(0), 1);
}

TEST(DeviceBodies, LanesTeamsAndOrderChangeNothing) {
  const auto batch = mixed_batch<float>();
  const BodySolverOptions options = quick(Law::coulomb);
  const auto expected = solve_bodies(batch, {}, options);
  const BodyPlan plan = BodySolver(Device::cpu(), {}, options).plan(batch.view());
  for (const int lanes : {1, 3})
    for (const std::uint64_t seed : {0, 1}) {
      cuda::DeviceBodyMachine machine(
          std::make_shared<cuda::EmulatedDevice>(cuda::EmulatedDeviceOptions{lanes, 1 + lanes, seed}), true);
      auto out = room_for(batch);
      machine.solve(request_of(batch, plan, options, out, nullptr));
      expect_same(expected, out);
    }
}

TEST(DeviceBodies, AWholeDeviceWorksOnOneLargeEnvironment) {
  BodyBatch<float> batch;
  batch.add(scenes::rounded(scenes::make_body_pile(5, 20000)));
  ASSERT_GT(batch.contact_count(), 16385);
  BodySolverOptions options = quick(Law::coulomb);
  options.iterations = 3;
  expect_same(solve_bodies(batch, {}, options), solve_bodies(batch, {}, options, Device::emulated()));
}

/// The emulated device's memory is any memory of the process, so a batch may lie there.
TEST(DeviceBodies, ACapturedSolveIsReplayedWithOtherNumbers) {
  const BodySolverOptions options = quick(Law::coulomb);
  const auto batch = mixed_batch<float>();
  const BodyPlan plan = BodySolver(Device::cpu(), {}, options).plan(batch.view());
  const auto device = std::make_shared<cuda::EmulatedDevice>(cuda::EmulatedDeviceOptions{2, 3, 9});
  cuda::DeviceBodyMachine machine(device, false);
  const cuda::Stream stream(*device);
  auto out = room_for(batch);
  std::vector<float> twist(batch.view().twist, batch.view().twist + 6 * batch.body_count());
  auto request = request_of(batch, plan, options, out, stream.get());
  request.batch.space = MemorySpace::cuda;
  request.batch.twist = twist.data();

  device->begin_capture(stream.get());
  EXPECT_THROW(machine.solve(request), Error);
  device->end_capture(stream.get());
  machine.solve(request);
  device->synchronize(stream.get());
  const int allocations = device->calls(cuda::DeviceCall::allocate);
  device->begin_capture(stream.get());
  machine.solve(request);
  const auto graph = device->end_capture(stream.get());
  for (float& v : twist) v = 0.5F * v;
  // The graph holds pointers to these vectors: cleared where they are.
  std::fill(out.impulse.begin(), out.impulse.end(), 0.0F);
  std::fill(out.twist.begin(), out.twist.end(), 0.0F);
  std::fill(out.w.begin(), out.w.end(), 0.0F);
  std::fill(out.status.begin(), out.status.end(), EnvStatus{});
  device->launch(graph, stream.get());
  device->synchronize(stream.get());
  EXPECT_EQ(device->calls(cuda::DeviceCall::allocate), allocations);

  auto expected = room_for(batch);
  auto on_cpu = request_of(batch, plan, options, expected, nullptr);
  on_cpu.batch.twist = twist.data();
  make_cpu_body_machine()->solve(on_cpu);
  expect_same(expected, out);
}

TEST(DeviceBodies, ADeviceThatFailsLeavesNothingBehind) {
  const auto batch = mixed_batch<float>();
  const BodySolverOptions options = quick(Law::coulomb);
  const BodyPlan plan = BodySolver(Device::cpu(), {}, options).plan(batch.view());
  for (const cuda::DeviceCall call : {cuda::DeviceCall::allocate, cuda::DeviceCall::copy, cuda::DeviceCall::launch})
    for (int n = 0; n < 3; ++n) {
      const auto device = std::make_shared<cuda::EmulatedDevice>(cuda::EmulatedDeviceOptions{1, 2, 0});
      {
        cuda::DeviceBodyMachine machine(device, true);
        auto out = room_for(batch);
        device->fail_call(call, n);
        EXPECT_THROW(machine.solve(request_of(batch, plan, options, out, nullptr)), Error);
        device->fail_call(call, -1);
        machine.solve(request_of(batch, plan, options, out, nullptr));
        expect_same(solve_bodies(batch, {}, options), out);
      }
      EXPECT_EQ(device->live_allocations(), 0U);
    }
}

}  // namespace stiction::test
