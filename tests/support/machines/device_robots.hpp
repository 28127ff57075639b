#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <numeric>
#include <vector>

#include "core/machine/articulated_machine.hpp"
#include "core/runtime/articulated/articulated_model.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/walker_states.hpp"

/// Robots on a device and on the CPU, which must have the same bits.
namespace stiction::test {

/// A batch of walkers, of which each has constants of its own if the options name any.
template <class Real>
ArticulatedBatch<Real> robots_on(Device device, const ArticulatedDescription& model, Offset envs,
                                 const ArticulatedOptions& options) {
  ArticulatedBatch<Real> robots(device, model, envs, options);
  std::vector<Offset> all(static_cast<std::size_t>(envs));
  std::iota(all.begin(), all.end(), Offset{0});
  if (robots.actuator_count() == 2) put_states(robots, all);
  for (std::size_t k = 0; k < robots.qvel().size(); ++k) robots.qvel()[k] = static_cast<Real>(number(k));
  for (std::size_t k = 0; k < robots.qfrc_applied().size(); ++k)
    robots.qfrc_applied()[k] = static_cast<Real>(number(k + 77));
  for (const VariedArray array : options.varies) {
    const std::span<Real> numbers = robots.varied(array);
    for (std::size_t k = 0; k < numbers.size(); ++k) numbers[k] *= static_cast<Real>(1 + 0.25 * number(k));
  }
  return robots;
}

/// Everything that a call may have written.
template <class Real>
void expect_same(ArticulatedBatch<Real>& expected, ArticulatedBatch<Real>& found) {
  EXPECT_TRUE(same_bits<Real>(expected.qpos(), found.qpos()));
  EXPECT_TRUE(same_bits<Real>(expected.qvel(), found.qvel()));
  EXPECT_TRUE(same_bits<Real>(expected.qacc(), found.qacc()));
  EXPECT_TRUE(same_bits<double>(expected.time(), found.time()));
  EXPECT_TRUE(same_bits(expected.status(), found.status()));
  for (std::size_t k = 0; k < kObservedArrays; ++k) {
    const auto array = static_cast<ObservedArray>(k);
    EXPECT_TRUE(same_bits<Real>(expected.observed(array), found.observed(array))) << "observed " << k;
  }
}

inline ArticulatedOptions observing(std::vector<VariedArray> varies = {}) {
  return {1e-5, 100, 1, true, std::move(varies)};
}
/// All constants, but those that a free body beside the walker may not have.
inline std::vector<VariedArray> varied_of(const ArticulatedDescription& model) {
  std::vector<VariedArray> all{VariedArray::body_mass, VariedArray::body_inertia, VariedArray::pair_friction,
                               VariedArray::actuator_gain, VariedArray::actuator_bias};
  if (!model.is_implicit_fast)
    for (const VariedArray one : {VariedArray::dof_damping, VariedArray::dof_armature, VariedArray::dof_friction_loss})
      all.push_back(one);
  return all;
}

/// A job in host memory, as a batch makes it. The batch has the arrays, and does not step them.
template <class Real>
struct HostRobots {
  HostRobots(const ArticulatedDescription& description, Offset envs, const ArticulatedOptions& options)
      : model(description, 0), batch(robots_on<Real>(Device::cpu(), description, envs, options)) {
    for (std::size_t k = 0; k < kObservedArrays; ++k)
      observed[k] = batch.observed(static_cast<ObservedArray>(k)).data();
    for (std::size_t k = 0; k < kVariedArrays; ++k) varied[k] = batch.varied(static_cast<VariedArray>(k)).data();
    status.resize(static_cast<std::size_t>(envs));
    time.resize(static_cast<std::size_t>(envs));
    job.model = model.view();
    job.qpos = batch.qpos().data();
    job.qvel = batch.qvel().data();
    job.qacc = batch.qacc().data();
    job.ctrl = batch.ctrl().data();
    job.qfrc_applied = batch.qfrc_applied().data();
    job.time = time.data();
    job.status = status.data();
    job.tolerance = 1e-5;
    job.max_iterations = 100;
    job.observed = observed.data();
    if (!options.varies.empty()) job.varied = varied.data();
  }

  ArticulatedModel<Real> model;
  ArticulatedBatch<Real> batch;
  std::array<Real*, kObservedArrays> observed;
  std::array<const Real*, kVariedArrays> varied;
  std::vector<EnvStatus> status;
  std::vector<double> time;
  ArticulatedJob<Real> job{};

  /// Makes steps on a machine, and has the arrays in host memory.
  void step(ArticulatedMachine<Real>& machine, Offset envs, Index count) {
    machine.step(job, envs, count, StreamRef::default_stream());
    for (const void* array :
         {static_cast<const void*>(job.qpos), static_cast<const void*>(job.qacc), static_cast<const void*>(job.status),
          static_cast<const void*>(observed[static_cast<std::size_t>(ObservedArray::cfrc_ext)])})
      machine.fetch(array);
  }
};

}  // namespace stiction::test
