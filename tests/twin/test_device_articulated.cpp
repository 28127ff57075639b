#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "cuda/kernels/robots_program.hpp"
#include "cuda/machine/articulated_machine.hpp"
#include "stiction/error.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/golden/robots.hpp"
#include "tests/support/machines/counting_device.hpp"
#include "tests/support/machines/device_robots.hpp"
#include "tests/support/systems/heap.hpp"

/// Robots on the emulated device: what the GPU's host code queues gives the CPU's bits. The golden rows are computed
/// by twin/test_device_golden.cpp.
namespace stiction::test {
namespace {

using cuda::DeviceCall;
using cuda::EmulatedDevice;
using cuda::EmulatedDeviceOptions;

template <class Real>
void expect_twins(const ArticulatedDescription& model, const ArticulatedOptions& options, Index steps) {
  auto here = robots_on<Real>(Device::cpu(), model, kEnvs, options),
       there = robots_on<Real>(Device::emulated(), model, kEnvs, options);
  for (auto* robots : {&here, &there}) {
    robots->step(steps);
    robots->step();
  }
  expect_same(here, there);
  for (auto* robots : {&here, &there}) robots->forward();
  expect_same(here, there);
}

TEST(DeviceArticulated, AnEmulatedDeviceGivesTheCpusBits) {
  for (const bool is_elliptic : {false, true})
    for (const bool varies : {false, true})
      for (const ArticulatedDescription& model :
           {walker(is_elliptic), walker(is_elliptic, true), walker_and_crate(is_elliptic)}) {
        SCOPED_TRACE(std::string(is_elliptic ? "elliptic" : "pyramids") + (varies ? ", varied" : "") +
                     (model.is_rk4             ? ", rk4"
                      : model.is_implicit_fast ? ", crate"
                                               : ""));
        const ArticulatedOptions options = varies ? observing(varied_of(model)) : observing();
        expect_twins<float>(model, options, 5);
        expect_twins<double>(model, options, 5);
      }
}

TEST(DeviceArticulated, BodiesOfEveryShapeTouchAsOnTheCpu) {
  expect_twins<float>(heap(), {1e-5, 100, 1}, 30);
  expect_twins<double>(heap(), {1e-5, 100, 1}, 30);
}

TEST(DeviceArticulated, ProbesAreThoseOfTheCpu) {
  const ArticulatedDescription model = walker_and_crate(true);
  auto here = robots_on<double>(Device::cpu(), model, 5, observing()),
       there = robots_on<double>(Device::emulated(), model, 5, observing());
  here.step(6);
  there.step(6);
  const ArticulatedProbe expected = here.probe(), found = there.probe();
  EXPECT_GT(expected.contacts[3], 0);
  for (const auto array :
       {&ArticulatedProbe::M, &ArticulatedProbe::bias, &ArticulatedProbe::passive, &ArticulatedProbe::actuator,
        &ArticulatedProbe::qacc_smooth, &ArticulatedProbe::qacc, &ArticulatedProbe::J, &ArticulatedProbe::aref,
        &ArticulatedProbe::R, &ArticulatedProbe::contact})
    EXPECT_TRUE(same_bits<double>(expected.*array, found.*array));
  EXPECT_EQ(expected.rows, found.rows);
  EXPECT_EQ(expected.contacts, found.contacts);
  EXPECT_EQ(expected.pair, found.pair);
  expect_same(here, there);
}

/// One is left out, one has a state that is not finite, one a constant out of range. They keep what they had.
TEST(DeviceArticulated, BrokenAndInactiveEnvironmentsStayAsOnTheCpu) {
  constexpr std::size_t kBroken = 3, kLeft = 5, kOut = 8;
  for (const bool is_rk4 : {false, true}) {
    const ArticulatedDescription model = walker(false, is_rk4);
    auto here = robots_on<double>(Device::cpu(), model, kEnvs, observing({VariedArray::pair_friction})),
         there = robots_on<double>(Device::emulated(), model, kEnvs, observing({VariedArray::pair_friction}));
    std::vector<std::uint8_t> active(static_cast<std::size_t>(kEnvs), 1);
    active[kLeft] = 0;
    for (auto* robots : {&here, &there}) {
      const std::span<double> xpos = robots->observed(ObservedArray::xpos);
      std::fill(xpos.begin(), xpos.end(), -1);
      robots->step(2, active);
      EXPECT_EQ(robots->observed(ObservedArray::xpos)[kLeft * xpos.size() / static_cast<std::size_t>(kEnvs)], -1);
      EXPECT_EQ(robots->status()[kLeft].solver, EnvStatus{}.solver);
    }
    expect_same(here, there);
    for (auto* robots : {&here, &there}) {
      const auto nv = static_cast<std::size_t>(robots->dof_count());
      const auto width = static_cast<std::size_t>(robots->varied_width(VariedArray::pair_friction));
      robots->step();
      robots->qvel()[kBroken * nv + 7] = std::nan("");
      robots->varied(VariedArray::pair_friction)[kOut * width + 2] = -1;
      robots->step(3, active);
      EXPECT_EQ(robots->status()[kBroken].code, EnvCode::invalid_input);
      EXPECT_EQ(robots->status()[kOut].code, EnvCode::invalid_input);
      EXPECT_EQ(robots->status()[kLeft].code, EnvCode::solved);
    }
    expect_same(here, there);
    for (auto* robots : {&here, &there}) {
      robots->qvel()[kBroken * static_cast<std::size_t>(robots->dof_count()) + 7] = 0;
      robots->step(2);
      EXPECT_EQ(robots->status()[kBroken].code, EnvCode::solved);
    }
    expect_same(here, there);
  }
}

/// Three warps of environments, the last one not full, and memory for one team, two or all.
TEST(DeviceArticulated, LanesTeamsOrdersAndMemoryDoNotReachTheBits) {
  constexpr Offset kMany = 70;
  const ArticulatedDescription model = walker(true);
  const auto check = [&](auto real) {
    using Real = decltype(real);
    auto expected = robots_on<Real>(Device::cpu(), model, kMany, observing());
    expected.step(3);
    for (const EmulatedDeviceOptions& options :
         {EmulatedDeviceOptions{1, 1, 0}, EmulatedDeviceOptions{2, 3, 1}, EmulatedDeviceOptions{5, 2, 2}})
      for (const Offset most_bytes : {Offset{1}, Offset{1} << 30}) {
        SCOPED_TRACE(std::to_string(options.lanes) + " lanes, " + std::to_string(most_bytes) + " bytes");
        HostRobots<Real> own(model, kMany, observing());
        const auto machine = cuda::make_device_articulated_machine(std::make_shared<EmulatedDevice>(options), own.job,
                                                                   kMany, most_bytes);
        own.step(*machine, kMany, 3);
        EXPECT_TRUE(same_bits(expected.status(), std::span<const EnvStatus>(own.status)));
        EXPECT_TRUE(same_bits<Real>(expected.qpos(), own.batch.qpos()));
        EXPECT_TRUE(same_bits<Real>(expected.qacc(), own.batch.qacc()));
        EXPECT_TRUE(
            same_bits<Real>(expected.observed(ObservedArray::cfrc_ext), own.batch.observed(ObservedArray::cfrc_ext)));
      }
  };
  check(float{});
  check(double{});
}

/// Memory of lanes stays below what it may take, however many environments there are.
TEST(DeviceArticulated, MemoryOfLanesIsBounded) {
  const ArticulatedModel<double> model(walker(false), 0);
  ArticulatedJob<double> job{};
  job.model = model.view();
  const auto allocated = [&](Offset envs, Offset most_bytes, Offset& teams) {
    const auto device = std::make_shared<CountingDevice>(kGpus[0]);
    const auto machine = cuda::make_device_articulated_machine(device, job, envs, most_bytes);
    machine->step(job, envs, 1, StreamRef::default_stream());
    teams = device->shapes.at("step_robots").teams;
    return static_cast<Offset>(device->allocated);
  };
  constexpr Offset kEnvsHere = Offset{1} << 20, kRoom = Offset{1} << 26;
  Offset one = 0, some = 0, all = 0;
  const Offset least = allocated(kEnvsHere, 1, one), most = allocated(kEnvsHere, kRoom, some);
  EXPECT_EQ(one, 1);
  EXPECT_GT(some, 4);
  const Offset team = (most - least) / (some - 1);
  EXPECT_LE(some * team, kRoom);
  EXPECT_GT((some + 1) * team, kRoom);
  allocated(kEnvsHere, std::numeric_limits<Offset>::max(), all);
  EXPECT_EQ(all, 16 * kGpus[0].processors);
  allocated(40, kRoom, all);
  EXPECT_EQ(all, 2);
}

/// Jobs of two equal batches differ in their pointers alone. None of these may reach a kernel: a GPU has other memory.
TEST(DeviceArticulated, NoPointerOfTheHostReachesTheKernel) {
  using Words = std::array<std::uintptr_t, sizeof(ArticulatedJob<double>) / sizeof(std::uintptr_t)>;
  const auto words_of = [](const ArticulatedJob<double>& job) {
    Words words;
    std::memcpy(words.data(), &job, sizeof(words));
    return words;
  };
  std::vector<std::uint8_t> active(9, 1);
  std::vector<std::uint64_t> touched(9);
  HostRobots<double> own(walker(true), 9, observing({VariedArray::body_mass})),
      other(walker(true), 9, observing({VariedArray::body_mass}));
  own.job.active = active.data();
  own.job.touched = touched.data();
  const auto device = std::make_shared<CountingDevice>(kGpus[0]);
  cuda::make_device_articulated_machine(device, own.job, 9, 1)->step(own.job, 9, 1, StreamRef::default_stream());
  cuda::RobotsArgs<double> args;
  ASSERT_EQ(device->arguments.size(), sizeof(args));
  std::memcpy(&args, device->arguments.data(), sizeof(args));
  const Words here = words_of(own.job), elsewhere = words_of(other.job), there = words_of(args.job);
  const auto begin = reinterpret_cast<std::uintptr_t>(device.get());
  int pointers = 0;
  for (std::size_t k = 0; k < here.size(); ++k) {
    if (here[k] == elsewhere[k]) continue;
    ++pointers;
    EXPECT_TRUE(there[k] == 0 || (there[k] >= begin && there[k] < begin + device->allocated)) << "word " << k;
  }
  // All arrays of the model but tendons, of which it has none, and of the job but a probe.
  EXPECT_EQ(pointers, 13 + 11);
}

TEST(DeviceArticulated, ACallIsOneLaunch) {
  const auto held = cuda::shared_emulated_device();  // counts for as long as it is held
  auto robots = robots_on<float>(Device::emulated(), walker(false), 3, {1e-5, 100, 1});
  const int before = held->calls(DeviceCall::launch), allocations = held->calls(DeviceCall::allocate);
  robots.step(4);
  EXPECT_EQ(held->calls(DeviceCall::launch), before + 1);
  EXPECT_EQ(held->calls(DeviceCall::allocate), allocations);
  robots.step(0);
  EXPECT_EQ(held->calls(DeviceCall::launch), before + 1);
}

TEST(DeviceArticulated, ABatchOfNothingSteps) {
  ArticulatedBatch<double> none(Device::emulated(), walker(false), 0);
  none.step(2);
  EXPECT_TRUE(none.status().empty());
}

TEST(DeviceArticulated, ADeviceThatFailsAtAnyCallIsAnErrorAndLeaksNothing) {
  for (const DeviceCall call :
       {DeviceCall::create, DeviceCall::allocate, DeviceCall::copy, DeviceCall::launch, DeviceCall::synchronize}) {
    int failures = 0;
    for (bool failed = true; failed; ++failures) {
      failed = false;
      const auto device = std::make_shared<EmulatedDevice>();
      device->fail_call(call, failures);
      try {
        HostRobots<double> own(walker(false), 2, observing());
        const auto machine = cuda::make_device_articulated_machine(device, own.job, 2, Offset{1} << 28);
        own.step(*machine, 2, 1);
        device->fail_call(call, -1);
      } catch (const Error& error) {
        failed = true;
        EXPECT_TRUE(error.code() == ErrorCode::device_failure || error.code() == ErrorCode::out_of_memory);
      }
      EXPECT_EQ(device->live_allocations(), 0U);
      EXPECT_EQ(device->live_handles(), 0U);
    }
    EXPECT_GT(failures, 1) << "call " << static_cast<int>(call);
  }
}

}  // namespace
}  // namespace stiction::test
