// Environments whose pairs of shapes a tree finds. Steps have the bits of a world that tests all pairs. They do not
// depend on threads, instruction sets or the device.
#include <gtest/gtest.h>

#include <optional>

#include "core/machine/world_machine.hpp"
#include "core/runtime/world/world_model.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/machines/scoped_isa.hpp"
#include "tests/support/systems/random_worlds.hpp"

namespace stiction::test {

namespace {

/// Bodies of scene pile, beyond the limit of tests in pairs.
constexpr int kBodies = 150;

template <class Real>
std::uint64_t hash_after(Offset envs, int steps, int threads, Device device = Device::cpu()) {
  WorldOptions options;
  options.solver.threads = threads;
  World<Real> world = started<Real>("pile", envs, options, device, 0, kBodies);
  run(world, steps);
  EXPECT_GT(world.contact_offsets().back(), 40);
  return world.hash();
}

/// Contacts and positions of a step, by one of the two ways.
template <class Real>
struct Stepped {
  Stepped(const WorldDescription& world, const WorldOptions& options, std::size_t most_listed)
      : model(world, options, most_listed),
        machine(make_cpu_world_machine<Real>(model.view(), 1, options)),
        solver(Device::cpu(), options.stepping, options.solver) {}

  void put(const Poses<Real>& poses) {
    WorldArrays<Real>& now = machine->observe(WorldPart::state);
    now.position = poses.position;
    now.orientation = poses.orientation;
    now.twist = poses.twist;
    machine->restart(std::vector<std::uint8_t>{1});
  }
  void step() {
    const WorldSolve<Real> solve = machine->find_contacts();
    solver.solve(solver.plan(solve.structure), solve.batch, solve.solution, solve.guess);
    machine->integrate();
  }

  WorldModel<Real> model;
  std::unique_ptr<WorldMachine<Real>> machine;
  BodySolver solver;
};

template <class Real>
void expect_the_steps_of_all_pairs(const RandomWorld& what, std::uint64_t seed, int steps) {
  std::mt19937_64 random(seed);
  const WorldDescription world = random_world(what, random);
  const Poses<Real> poses = random_poses<Real>(world, what, random);
  WorldOptions options;
  options.solver.invalid = InvalidPolicy::isolate;
  Stepped<Real> listed(world, options, world.shapes.size()), by_tree(world, options, 0);
  listed.put(poses);
  by_tree.put(poses);
  Offset contacts = 0;
  for (int step = 0; step < steps; ++step) {
    listed.step();
    by_tree.step();
    WorldArrays<Real>& one = listed.machine->observe(WorldPart::contacts);
    WorldArrays<Real>& other = by_tree.machine->observe(WorldPart::contacts);
    EXPECT_EQ(one.contacts.id, other.contacts.id) << "step " << step;
    EXPECT_TRUE(same_bits<Real>(one.contacts.impulse, other.contacts.impulse)) << "step " << step;
    EXPECT_TRUE(same_bits<Real>(one.position, other.position)) << "step " << step;
    EXPECT_TRUE(same_bits<Real>(one.twist, other.twist)) << "step " << step;
    contacts += one.contacts.offsets.back();
  }
  EXPECT_GT(contacts, 20 * steps);
}

/// Spheres that are pressed together a little, in a cube of so many by so many by so many on the floor.
WorldDescription heap_of_spheres(int side) {
  std::mt19937_64 random(1);
  WorldDescription world;
  add_floor(world);
  for (int k = 0; k < side * side * side; ++k) {
    const auto off = [&] { return static_cast<double>(random() >> 40) * 0x1p-24 * 0.01; };
    const int row = k / side % side, layer = k / side / side;
    add_body(world, ShapeKind::sphere, {0.1, 0, 0}).position = {0.195 * (k % side) + off(), 0.195 * row + off(),
                                                                0.1 + 0.195 * layer + off()};
  }
  return world;
}

}  // namespace

TEST(LargeWorlds, StepsAreThoseOfAllPairs) {
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    expect_the_steps_of_all_pairs<double>({70, 0.6, 4, false}, seed, 12);
    expect_the_steps_of_all_pairs<float>({70, 0.6, 4, false}, seed, 12);
  }
}

TEST(LargeWorlds, BitsDoNotDependOnThreads) {
  const std::uint64_t one = hash_after<double>(20, 60, 1);
  for (const int threads : {2, 5}) EXPECT_EQ(hash_after<double>(20, 60, threads), one);
}

TEST(LargeWorlds, BitsDoNotDependOnTheInstructionSet) {
  std::optional<std::uint64_t> expected;
  for (const char* name : usable_isas()) {
    SCOPED_TRACE(name);
    const ScopedIsa isa(name);
    const std::uint64_t hash = hash_after<float>(2, 60, 1);
    EXPECT_EQ(hash, expected.value_or(hash));
    expected = hash;
  }
}

TEST(LargeWorlds, BitsDoNotDependOnTheDevice) {
  EXPECT_EQ(hash_after<double>(3, 50, 1, Device::emulated()), hash_after<double>(3, 50, 1));
  EXPECT_EQ(hash_after<float>(1, 50, 1, Device::emulated()), hash_after<float>(1, 50, 1));
}

/// Testing all pairs, with room for 12 million of them, gives this hash, too.
TEST(LargeWorlds, ThousandsOfSpheresHaveTheBitsTheyHad) {
  const WorldDescription description = heap_of_spheres(17);
  for (const int threads : {1, 2}) {
    WorldOptions options;
    options.solver.threads = threads;
    options.solver.iterations = 10;
    World<float> world(Device::cpu(), description, 1, options);
    run(world, 3);
    EXPECT_GT(world.contact_offsets().back(), 14000);
    EXPECT_EQ(world.hash(), 0x18b3936bdee8e818ULL) << threads << " threads";
  }
}

}  // namespace stiction::test
