#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "cuda/emulated/emulated_device.hpp"
#include "cuda/machine/warm_start_machine.hpp"
#include "stiction/error.hpp"
#include "stiction/warm_start.hpp"
#include "tests/support/systems/warm_start_life.hpp"

/// The warm-start store of a device, on the emulated device: the same guesses and records as the CPU's, to the last
/// bit.
namespace stiction::test {
namespace {

constexpr WarmStartCapacity kRoom{9, 150, 400};  // some environments do not fit

/// The two stores, called alike.
template <class Real>
struct Twins {
  explicit Twins(const cuda::EmulatedDeviceOptions& options)
      : device(std::make_shared<cuda::EmulatedDevice>(options)),
        there(device, kRoom, false),
        here(make_cpu_warm_start_machine<Real>(kRoom, 1)) {}

  void expect_same_step(const Step<Real>& step) {
    const Packed<Real> packed(step.envs);
    const WarmStartLoadJob<Real> load_job{{},  packed.batch.view(), packed.id.data(), nullptr, step.dt,
                                          0.9, StepScaling::capped};
    const WarmStartStoreJob<Real> store_job{
        {}, packed.batch.view(), packed.id.data(), packed.lambda.data(), packed.status.data(), step.dt};
    std::vector<Real> guess(packed.lambda.size(), Real(77)), expected = guess;
    WarmStartLoadJob<Real> own = load_job;
    own.guess = guess.data();
    there.load(own, stream);
    there.store(store_job, stream);
    there.reset(step.reset, stream);
    own.guess = expected.data();
    here->load(own, stream);
    here->store(store_job, stream);
    here->reset(step.reset, stream);
    std::vector<WarmStartRecord> record(step.envs.size()), expected_record(step.envs.size());
    there.records(record, stream);
    here->records(expected_record, stream);
    EXPECT_TRUE(same_bits(guess, expected));
    EXPECT_TRUE(same_bits(record, expected_record));
  }

  std::shared_ptr<cuda::EmulatedDevice> device;
  cuda::DeviceWarmStartMachine<Real> there;
  std::unique_ptr<WarmStartMachine<Real>> here;
  StreamRef stream = StreamRef::default_stream();
};

TEST(DeviceWarmStart, ServesAndRecordsWhatTheCpuDoesOnAnyLanesAndTeams) {
  for (const int lanes : {1, 2, 5}) {
    for (const std::uint64_t seed : {0, 1, 2}) {
      SCOPED_TRACE(std::to_string(lanes) + " lanes, seed " + std::to_string(seed));
      std::mt19937_64 random(100 + seed);
      Twins<float> single({lanes, 1 + lanes, seed});
      for (const auto& step : random_life<float>(random, 9, 12)) single.expect_same_step(step);
      Twins<double> twice({lanes, 4 - static_cast<Offset>(seed), seed});
      for (const auto& step : random_life<double>(random, 9, 12)) twice.expect_same_step(step);
    }
  }
}

TEST(DeviceWarmStart, AStepIsCapturedAndReplayedWithOtherContacts) {
  std::mt19937_64 random(7);
  auto life = random_life<float>(random, 9, 20);
  const auto device = std::make_shared<cuda::EmulatedDevice>(cuda::EmulatedDeviceOptions{3, 2, 4});
  cuda::DeviceWarmStartMachine<float> there(device, kRoom, false);
  const auto here = make_cpu_warm_start_machine<float>(kRoom, 1);
  const cuda::Stream own(*device);
  const StreamRef stream(own.get());
  // Device memory with room for any step; the emulated device reads the host's.
  std::vector<Offset> env_rows(10), env_cones(10), cone_rows(2001);
  std::vector<ConeKind> kind(2000);
  std::vector<std::uint64_t> id(2000);
  std::vector<float> lambda(8000), guess(8000);
  std::vector<EnvStatus> status(9);
  ContactBatchView<float> view;
  view.env_count = 9;
  view.cone_count = 2000;
  view.row_count = 8000;
  view.env_row_offsets = env_rows.data();
  view.env_cone_offsets = env_cones.data();
  view.cone_kind = kind.data();
  view.cone_row_offsets = cone_rows.data();
  view.space = MemorySpace::cuda;
  std::shared_ptr<const cuda::EmulatedDevice::Graph> graph;
  device->begin_capture(own.get());
  there.load({{}, view, id.data(), guess.data(), 0.01, 0.9, StepScaling::capped}, stream);
  there.store({{}, view, id.data(), lambda.data(), status.data(), 0.01}, stream);
  EXPECT_THROW(there.reset(std::vector<Offset>{1}, stream), Error);
  graph = device->end_capture(own.get());
  for (const auto& step : life) {
    const Packed<float> packed(step.envs);
    const auto& arrays = packed.batch.arrays();
    std::copy(arrays.env_row_offsets.begin(), arrays.env_row_offsets.end(), env_rows.begin());
    std::copy(arrays.env_cone_offsets.begin(), arrays.env_cone_offsets.end(), env_cones.begin());
    std::copy(arrays.cone_row_offsets.begin(), arrays.cone_row_offsets.end(), cone_rows.begin());
    std::copy(arrays.cone_kind.begin(), arrays.cone_kind.end(), kind.begin());
    std::copy(packed.id.begin(), packed.id.end(), id.begin());
    std::copy(packed.lambda.begin(), packed.lambda.end(), lambda.begin());
    std::copy(packed.status.begin(), packed.status.end(), status.begin());
    device->launch(graph, own.get());
    device->synchronize(own.get());
    std::vector<float> expected(packed.lambda.size());
    here->load({{}, packed.batch.view(), packed.id.data(), expected.data(), 0.01, 0.9, StepScaling::capped}, stream);
    here->store({{}, packed.batch.view(), packed.id.data(), packed.lambda.data(), packed.status.data(), 0.01}, stream);
    EXPECT_TRUE(same_bits(
        std::vector<float>(guess.begin(), guess.begin() + static_cast<std::ptrdiff_t>(expected.size())), expected));
  }
}

TEST(DeviceWarmStart, AFailingDeviceLeavesNothingBehind) {
  for (const auto call : {cuda::DeviceCall::allocate, cuda::DeviceCall::create, cuda::DeviceCall::copy,
                          cuda::DeviceCall::launch, cuda::DeviceCall::synchronize}) {
    const auto device = std::make_shared<cuda::EmulatedDevice>();
    int failures = 0;
    for (int n = 0; n < 20; ++n) {
      device->fail_call(call, n);
      try {
        cuda::DeviceWarmStartMachine<double> store(device, kRoom, true);
        store.reset(std::vector<Offset>{2}, StreamRef::default_stream());
        store.reset_where(nullptr, StreamRef::default_stream());
      } catch (const Error&) {
        ++failures;
      }
      EXPECT_EQ(device->live_allocations(), 0U);
      EXPECT_EQ(device->live_handles(), 0U);
    }
    EXPECT_GT(failures, 0) << "call " << static_cast<int>(call);
  }
}

TEST(DeviceWarmStart, ThePublicStoreWorksOnTheEmulatedDevice) {
  Packed<double> step({{{{5, ConeKind::unilateral, 1}, {6, ConeKind::unilateral, 1}}, {2.0, 3.0}}});
  auto view = step.batch.view();
  WarmStartOptions options;
  options.beta = 0.5;
  WarmStartStore<double> store(Device::emulated(), {1, 2, 2}, options);
  std::vector<double> guess(2, 77.0);
  EXPECT_THROW(store.load(view, step.id.data(), 0.01, guess.data()), Error) << "memory of the host";
  view.space = MemorySpace::cuda;
  store.store(view, step.id.data(), {step.lambda.data(), nullptr, step.status.data()}, 0.01);
  store.load(view, step.id.data(), 0.02, guess.data());
  EXPECT_EQ(guess, (std::vector<double>{0.5, 0.75}));
  std::vector<WarmStartRecord> record(1);
  store.records(record);
  EXPECT_EQ(record[0].hits, 2);
}

}  // namespace
}  // namespace stiction::test
