#include <gtest/gtest.h>

#include <map>
#include <set>
#include <string>

#include "cuda/emulated/emulated_device.hpp"
#include "cuda/machine/contact_machine.hpp"
#include "stiction/error.hpp"
#include "stiction/trace.hpp"
#include "tests/support/machines/device_batch.hpp"

/// Contents of a device's trace: measured by events on its streams, and nothing of the answer's bits.
namespace stiction::test {
namespace {

SolverOptions traced(Tracer* tracer) {
  SolverOptions options;
  options.max_iterations = 12;
  options.threads = 1;
  options.tracer = tracer;
  return options;
}

std::multiset<std::string> device_names(const Tracer& tracer) {
  std::multiset<std::string> names;
  for (const Span& span : tracer.spans())
    if (span.place == SpanPlace::device) names.insert(span.name);
  return names;
}

Solution<float> room_for(const ContactBatch<float>& batch) {
  const auto rows = static_cast<std::size_t>(batch.row_count());
  return {std::vector<float>(rows), std::vector<float>(rows),
          std::vector<EnvStatus>(static_cast<std::size_t>(batch.env_count()))};
}

SolutionView<float> view_of(Solution<float>& answer) {
  return {answer.lambda.data(), answer.w.data(), answer.status.data()};
}

TEST(DeviceTrace, AHostBatchsPiecesAreTimedOnTheWayUpThroughAndDown) {
  const ContactBatch<float> batch = convert<float>(ragged_batch(6, 3));
  const auto expected = solve_hashes(batch, traced(nullptr));
  for (const std::uint64_t seed : {0, 1, 2}) {
    Tracer tracer;
    const SolverOptions options = traced(&tracer);
    auto device = std::make_shared<cuda::EmulatedDevice>(cuda::EmulatedDeviceOptions{2, 3, seed});
    cuda::DeviceContactMachine machine(device, 1 << 14);
    Solution<float> answer = room_for(batch);
    machine.solve(SolveRequest<float>{nullptr, batch.view(), view_of(answer), nullptr, batch.law(), options,
                                      StreamRef::default_stream()});
    EXPECT_EQ(env_hashes(batch, answer), expected);

    const auto names = device_names(tracer);
    const std::size_t pieces = names.count("upload");
    EXPECT_GT(pieces, 2U);
    EXPECT_EQ(names.count("download"), pieces);
    EXPECT_EQ(names.count("plan"), pieces);
    EXPECT_EQ(names.count("trivial"), pieces);
    EXPECT_EQ(names.count("thread_small"), pieces);
    // Piece by piece: up before its plan, the plan before its classes, those before down.
    std::map<std::string, std::vector<Span>> by_name;
    for (const Span& span : tracer.spans())
      if (span.place == SpanPlace::device) by_name[span.name].push_back(span);
    const auto end = [](const Span& span) { return span.start + span.duration; };
    for (std::size_t k = 0; k < pieces; ++k) {
      EXPECT_LE(end(by_name["upload"][k]), by_name["plan"][k].start);
      for (const char* kernel : {"trivial", "thread_small"}) {
        EXPECT_LE(end(by_name["plan"][k]), by_name[kernel][k].start) << kernel;
        EXPECT_LE(end(by_name[kernel][k]), by_name["download"][k].start) << kernel;
      }
      EXPECT_GE(by_name["thread_small"][k].duration, 0);
      EXPECT_NE(by_name["thread_small"][k].detail, nullptr);
    }
    EXPECT_EQ(tracer.left_out(), 0U);
  }
}

TEST(DeviceTrace, DeviceSpansLieOnTheHostsClock) {
  const ContactBatch<float> batch = convert<float>(ragged_batch(3, 5));
  Tracer tracer;
  solve(batch, traced(&tracer), Device::emulated());
  const auto spans = tracer.spans();
  const auto whole =
      std::find_if(spans.begin(), spans.end(), [](const Span& s) { return std::string(s.name) == "solve"; });
  ASSERT_NE(whole, spans.end());
  for (const Span& span : spans) {
    if (span.place != SpanPlace::device) continue;
    // The host reads its clock after the event that both are counted from: a span may begin so much late, never early.
    EXPECT_GE(span.start, whole->start) << span.name;
  }
}

TEST(DeviceTrace, ADeviceBatchsSpansComeWhenItIsWaitedFor) {
  const ContactBatch<float> batch = convert<float>(ragged_batch(3, 5));
  Tracer tracer;
  // The last solve is done when the solver goes, so its outputs outlive it.
  Solution<float> answer = room_for(batch);
  {
    const Solver solver(Device::emulated(), traced(&tracer));
    ContactBatchView<float> there = batch.view();
    there.space = MemorySpace::cuda;
    const SolutionView<float> view = view_of(answer);
    const Plan plan = solver.plan(there);
    solver.solve(plan, there, view);
    EXPECT_EQ(device_names(tracer).size(), 0U) << "nothing has run yet";
    solver.synchronize();
    const std::size_t first = device_names(tracer).size();
    EXPECT_GT(first, 2U);
    solver.solve(plan, there, view);
    EXPECT_EQ(device_names(tracer).size(), first);
    EXPECT_EQ(env_hashes(batch, answer), solve_hashes(batch, traced(nullptr)));
  }
  EXPECT_EQ(device_names(tracer).count("plan"), 1U) << "the second solve had its plan";
  EXPECT_EQ(device_names(tracer).count("trivial"), 2U) << "the last spans came with the solver's end";
}

TEST(DeviceTrace, NothingIsTimedInACaptureAndNothingIsMadeWithoutATracer) {
  const ContactBatch<float> batch = convert<float>(ragged_batch(2, 7));
  Tracer tracer;
  cuda::EmulatedDevice device({2, 3, 5});
  const Capacity room = Capacity::of(batch.view());
  cuda::Engine engine(device);
  engine.reserve(room, SolverKind::npgs, Precision::f32);
  const cuda::Stream stream(device);
  DeviceBatch<float> there(device, room);
  there.fill(batch, stream.get());
  device.synchronize(stream.get());
  const auto solve_with = [&](const SolverOptions& options) {
    engine.solve(SolveRequest<float>{nullptr, there.view(), there.solution(), nullptr, batch.law(), options,
                                     StreamRef(stream.get())});
  };
  const std::size_t handles = device.live_handles();
  solve_with(traced(nullptr));
  EXPECT_EQ(device.live_handles(), handles);
  device.begin_capture(stream.get());
  solve_with(traced(&tracer));
  const auto graph = device.end_capture(stream.get());
  EXPECT_EQ(device.live_handles(), handles);
  device.launch(graph, stream.get());
  EXPECT_EQ(env_hashes(batch, there.fetch(batch, stream.get())), solve_hashes(batch, traced(nullptr)));
  engine.timer().collect();
  EXPECT_TRUE(tracer.spans().empty());
  solve_with(traced(&tracer));
  EXPECT_GT(device.live_handles(), handles);
  device.synchronize(stream.get());
  engine.timer().collect();
  EXPECT_FALSE(tracer.spans().empty());
}

TEST(DeviceTrace, ACallThatFailsWhileTimingLeavesNothingBehind) {
  const ContactBatch<float> batch = convert<float>(ragged_batch(2, 7));
  const auto expected = solve_hashes(batch, traced(nullptr));
  for (const cuda::DeviceCall call :
       {cuda::DeviceCall::create, cuda::DeviceCall::launch, cuda::DeviceCall::synchronize})
    for (int n = 0; n < 6; ++n) {
      auto device = std::make_shared<cuda::EmulatedDevice>(cuda::EmulatedDeviceOptions{1, 2, 3});
      Tracer tracer;
      {
        cuda::DeviceContactMachine machine(device, 1 << 14);
        const SolverOptions options = traced(&tracer);
        Solution<float> answer = room_for(batch);
        const SolveRequest<float> request{
            nullptr, batch.view(), view_of(answer), nullptr, batch.law(), options, StreamRef::default_stream()};
        device->fail_call(call, n);
        try {
          machine.solve(request);
        } catch (const Error& error) {
          EXPECT_EQ(error.code(), ErrorCode::device_failure);
        }
        device->fail_call(call, -1);
        machine.solve(request);
        EXPECT_EQ(env_hashes(batch, answer), expected);
      }
      EXPECT_EQ(device->live_handles(), 0U);
      EXPECT_EQ(device->live_allocations(), 0U);
    }
}

}  // namespace
}  // namespace stiction::test
