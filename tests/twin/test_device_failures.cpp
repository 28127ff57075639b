#include <gtest/gtest.h>

#include "cuda/emulated/emulated_device.hpp"
#include "cuda/machine/contact_machine.hpp"
#include "stiction/error.hpp"
#include "tests/support/machines/device_batch.hpp"

/// A device that fails at any call. The caller gets an error, its arrays stay as they were, nothing leaks, and the
/// next solve on a sound device is right.
namespace stiction::test {
namespace {

constexpr float kUntouched = -77.5F;
/// A piece so small that a batch passes through the buffers in many of them.
constexpr Offset kSmallPiece = 3000;
/// Still small: a batch passes through in a few pieces.
constexpr Offset kPiece = 40000;

struct Call {
  ContactBatch<float> batch = convert<float>(ragged_batch(2, 5));
  SolverOptions options;
  Solution<float> answer;

  Call() {
    options.max_iterations = 2;  // queued work does not depend on them
    options.invalid = InvalidPolicy::isolate;
    options.threads = 1;
    const auto rows = static_cast<std::size_t>(batch.row_count());
    answer.lambda.assign(rows, kUntouched);
    answer.w.assign(rows, kUntouched);
    answer.status.assign(static_cast<std::size_t>(batch.env_count()), EnvStatus{-1, -1, 99, -5, {}, {}, {}, -9});
  }
  SolveRequest<float> request() {
    return {nullptr,
            batch.view(),
            {answer.lambda.data(), answer.w.data(), answer.status.data()},
            nullptr,
            batch.law(),
            options,
            StreamRef::default_stream()};
  }
  [[nodiscard]] bool is_untouched() const {
    bool same = true;
    for (const float value : answer.lambda) same = same && value == kUntouched;
    for (const float value : answer.w) same = same && value == kUntouched;
    for (const EnvStatus& status : answer.status) same = same && status.iterations == -5 && status.flags == 99;
    return same;
  }
};

TEST(DeviceStaging, ABatchInManyPiecesIsAnsweredAsAWhole) {
  Call call;
  const auto expected = solve_hashes(call.batch, call.options);
  for (const std::uint64_t seed : {0, 1, 2, 3}) {
    const auto device = std::make_shared<cuda::EmulatedDevice>(cuda::EmulatedDeviceOptions{2, 3, seed});
    cuda::DeviceContactMachine machine(device, kSmallPiece);
    machine.solve(call.request());
    EXPECT_EQ(env_hashes(call.batch, call.answer), expected) << seed;
    EXPECT_GT(device->calls(cuda::DeviceCall::copy), 30);
  }
}

TEST(DeviceStaging, RowsThatAreNotInUseStayTheCallers) {
  // Room for one row and one cone more than each environment has.
  const ContactBatch<double> tight = scene_batch("stack", 3, 1, 2);
  const ContactBatchView<double> view = tight.view();
  std::vector<Index> rows, cones;
  for (Offset e = 0; e < view.env_count; ++e) {
    rows.push_back(view.env_rows(e) - 3);
    cones.push_back(view.env_cones(e) - 1);
  }
  std::vector<Index> entries(static_cast<std::size_t>(view.row_count));
  for (Offset e = 0; e < view.env_count; ++e)
    for (Offset row = view.env_row_offsets[e]; row < view.env_row_offsets[e + 1]; ++row) {
      Index kept = 0;
      const Offset begin = view.row_offsets[row];
      while (begin + kept < view.row_offsets[row + 1] && view.column[begin + kept] < rows[static_cast<std::size_t>(e)])
        ++kept;
      entries[static_cast<std::size_t>(row)] = kept;
    }
  ContactBatchView<double> padded = view;
  padded.env_row_counts = rows.data();
  padded.env_cone_counts = cones.data();
  padded.row_counts = entries.data();
  std::vector<double> lambda(static_cast<std::size_t>(view.row_count), -3.25);
  std::vector<EnvStatus> status(static_cast<std::size_t>(view.env_count));
  const auto device = std::make_shared<cuda::EmulatedDevice>();
  cuda::DeviceContactMachine machine(device, 1);
  machine.solve(SolveRequest<double>{nullptr,
                                     padded,
                                     {lambda.data(), nullptr, status.data()},
                                     nullptr,
                                     view.law,
                                     SolverOptions{},
                                     StreamRef::default_stream()});
  for (Offset e = 0; e < view.env_count; ++e) {
    EXPECT_EQ(status[static_cast<std::size_t>(e)].flags, 0U);
    for (Index row = rows[static_cast<std::size_t>(e)]; row < view.env_rows(e); ++row)
      EXPECT_EQ(lambda[static_cast<std::size_t>(view.env_row_offsets[e] + row)], -3.25);
    EXPECT_NE(lambda[static_cast<std::size_t>(view.env_row_offsets[e])], -3.25);
  }
}

class DeviceFailures : public ::testing::TestWithParam<cuda::DeviceCall> {};

TEST_P(DeviceFailures, BecomeErrorsAndLeaveNothingBehind) {
  Call fresh;
  const auto expected = solve_hashes(fresh.batch, fresh.options);
  const auto sound = std::make_shared<cuda::EmulatedDevice>(cuda::EmulatedDeviceOptions{1, 2, 9});
  cuda::DeviceContactMachine(sound, kPiece).solve(fresh.request());
  const int calls = sound->calls(GetParam());
  int failures = 0;
  for (int n = 0; n < calls; ++n) {
    Call call;
    const auto device = std::make_shared<cuda::EmulatedDevice>(cuda::EmulatedDeviceOptions{1, 2, 9});
    device->fail_call(GetParam(), n);
    bool failed = false;
    try {
      cuda::DeviceContactMachine machine(device, kPiece);
      machine.solve(call.request());
    } catch (const Error& error) {
      failed = true;
      EXPECT_EQ(error.code() == ErrorCode::out_of_memory, GetParam() == cuda::DeviceCall::allocate);
    }
    EXPECT_EQ(device->live_allocations(), 0U) << "call " << n;
    EXPECT_EQ(device->live_handles(), 0U) << "call " << n;
    // A wait that fails while everything is given back, after the answer, loses nothing.
    if (!failed) {
      EXPECT_EQ(env_hashes(call.batch, call.answer), expected) << "call " << n;
      continue;
    }
    ++failures;
    EXPECT_TRUE(call.is_untouched()) << "call " << n;
  }
  EXPECT_GT(failures, 0);
}

TEST_P(DeviceFailures, TheSameMachineGoesOnAfterOne) {
  Call fresh;
  const auto expected = solve_hashes(fresh.batch, fresh.options);
  const auto device = std::make_shared<cuda::EmulatedDevice>(cuda::EmulatedDeviceOptions{1, 2, 4});
  cuda::DeviceContactMachine machine(device, kPiece);
  for (int n = 0; n < 12; ++n) {
    Call failing;
    device->fail_call(GetParam(), n);
    try {
      machine.solve(failing.request());
    } catch (const Error&) {
      EXPECT_TRUE(failing.is_untouched());
    }
    device->fail_call(GetParam(), -1);
    Call next;
    machine.solve(next.request());
    EXPECT_EQ(env_hashes(next.batch, next.answer), expected) << "after call " << n;
  }
}

INSTANTIATE_TEST_SUITE_P(EveryCall, DeviceFailures,
                         ::testing::Values(cuda::DeviceCall::allocate, cuda::DeviceCall::copy, cuda::DeviceCall::launch,
                                           cuda::DeviceCall::synchronize, cuda::DeviceCall::create));

TEST(DeviceCapture, WhatWaitsOrAllocatesWhileCapturedIsAnError) {
  cuda::EmulatedDevice device;
  const cuda::Stream stream(device), other(device);
  const cuda::Event event(device), outside(device);
  device.record(outside.get(), other.get());
  device.begin_capture(stream.get());
  EXPECT_THROW(device.synchronize(stream.get()), Error);
  EXPECT_THROW(device.allocate(16), Error);
  EXPECT_THROW(device.wait(stream.get(), outside.get()), Error);
  // A stream that joins and is not joined back.
  device.record(event.get(), stream.get());
  device.wait(other.get(), event.get());
  EXPECT_TRUE(device.capturing(other.get()));
  EXPECT_THROW(device.end_capture(stream.get()), Error);
}

TEST(DeviceOrder, AStreamThatDoesNotWaitMayRunFirst) {
  // With some seed the second stream's copy comes before the first one's: the emulated device finds such mistakes.
  bool seen_early = false, seen_late = false;
  for (std::uint64_t seed = 1; seed < 40; ++seed) {
    cuda::EmulatedDevice device({1, 1, seed});
    const cuda::Stream first(device), second(device);
    int value = 1, target = 0, read = -1;
    device.copy(&target, &value, sizeof(int), cuda::CopyKind::on_device, first.get());
    device.copy(&read, &target, sizeof(int), cuda::CopyKind::on_device, second.get());
    device.synchronize(first.get());
    device.synchronize(second.get());
    (read == 0 ? seen_early : seen_late) = true;
  }
  EXPECT_TRUE(seen_early);
  EXPECT_TRUE(seen_late);
}

}  // namespace
}  // namespace stiction::test
