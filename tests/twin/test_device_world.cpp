#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "core/runtime/world/world_model.hpp"
#include "cuda/emulated/emulated_device.hpp"
#include "cuda/machine/world_machine.hpp"
#include "stiction/error.hpp"
#include "stiction/hash.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/worlds.hpp"

/// Worlds on the emulated device. The tests see the launches and copies of a step, in any order the device may choose,
/// and their failures. Whole steps of all scenes: tests/determinism/test_worlds.cpp.
namespace stiction::test {
namespace {

using cuda::DeviceCall;
using cuda::EmulatedDevice;
using cuda::EmulatedDeviceOptions;

/// A world of a scene on a separate device.
struct OwnDevice {
  OwnDevice(const std::string& name, Offset envs, const EmulatedDeviceOptions& device_options)
      : scene(scenes::make_world(name)),
        options{scene.stepping, until_solved(), 0.01, 0.95},
        model(scene.description, options),
        device(std::make_shared<EmulatedDevice>(device_options)),
        world(device, model.view(), envs, options) {}

  void put(const WorldState<double>& state, Offset envs) {
    WorldArrays<double>& now = world.observe(WorldPart::state);
    now.position.assign(state.position.begin(), state.position.end());
    now.orientation.assign(state.orientation.begin(), state.orientation.end());
    now.twist.assign(state.twist.begin(), state.twist.end());
    world.restart(std::vector<std::uint8_t>(static_cast<std::size_t>(envs), 1));
  }

  scenes::WorldScene scene;
  WorldOptions options;
  WorldModel<double> model;
  std::shared_ptr<EmulatedDevice> device;
  cuda::DeviceWorldMachine<double> world;
};

struct Calls {
  int launches = cuda::shared_emulated_device()->calls(DeviceCall::launch);
  int copies = cuda::shared_emulated_device()->calls(DeviceCall::copy);
  int allocations = cuda::shared_emulated_device()->calls(DeviceCall::allocate);
};

TEST(DeviceWorld, AStepIsFourLaunchesAndBringsHomeIntegersAlone) {
  const auto held = cuda::shared_emulated_device();  // counts for as long as it is held
  World<float> world = started<float>("walker", 6, {}, Device::emulated());
  run(world, 40);
  ASSERT_GT(world.contact_offsets().back(), 0);
  const Calls before;
  world.step();
  const Calls stepped;
  // Found, handed over, solved (one class of sizes), integrated.
  EXPECT_EQ(stepped.launches - before.launches, 4);
  EXPECT_EQ(stepped.allocations, before.allocations);
  // To the host: counts, and both bodies of each contact. To the device: offsets, eight arrays of the plan, the order
  // of environments, and the counters of the classes.
  EXPECT_EQ(stepped.copies - before.copies, 3 + 1 + 8 + 1 + 1);

  const WorldState<float> seen = world.state();
  const std::vector<float> position(seen.position.begin(), seen.position.end());
  const Calls looked;
  EXPECT_EQ(looked.copies - stepped.copies, 3);
  EXPECT_EQ(looked.launches, stepped.launches);
  EXPECT_TRUE(same_bits<float>(position, world.state().position));
  EXPECT_EQ(Calls().copies, looked.copies) << "what is here is not fetched again";
  EXPECT_EQ(world.motion().size(), 6U);
  EXPECT_EQ(Calls().launches - looked.launches, 1);
}

TEST(DeviceWorld, ContactsAreFoundAgainWithMoreRoomWhereThereWasTooLittle) {
  const auto held = cuda::shared_emulated_device();  // counts for as long as it is held
  World<double> world = started<double>("stack", 2, {}, Device::emulated());
  World<double> here = started<double>("stack", 2);
  constexpr int kSteps = 12;
  int searches = 0;
  Offset most = 0;
  for (int step = 0; step < kSteps; ++step) {
    const Calls before;
    world.step();
    searches += Calls().launches - before.launches - 3;
    here.step();
    EXPECT_TRUE(same_bits(here.contact_offsets(), world.contact_offsets())) << "step " << step;
    most = std::max(most, here.contact_offsets()[1]);
  }
  EXPECT_GT(most, 16) << "more than there is room for at first";
  EXPECT_GT(searches, kSteps);
}

/// More shapes than are tested all against all, and almost all of them touch.
TEST(DeviceWorld, ATreeFindsPairsAgainWithMoreRoomWhereThereWasTooLittle) {
  WorldDescription crowd;
  for (int k = 0; k < 130; ++k)
    add_body(crowd, ShapeKind::sphere, {0.1, 0, 0}).position = {0.002 * (k % 11), 0.003 * (k % 13), 0.004 * (k % 7)};
  WorldOptions options;
  options.solver.iterations = 2;
  const auto held = cuda::shared_emulated_device();  // counts for as long as it is held
  World<double> here(Device::cpu(), crowd, 1, options);
  World<double> there(Device::emulated(), crowd, 1, options);
  here.step();
  const Calls before;
  there.step();
  // Found with room for pairs of the first launch, for contacts of the second, and then.
  EXPECT_EQ(Calls().launches - before.launches, 3 + 3);
  EXPECT_GT(here.contact_offsets()[1], 8 * 130);
  EXPECT_TRUE(same_bits(here.contact_offsets(), there.contact_offsets()));
  EXPECT_TRUE(same_bits(here.impulses(), there.impulses()));
  EXPECT_EQ(here.hash(), there.hash());
}

TEST(DeviceWorld, LanesTeamsAndTheirOrderDoNotReachTheBits) {
  constexpr Offset kEnvs = 7;
  for (const EmulatedDeviceOptions& options :
       {EmulatedDeviceOptions{1, 1, 0}, EmulatedDeviceOptions{2, 3, 1}, EmulatedDeviceOptions{5, 2, 2}}) {
    World<double> here = started<double>("pile", kEnvs);
    run(here, 30);
    // Both begin without memories.
    here.reset(std::vector<std::uint8_t>(kEnvs, 1), here.state());
    OwnDevice own("pile", kEnvs, options);
    own.put(here.state(), kEnvs);
    const BodySolver solver(Device::emulated(), own.options.stepping, own.options.solver);
    for (int step = 0; step < 4; ++step) {
      here.step();
      const WorldSolve<double> solve = own.world.find_contacts();
      solver.solve(solver.plan(solve.structure), solve.batch, solve.solution, solve.guess);
      own.world.integrate();
    }
    EXPECT_TRUE(same_bits<double>(here.state().position, own.world.observe(WorldPart::state).position));
    EXPECT_TRUE(same_bits<double>(here.state().twist, own.world.observe(WorldPart::state).twist));
    EXPECT_TRUE(same_bits<double>(here.impulses(), own.world.observe(WorldPart::contacts).contacts.impulse));
  }
}

TEST(DeviceWorld, WrenchesResetsAndBrokenEnvironmentsAreAsOnTheCpu) {
  constexpr std::size_t kBroken = 1, kReset = 3;
  WorldOptions options;
  options.solver.max_contacts_per_env = 10;
  World<double> here = started<double>("stack", 5, options);
  World<double> there = started<double>("stack", 5, options, Device::emulated());
  const std::size_t width = 6 * static_cast<std::size_t>(here.body_count());
  for (World<double>* world : {&here, &there}) {
    const std::span<double> wrench = world->wrench();
    run(*world, 6);
    wrench[2] = 30;
    wrench[kBroken * width] = std::numeric_limits<double>::quiet_NaN();
    run(*world, 4);
    EXPECT_EQ(world->status()[kBroken].code, EnvCode::invalid_input);
    EXPECT_NE(world->status()[0].flags & kFlagContactsDropped, 0U);
    wrench[kBroken * width] = 0;
    std::vector<std::uint8_t> mask(5, 0);
    mask[kReset] = 1;
    world->reset(mask);
    run(*world, 2);
    mask[0] = 1;
    world->reset(mask, world->state());
    run(*world, 2);
  }
  EXPECT_EQ(here.hash(), there.hash());
  EXPECT_TRUE(same_bits(here.status(), there.status()));
  EXPECT_TRUE(same_bits(here.impulses(), there.impulses()));
}

TEST(DeviceWorld, AWorldOfNothingSteps) {
  World<float> none(Device::emulated(), scenes::make_world("slide").description, 0);
  none.step();
  EXPECT_TRUE(none.motion().empty());
  World<double> bare(Device::emulated(), WorldDescription{}, 2);
  bare.step();
  EXPECT_EQ(bare.status()[1].code, EnvCode::solved);
}

TEST(DeviceWorld, ADeviceThatFailsAtAnyCallIsAnErrorAndLeaksNothing) {
  const World<double> start = started<double>("stack", 2);
  for (const DeviceCall call : {DeviceCall::allocate, DeviceCall::copy, DeviceCall::launch, DeviceCall::synchronize}) {
    int failures = 0;
    for (bool failed = true; failed; ++failures) {
      failed = false;
      OwnDevice own("stack", 2, {});
      try {
        own.device->fail_call(call, failures);
        own.put(start.state(), 2);
        own.world.find_contacts();
        own.world.observe(WorldPart::contacts);
        own.device->fail_call(call, -1);
      } catch (const Error& error) {
        failed = true;
        EXPECT_TRUE(error.code() == ErrorCode::device_failure || error.code() == ErrorCode::out_of_memory);
      }
    }
    EXPECT_GT(failures, 1) << "call " << static_cast<int>(call);
  }
  // In its constructor, too.
  const scenes::WorldScene scene = scenes::make_world("stack");
  const WorldOptions options{scene.stepping, until_solved(), 0.01, 0.95};
  const WorldModel<double> model(scene.description, options);
  for (const DeviceCall call : {DeviceCall::create, DeviceCall::allocate, DeviceCall::copy, DeviceCall::synchronize}) {
    const auto device = std::make_shared<EmulatedDevice>();
    device->fail_call(call, 0);
    EXPECT_THROW(cuda::DeviceWorldMachine<double>(device, model.view(), 2, options), Error);
    EXPECT_EQ(device->live_allocations(), 0U);
    EXPECT_EQ(device->live_handles(), 0U);
  }
}

}  // namespace
}  // namespace stiction::test
