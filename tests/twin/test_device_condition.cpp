#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "cuda/emulated/emulated_device.hpp"
#include "stiction/error.hpp"
#include "tests/support/machines/device_jacobians.hpp"
#include "tests/support/systems/roomy_jacobians.hpp"
#include "tests/support/systems/velocity_cases.hpp"

/// A captured solve of J and M by `auto`: the work after Newton's method in velocities is behind one condition. It is
/// done if that has left an environment, and left out otherwise.
namespace stiction::test {
namespace {

/// Newton's method has too few iterations for some environments.
SolverOptions few_iterations() {
  SolverOptions chosen = some_iterations<float>(SolverKind::automatic);
  chosen.tolerance = 1e-4;
  chosen.max_iterations = 8;
  return chosen;
}

/// Environments that Newton's method in velocities solves within those iterations, and some that it does not.
struct Pool {
  std::vector<JacobianEnvironment<float>> solved, left;
  Pool() {
    for (std::uint64_t seed = 1; seed <= 24; ++seed) {
      const auto env =
          cast<float>(random_chain({seed, static_cast<Index>(9 + seed % 7), cones_of_every_kind(), 0.0, 1e-3}));
      JacobianBatch<float> alone(Law::convex);
      alone.add(env);
      const bool is_solved = solve(alone, few_iterations()).contact.status[0].solver == SolverKind::velocity_newton;
      (is_solved ? solved : left).push_back(env);
    }
    // Without contacts it has its answer, too. Without degrees of freedom it has none.
    solved.insert(solved.begin() + 1, cast<float>(random_jacobian({7, 0, 0, 6, 0})));
    left.push_back(cast<float>(random_jacobian({8, 1, 1, 0, 0})));
  }
};

constexpr std::size_t kEnvs = 40;  // more than lanes that look at them at once

/// Solved environments with others in some places.
JacobianBatch<float> batch_with_left(const Pool& pool, const std::vector<std::size_t>& places,
                                     std::size_t envs = kEnvs) {
  JacobianBatch<float> batch(Law::convex);
  for (std::size_t env = 0, next = 0; env < envs; ++env) {
    const bool is_left = next < places.size() && places[next] == env;
    batch.add(is_left ? pool.left[(pool.left.size() - 1 + next++) % pool.left.size()]
                      : pool.solved[env % pool.solved.size()]);
  }
  return batch;
}

/// Returns true if the chain of stages has sorted environments since the last call.
bool has_sorted(const Machine<float>& machine) {
  constexpr Offset kNone = -9;
  Offset& first = machine.machine.engine().plan_arrays().order[0];
  return std::exchange(first, kNone) != kNone;
}

/// A captured solve of batches of that many environments.
struct CapturedSolve {
  std::shared_ptr<cuda::EmulatedDevice> device;
  cuda::Stream stream;
  RoomyJacobians<float> arrays;
  JacobianBatchView<float> view;
  Machine<float> machine;
  Answer<float> answer;
  std::shared_ptr<const cuda::EmulatedDevice::Graph> graph;

  static constexpr Index kRoom = 30;
  static JacobianCapacity room_for(const JacobianBatchView<float>& view) {
    JacobianCapacity capacity = JacobianCapacity::of_largest(view.env_count, kRoom, kRoom, 16);
    capacity.rows = view.row_count;
    capacity.cones = view.cone_count;
    return capacity;
  }

  CapturedSolve(const JacobianBatch<float>& largest, const cuda::EmulatedDeviceOptions& options,
                const SolverOptions& chosen = few_iterations())
      : device(std::make_shared<cuda::EmulatedDevice>(options)),
        stream(*device),
        arrays(largest.view(), kRoom, 4000),
        view(arrays.view(MemorySpace::cuda)),
        machine(device, room_for(view), FactorUse::by_size, chosen),
        answer(view) {}

  void capture() {
    device->begin_capture(stream.get());
    machine.solve(view, answer.view(), StreamRef(stream.get()));
    graph = device->end_capture(stream.get());
  }
  void replay(const JacobianBatch<float>& batch) {
    arrays.refill(batch.view(), kRoom);
    for (auto* numbers : {&answer.lambda, &answer.w, &answer.velocity}) std::ranges::fill(*numbers, answer.kRubbish);
    std::ranges::fill(answer.status, EnvStatus{});
    device->launch(graph, stream.get());
    device->synchronize(stream.get());
  }
};

TEST(DeviceCondition, LeftoversAreSolvedAndOtherwiseNothingIsDone) {
  const Pool pool;
  ASSERT_GT(pool.solved.size(), 6U);
  ASSERT_GT(pool.left.size(), 3U);
  const std::vector<std::vector<std::size_t>> steps = {{}, {kEnvs - 1}, {}, {0}, {3, 17, 33}, {}};
  for (const auto& options : {cuda::EmulatedDeviceOptions{2, 3, 5}, cuda::EmulatedDeviceOptions{3, 1, 8}}) {
    CapturedSolve own(batch_with_left(pool, {0, 1, 2, 3}), options);
    own.capture();
    has_sorted(own.machine);
    for (std::size_t step = 0; step < steps.size(); ++step) {
      SCOPED_TRACE("step " + std::to_string(step));
      const JacobianBatch<float> batch = batch_with_left(pool, steps[step]);
      const auto expected = solve(batch, few_iterations());
      own.replay(batch);
      EXPECT_EQ(has_sorted(own.machine), !steps[step].empty());
      expect_all(own.view, own.answer, batch.view(), expected);
    }
  }
}

TEST(DeviceCondition, ASingleEnvironmentIsFound) {
  const Pool pool;
  CapturedSolve own(batch_with_left(pool, {0}, 1), {2, 3, 5});
  own.capture();
  has_sorted(own.machine);
  for (const std::vector<std::size_t>& left : {std::vector<std::size_t>{0}, {}}) {
    const JacobianBatch<float> batch = batch_with_left(pool, left, 1);
    own.replay(batch);
    EXPECT_EQ(has_sorted(own.machine), !left.empty());
    expect_all(own.view, own.answer, batch.view(), solve(batch, few_iterations()));
  }
}

/// Only a graph leaves work out: all is queued elsewhere, and the answer is the same.
TEST(DeviceCondition, WithoutACaptureAllIsDone) {
  const Pool pool;
  for (const std::vector<std::size_t>& left : {std::vector<std::size_t>{}, {2, 30}}) {
    const JacobianBatch<float> batch = batch_with_left(pool, left);
    CapturedSolve own(batch, {2, 3, 4});
    has_sorted(own.machine);
    own.machine.solve(own.view, own.answer.view(), StreamRef(own.stream.get()));
    own.device->synchronize(own.stream.get());
    EXPECT_TRUE(has_sorted(own.machine));
    expect_all(own.view, own.answer, batch.view(), solve(batch, few_iterations()));
  }
}

/// A solver without Newton's method in velocities has nothing that could be left out.
TEST(DeviceCondition, AnotherSolverAlwaysSolves) {
  const Pool pool;
  const JacobianBatch<float> batch = batch_with_left(pool, {});
  const SolverOptions chosen = some_iterations<float>(SolverKind::npgs);
  CapturedSolve own(batch, {2, 3, 4}, chosen);
  own.capture();
  has_sorted(own.machine);
  own.replay(batch);
  EXPECT_TRUE(has_sorted(own.machine));
  expect_all(own.view, own.answer, batch.view(), solve(batch, chosen));
}

/// The launch that fails may be before the condition, in the work behind it, or the condition itself.
TEST(DeviceCondition, ACaptureThatFailsLeavesTheStreamsFree) {
  const Pool pool;
  const JacobianBatch<float> batch = batch_with_left(pool, {1});
  int failures = 0;
  for (int n = 0;; ++n) {
    CapturedSolve own(batch, {1, 3, 4});
    own.device->begin_capture(own.stream.get());
    own.device->fail_call(cuda::DeviceCall::launch, n);
    bool has_failed = false;
    try {
      own.machine.solve(own.view, own.answer.view(), StreamRef(own.stream.get()));
    } catch (const Error&) {
      has_failed = true;
    }
    own.device->fail_call(cuda::DeviceCall::launch, -1);
    try {
      own.device->end_capture(own.stream.get());
    } catch (const Error&) {
      EXPECT_TRUE(has_failed) << "a stream was not joined back";
    }
    if (!has_failed) break;
    ++failures;
    own.capture();
    if (n % 8 != 0) continue;
    own.replay(batch);
    expect_all(own.view, own.answer, batch.view(), solve(batch, few_iterations()));
  }
  EXPECT_GT(failures, 20);
}

TEST(EmulatedCondition, IsReadWhenItsTurnComes) {
  cuda::EmulatedDevice device({1, 1, 3});
  const cuda::Stream stream(device), inner(device);
  const int one = 1;
  int target = 0, before = 0;
  Offset condition = 0, next = 0;
  device.begin_capture(stream.get());
  device.copy(&condition, &next, sizeof(Offset), cuda::CopyKind::on_device, stream.get());
  device.conditionally(&condition, stream.get(), inner.get(), [&](cuda::StreamHandle own) {
    EXPECT_EQ(own, inner.get());
    EXPECT_TRUE(device.capturing(own));
    device.copy(&target, &one, sizeof(int), cuda::CopyKind::on_device, own);
  });
  EXPECT_FALSE(device.capturing(inner.get()));
  device.copy(&before, &target, sizeof(int), cuda::CopyKind::on_device, stream.get());
  const auto graph = device.end_capture(stream.get());
  for (const Offset value : {0, 5, 0, -1}) {
    target = 0;
    next = value;
    device.launch(graph, stream.get());
    device.synchronize(stream.get());
    EXPECT_EQ(target, value != 0 ? 1 : 0) << value;
    EXPECT_EQ(before, target) << "what follows comes after it";
  }
}

TEST(EmulatedCondition, ACaptureTakesNoEventOfAnother) {
  cuda::EmulatedDevice device;
  const cuda::Stream stream(device), inner(device);
  const cuda::Event event(device);
  const Offset condition = 1;
  device.begin_capture(stream.get());
  device.record(event.get(), stream.get());
  EXPECT_THROW(device.conditionally(&condition, stream.get(), inner.get(),
                                    [&](cuda::StreamHandle own) { device.wait(own, event.get()); }),
               Error);
  EXPECT_FALSE(device.capturing(inner.get()));
  EXPECT_NO_THROW(device.end_capture(stream.get()));
}

}  // namespace
}  // namespace stiction::test
