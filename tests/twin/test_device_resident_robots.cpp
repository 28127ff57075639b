#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "cuda/api/memory.hpp"
#include "cuda/emulated/emulated_device.hpp"
#include "cuda/machine/articulated_machine.hpp"
#include "stiction/error.hpp"
#include "tests/support/error_message.hpp"
#include "tests/support/golden/robots.hpp"
#include "tests/support/machines/device_robots.hpp"

/// Arrays of robots stay on a device between calls: what is copied, and that no change is lost on the way.
namespace stiction::test {
namespace {

using cuda::DeviceCall;
using cuda::EmulatedDevice;
using cuda::EmulatedDeviceOptions;

/// Copies on the emulated device that a call needs.
template <class F>
int copies_of(const F& call) {
  const auto device = cuda::shared_emulated_device();
  const int before = device->calls(DeviceCall::copy);
  call();
  return device->calls(DeviceCall::copy) - before;
}

TEST(ResidentRobots, OnlyWhatTheHostReadsOrChangesIsCopied) {
  const auto held = cuda::shared_emulated_device();  // counts for as long as it is held
  auto robots = robots_on<double>(Device::emulated(), walker(true), kEnvs, observing({VariedArray::body_mass}));
  robots.step();
  const auto step = [&] { robots.step(); };
  EXPECT_EQ(copies_of([&] {
              for (int k = 0; k < 5; ++k) robots.step(2);
              robots.forward();
            }),
            0);
  EXPECT_EQ(copies_of([&] { EXPECT_TRUE(std::isfinite(robots.qvel()[3])); }), 1);
  EXPECT_EQ(copies_of([&] { EXPECT_TRUE(std::isfinite(robots.qvel()[4])); }), 0);
  EXPECT_EQ(copies_of([&] { EXPECT_EQ(robots.status()[2].code, EnvCode::solved); }), 1);
  EXPECT_EQ(copies_of([&] { robots.ctrl()[1] = 0.25; }), 0);
  EXPECT_EQ(copies_of(step), 1);
  EXPECT_EQ(copies_of([&] { robots.varied(VariedArray::body_mass)[3] *= 1.125; }), 0);
  EXPECT_EQ(copies_of(step), 1);
  EXPECT_EQ(copies_of(step), 0);
  EXPECT_EQ(copies_of([&] { static_cast<void>(robots.hash()); }), 2);
  EXPECT_EQ(copies_of([&] { robots.synchronize(); }), 0);
}

/// A change of robots between steps.
template <class Real>
using Change = std::function<void(ArticulatedBatch<Real>&)>;
template <class Real>
std::vector<Change<Real>> changes() {
  using Robots = ArticulatedBatch<Real>;
  const auto reset = [](Robots& robots) {
    std::vector<std::uint8_t> mask(static_cast<std::size_t>(kEnvs), 0);
    for (const std::size_t env : {0U, 4U, 5U, 6U, 18U}) mask[env] = 1;
    robots.reset(mask);
  };
  const auto masked = [](Robots& robots) {
    std::vector<std::uint8_t> active(static_cast<std::size_t>(kEnvs), 1);
    active[2] = active[9] = 0;
    robots.step(2, active);
  };
  return {[](Robots& robots) { robots.qvel()[7] += static_cast<Real>(0.5); },
          reset,
          masked,
          [](Robots& robots) { robots.qpos()[40] = std::numeric_limits<Real>::quiet_NaN(); },
          [](Robots& robots) { robots.varied(VariedArray::pair_friction)[13] = static_cast<Real>(-1); },
          reset,
          [](Robots& robots) { robots.varied(VariedArray::pair_friction)[13] = static_cast<Real>(0.5); },
          [](Robots& robots) { robots.qfrc_applied()[30] = static_cast<Real>(3); },
          [](Robots& robots) { robots.qacc()[11] = robots.qacc()[50] = 0; },
          [](Robots& robots) { robots.time()[1] = 2.5; },
          [](Robots& robots) { static_cast<void>(robots.probe()); },
          [](Robots& robots) { robots.forward(); },
          [](Robots& robots) { robots.observed(ObservedArray::cvel)[5] = static_cast<Real>(-9); }};
}

template <class Real>
void expect_changes_reach_the_steps(bool reads_between) {
  const ArticulatedDescription model = walker(true);
  const ArticulatedOptions options = observing({VariedArray::pair_friction, VariedArray::body_mass});
  auto here = robots_on<Real>(Device::cpu(), model, kEnvs, options),
       there = robots_on<Real>(Device::emulated(), model, kEnvs, options);
  int change = 0;
  for (const Change<Real>& make : changes<Real>()) {
    SCOPED_TRACE("change " + std::to_string(change++));
    for (auto* robots : {&here, &there}) {
      make(*robots);
      robots->ctrl()[static_cast<std::size_t>(change)] = static_cast<Real>(0.01 * change);
      robots->step(2);
    }
    if (reads_between) expect_same(here, there);
  }
  expect_same(here, there);
}

TEST(ResidentRobots, ResetsEditsAndBrokenEnvironmentsAreThoseOfTheCpu) {
  for (const bool reads_between : {true, false}) {
    expect_changes_reach_the_steps<float>(reads_between);
    expect_changes_reach_the_steps<double>(reads_between);
  }
}

/// A reset environment has the state of a new batch, and others keep theirs.
TEST(ResidentRobots, AResetIsTheFirstStateOfMaskedEnvironments) {
  for (const Device device : {Device::cpu(), Device::emulated()}) {
    ArticulatedBatch<double> fresh(walker(false), 3);
    auto robots = robots_on<double>(device, walker(false), 3, observing());
    robots.step(3);
    const std::vector<double> before(robots.qpos().begin(), robots.qpos().end());
    robots.reset(std::vector<std::uint8_t>{0, 1, 1});
    const auto nq = static_cast<std::size_t>(robots.q_count()), nv = static_cast<std::size_t>(robots.dof_count());
    for (std::size_t k = 0; k < 3 * nq; ++k) EXPECT_EQ(robots.qpos()[k], k < nq ? before[k] : fresh.qpos()[k]) << k;
    for (std::size_t k = nv; k < 3 * nv; ++k) {
      EXPECT_EQ(robots.qvel()[k], 0);
      EXPECT_EQ(robots.qacc()[k], 0);
      EXPECT_EQ(robots.qfrc_applied()[k], 0);
    }
    EXPECT_NE(robots.qvel()[0], 0);
    EXPECT_EQ(robots.ctrl()[2], 0);
    EXPECT_NE(robots.ctrl()[0], 0);
    EXPECT_NEAR(robots.time()[0], 3 * walker(false).timestep, 1e-15);
    EXPECT_EQ(robots.time()[1], 0);
    EXPECT_EQ(robots.status()[1].code, EnvCode::solved);
    EXPECT_NE(error_message([&] { robots.reset(std::vector<std::uint8_t>{1}); }).find("mask has 1 entries, expected 3"),
              std::string::npos);
  }
}

/// A step that fails adds nothing, nor does one that is not made.
TEST(ResidentRobots, TimeIsThatOfTheStepsThatWereMade) {
  for (const Device device : {Device::cpu(), Device::emulated()}) {
    ArticulatedBatch<float> robots(device, walker(false), 2, observing());
    robots.qvel()[0] = std::numeric_limits<float>::infinity();
    robots.step(5);
    EXPECT_EQ(robots.time()[0], 0);
    double five = 0;
    for (int k = 0; k < 5; ++k) five += walker(false).timestep;
    EXPECT_EQ(robots.time()[1], five);
    robots.forward();
    EXPECT_EQ(robots.time()[1], five);
  }
}

/// Steps read numbers that were written through a view, and through spans after it, on either device.
TEST(ResidentRobots, AViewIsTheMemoryThatStepsUse) {
  const auto run = [](Device device) {
    auto robots = robots_on<double>(device, walker(true), kEnvs, observing({VariedArray::body_mass}));
    robots.qvel()[3] = 0.5;
    const ArticulatedView<double> view = robots.view();
    EXPECT_EQ(view.qvel[3], 0.5);
    for (int k = 0; k < 4; ++k) {
      view.ctrl[5] = 0.125 * k;
      view.qvel[9] += 0.25;
      view.varied[static_cast<std::size_t>(VariedArray::body_mass)][2] *= 1.0625;
      EXPECT_EQ(robots.qvel()[9], view.qvel[9]);
      robots.step();
      robots.synchronize();
      EXPECT_EQ(view.status[7].code, EnvCode::solved);
      EXPECT_EQ(robots.observed(ObservedArray::cvel)[8],
                view.observed[static_cast<std::size_t>(ObservedArray::cvel)][8]);
      const std::vector<double> controls(robots.ctrl().size(), 0.125 * k - 0.2);
      robots.copy_ctrl(controls.data());  // this device's memory is the host's
      robots.step();
      robots.synchronize();
      EXPECT_EQ(view.ctrl[5], controls[5]);
      EXPECT_EQ(robots.ctrl()[4], controls[4]);
      robots.qfrc_applied()[static_cast<std::size_t>(k)] = 1.5;
      EXPECT_EQ(robots.view().qfrc_applied[k], 1.5);
      EXPECT_EQ(view.time[0], robots.time()[0]);
    }
    return robots;
  };
  auto here = run(Device::cpu()), there = run(Device::emulated());
  expect_same(here, there);
  EXPECT_EQ(here.view().varied[static_cast<std::size_t>(VariedArray::dof_damping)], nullptr);
}

TEST(ResidentRobots, ASpanThatIsNoLongerValidIsRefusedWhereItWasWritten) {
  auto robots = robots_on<float>(Device::emulated(), walker(false), 4, observing());
  const std::span<float> qpos = robots.qpos(), ctrl = robots.ctrl();
  qpos[2] += 0.01F;
  robots.step();
  ctrl[3] = 0.5F;  // no step writes controls: their span stays
  robots.step();
  EXPECT_EQ(robots.view().ctrl[3], 0.5F);
  qpos[2] += 1;
  const std::string refusal = error_message([&] { robots.step(); });
  EXPECT_EQ(refusal,
            "qpos was changed through a span that is no longer valid: ask for qpos again after each call that "
            "writes it");
  EXPECT_LT(robots.qpos()[2], 1.5F);  // it was asked for again
  robots.step();
  robots.reset(std::vector<std::uint8_t>{0, 1, 0, 0});
  ctrl[0] = 0.75F;
  EXPECT_NE(error_message([&] { robots.step(); }).find("ctrl was changed"), std::string::npos);
}

/// A mask of every other environment has as many runs as environments.
TEST(ResidentRobots, AResetIsOneLaunchWhateverTheMask) {
  constexpr Offset kMany = 40;
  const auto device = cuda::shared_emulated_device();
  auto robots = robots_on<float>(Device::emulated(), walker(true), kMany, observing());
  robots.step();
  std::vector<std::uint8_t> mask(static_cast<std::size_t>(kMany));
  for (std::size_t env = 0; env < mask.size(); ++env) mask[env] = env % 2;
  const int launches = device->calls(DeviceCall::launch);
  EXPECT_EQ(copies_of([&] { robots.reset(mask); }), 2);  // the mask, the first coordinates
  EXPECT_EQ(device->calls(DeviceCall::launch), launches + 1);
  EXPECT_EQ(robots.time()[1], 0);
  EXPECT_GT(robots.time()[2], 0);
}

/// Streams that do their work in any order but that of events.
TEST(ResidentRobots, StepsOfSeveralStreamsFollowOneAnother) {
  constexpr Offset kFew = 5;
  auto expected = robots_on<double>(Device::cpu(), walker(true), kFew, observing());
  expected.step(6);
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const auto device = std::make_shared<EmulatedDevice>(EmulatedDeviceOptions{2, 3, seed});
    const cuda::Stream first(*device), second(*device);
    HostRobots<double> own(walker(true), kFew, observing());
    const auto machine = cuda::make_device_articulated_machine(device, own.job, kFew, Offset{1} << 28);
    for (const cuda::Stream* stream : {&first, &second, &second, &first, &second, &first})
      machine->step(own.job, kFew, 1, StreamRef(stream->get()));
    machine->fetch(own.job.qpos);
    machine->fetch(own.job.status);
    EXPECT_TRUE(same_bits<double>(expected.qpos(), own.batch.qpos())) << "seed " << seed;
    EXPECT_TRUE(same_bits(expected.status(), std::span<const EnvStatus>(own.status))) << "seed " << seed;
  }
}

TEST(ResidentRobots, AGraphOfAStepMakesItAgain) {
  constexpr Offset kFew = 5;
  auto expected = robots_on<float>(Device::cpu(), walker(true), kFew, observing());
  expected.step(7);
  const auto device = std::make_shared<EmulatedDevice>();
  const cuda::Stream stream(*device);
  HostRobots<float> own(walker(true), kFew, observing());
  const auto machine = cuda::make_device_articulated_machine(device, own.job, kFew, Offset{1} << 28);
  machine->step(own.job, kFew, 1, StreamRef(stream.get()));
  device->begin_capture(stream.get());
  machine->step(own.job, kFew, 2, StreamRef(stream.get()));
  const auto graph = device->end_capture(stream.get());
  for (int k = 0; k < 3; ++k) {
    device->launch(graph, stream.get());
    machine->fetch(own.job.qpos);  // as it is after this launch
  }
  EXPECT_TRUE(same_bits<float>(expected.qpos(), own.batch.qpos()));

  machine->fetch(own.job.qvel);
  own.job.qvel[2] += 1;
  device->begin_capture(stream.get());
  EXPECT_NE(error_message([&] {
              machine->step(own.job, kFew, 1, StreamRef(stream.get()));
            }).find("stream is being captured: give no mask, and call view() before"),
            std::string::npos);
  static_cast<void>(device->end_capture(stream.get()));
}

}  // namespace
}  // namespace stiction::test
