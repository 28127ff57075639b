// Checkpoints of worlds, and steps whose contacts something else than the world's own solver answers.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <map>
#include <stdexcept>

#include "tests/support/bits.hpp"
#include "tests/support/error_message.hpp"
#include "tests/support/systems/worlds.hpp"

namespace stiction::test {

namespace {

using testing::HasSubstr;

constexpr Offset kEnvs = 3;
constexpr int kSteps = 15;  ///< after a checkpoint

WorldOptions with_momentum() {
  WorldOptions options;
  options.solver.momentum = true;
  options.solver.tolerance = 1e-6;
  return options;
}

/// A world of a scene that nothing has put anywhere yet.
template <class Real>
World<Real> unstarted(const std::string& name, Device device = Device::cpu()) {
  const scenes::WorldScene scene = scenes::make_world(name);
  WorldOptions options = with_momentum();
  options.stepping = scene.stepping;
  return World<Real>(device, scene.description, kEnvs, options);
}

template <class Real>
std::vector<Index> iterations_of(const World<Real>& world) {
  std::vector<Index> iterations;
  for (const EnvStatus& status : world.status()) iterations.push_back(status.iterations);
  return iterations;
}

/// Checkpoint of a scene that has come to rest, computed once for each scene and precision.
template <class Real>
const WorldCheckpoint<Real>& fallen(const std::string& scene) {
  static std::map<std::string, WorldCheckpoint<Real>> known;
  const auto found = known.find(scene);
  if (found != known.end()) return found->second;
  World<Real> world = started<Real>(scene, kEnvs, with_momentum());
  run(world, 90);
  return known.emplace(scene, world.checkpoint()).first->second;
}

template <class Real>
void expect_resumes(const std::string& scene, Device before, Device after) {
  World<Real> world = unstarted<Real>(scene, before);
  world.resume(fallen<Real>(scene));
  world.wrench()[4] = Real(0.25);
  run(world, 5);
  const WorldCheckpoint<Real> kept = world.checkpoint();
  run(world, kSteps);

  World<Real> other = unstarted<Real>(scene, after);
  other.resume(kept);
  run(other, kSteps);
  EXPECT_EQ(other.hash(), world.hash()) << scene;
  EXPECT_EQ(iterations_of(other), iterations_of(world)) << scene;

  // The impulses are a part of it: without them the next steps are others.
  WorldCheckpoint<Real> forgetful = kept;
  ASSERT_FALSE(forgetful.impulse.empty()) << scene;
  forgetful.impulse.assign(forgetful.impulse.size(), Real(0));
  other.resume(forgetful);
  run(other, kSteps);
  EXPECT_NE(other.hash(), world.hash()) << scene;
}

template <class Change>
std::string refusal(Change&& change) {
  World<double> world = unstarted<double>("pile");
  world.resume(fallen<double>("pile"));
  WorldCheckpoint<double> from = world.checkpoint();
  change(from);
  const std::uint64_t before = world.hash();
  std::string message = error_message([&] { world.resume(from); });
  EXPECT_EQ(world.hash(), before);
  return message;
}

}  // namespace

TEST(WorldCheckpoint, ItsNextStepsHaveTheBitsOfTheWorldItWasTakenFrom) {
  for (const char* scene : {"pile", "walker"}) {
    expect_resumes<double>(scene, Device::cpu(), Device::cpu());
    expect_resumes<float>(scene, Device::cpu(), Device::cpu());
  }
}

TEST(WorldCheckpoint, GoesOnOnAnotherDevice) {
  expect_resumes<double>("pile", Device::cpu(), Device::emulated());
  expect_resumes<float>("pile", Device::emulated(), Device::cpu());
  expect_resumes<double>("pile", Device::emulated(), Device::emulated());
}

TEST(WorldCheckpoint, OfANewWorldHasNoContactsAndBeginsAsIt) {
  World<double> world = started<double>("pile", kEnvs);
  const WorldCheckpoint<double> kept = world.checkpoint();
  EXPECT_THAT(kept.contact_offsets, testing::Each(0));
  World<double> other = unstarted<double>("pile");
  run(other, 50);
  other.resume(kept);
  EXPECT_EQ(other.hash(), world.hash());
  EXPECT_EQ(other.contact_offsets().back(), 0);
  for (const EnvStatus& status : other.status()) EXPECT_EQ(status.iterations, 0);
}

TEST(WorldCheckpoint, HoldsABrokenEnvironmentAndHarmsNoOther) {
  WorldCheckpoint<double> kept = fallen<double>("pile");
  World<double> sound = unstarted<double>("pile");
  sound.resume(kept);
  kept.twist[1] = std::numeric_limits<double>::quiet_NaN();
  World<double> broken = unstarted<double>("pile");
  broken.resume(kept);
  run(sound, 20);
  run(broken, 20);
  EXPECT_EQ(broken.status()[0].code, EnvCode::invalid_input);
  const std::size_t first = 3 * static_cast<std::size_t>(sound.body_count());
  EXPECT_TRUE(same_bits<double>(broken.state().position.subspan(first), sound.state().position.subspan(first)));
}

TEST(WorldCheckpoint, MistakesAreNamedAndChangeNothing) {
  EXPECT_THAT(refusal([](auto& from) { from.position.pop_back(); }), HasSubstr("from.position has"));
  EXPECT_THAT(refusal([](auto& from) { from.orientation.clear(); }), HasSubstr("from.orientation has 0"));
  EXPECT_THAT(refusal([](auto& from) { from.twist.push_back(0); }), HasSubstr("from.twist has"));
  EXPECT_THAT(refusal([](auto& from) { from.wrench.clear(); }), HasSubstr("from.wrench has 0"));
  EXPECT_THAT(refusal([](auto& from) { from.impulse.pop_back(); }), HasSubstr("from.impulse has"));
  EXPECT_THAT(refusal([](auto& from) { from.contact_id.pop_back(); }), HasSubstr("from.contact_id has"));
  EXPECT_THAT(refusal([](auto& from) { from.contact_offsets.pop_back(); }), HasSubstr("from.contact_offsets has"));
  EXPECT_THAT(refusal([](auto& from) { from.contact_offsets[0] = 1; }), HasSubstr("from.contact_offsets[0] = 1"));
  EXPECT_THAT(refusal([](auto& from) { from.contact_offsets[1] = Offset{1} << 60; }),
              HasSubstr("from.contact_offsets[2]"));
  EXPECT_THAT(refusal([](auto& from) { std::swap(from.contact_id[0], from.contact_id[1]); }),
              HasSubstr("from.contact_id[1]"));
}

TEST(WorldStepSolver, TheSameSolverFromOutsideHasTheSameBits) {
  World<double> inside = started<double>("pile", kEnvs, with_momentum());
  World<double> outside = started<double>("pile", kEnvs, with_momentum());
  const BodySolver solver(Device::cpu(), outside.options().stepping, outside.options().solver);
  for (int step = 0; step < 80; ++step) {
    inside.step();
    outside.step([&](const BodyBatchView<double>& batch, const BodySolutionView<double>& solution,
                     const double* guess) { solver.solve(solver.plan(batch), batch, solution, guess); });
  }
  EXPECT_GT(inside.contact_offsets().back(), 0);
  EXPECT_EQ(outside.hash(), inside.hash());
}

TEST(WorldStepSolver, AnEmptyOneIsRefusedBeforeAnythingChanges) {
  World<double> world = started<double>("pile", kEnvs, with_momentum());
  World<double> other = started<double>("pile", kEnvs, with_momentum());
  run(world, 60);
  run(other, 60);
  EXPECT_THAT(error_message([&] { world.step(StepSolver<double>()); }), HasSubstr("solve is empty"));
  run(world, 5);
  run(other, 5);
  EXPECT_EQ(world.hash(), other.hash());
}

TEST(WorldStepSolver, WhatItThrowsIsPassedOnAndTheBodiesStayWhereTheyWere) {
  World<double> world = started<double>("pile", kEnvs, with_momentum());
  run(world, 60);
  WorldCheckpoint<double> forgetful = world.checkpoint();
  forgetful.impulse.assign(forgetful.impulse.size(), 0);
  World<double> other = unstarted<double>("pile");
  other.resume(forgetful);
  const std::uint64_t before = world.hash();
  EXPECT_THROW(world.step([](const auto&, const auto&, const double*) { throw std::runtime_error("no answer"); }),
               std::runtime_error);
  EXPECT_EQ(world.hash(), before);
  run(world, 20);
  run(other, 20);
  EXPECT_EQ(world.hash(), other.hash());
}

}  // namespace stiction::test
