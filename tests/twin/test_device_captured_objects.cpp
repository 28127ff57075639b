#include <gtest/gtest.h>

#include <memory>

#include "cuda/emulated/emulated_device.hpp"
#include "cuda/machine/engine.hpp"
#include "python/src/captured_objects.hpp"
#include "stiction/error.hpp"
#include "tests/support/machines/device_batch.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/small_systems.hpp"

/// Objects that graphs have pointers to, where a larger solver takes the place of the one that was captured.
namespace stiction::test {
namespace {

SolverOptions few_sweeps() {
  return options(SolverKind::npgs, 1e-3, 30);
}

std::shared_ptr<cuda::Engine> engine_for(cuda::EmulatedDevice& device, const ContactBatch<float>& batch) {
  auto engine = std::make_shared<cuda::Engine>(device);
  engine->reserve(Capacity::of(batch.view()), SolverKind::npgs, Precision::f32);
  return engine;
}

TEST(CapturedObjects, LiveAsLongAsTheirGraphsMayBeLaunched) {
  const SolverOptions own = few_sweeps();
  const ContactBatch<float> small = convert<float>(ragged_batch(1, 1)), large = convert<float>(ragged_batch(4, 1));
  cuda::EmulatedDevice device;
  const cuda::Stream stream(device);
  DeviceBatch<float> there(device, Capacity::of(small.view()));
  there.fill(small, stream.get());
  python::CapturedObjects captured;
  const auto solve_small = [&](cuda::Engine& engine) {
    engine.solve(SolveRequest<float>{nullptr, there.view(), there.solution(), nullptr, small.law(), own,
                                     StreamRef(stream.get())});
  };
  std::shared_ptr<cuda::Engine> engine = engine_for(device, small);
  const std::weak_ptr<cuda::Engine> solved = engine;
  captured.call(engine, solve_small);
  device.synchronize(stream.get());
  engine = engine_for(device, small);
  EXPECT_TRUE(solved.expired()) << "no graph has it, and its memory is given back";

  const std::weak_ptr<cuda::Engine> first = engine;
  device.begin_capture(stream.get());
  captured.call(engine, solve_small);
  captured.call(engine, solve_small);
  const auto graph = device.end_capture(stream.get());
  engine = engine_for(device, large);
  EXPECT_FALSE(first.expired());
  there.fill(small, stream.get());
  device.launch(graph, stream.get());
  EXPECT_EQ(env_hashes(small, there.fetch(small, stream.get())), solve_hashes(small, own));
}

TEST(CapturedObjects, WhatFailsHalfWayIsKeptToo) {
  const SolverOptions own = few_sweeps();
  const ContactBatch<float> small = convert<float>(ragged_batch(1, 1));
  cuda::EmulatedDevice device;
  const cuda::Stream stream(device);
  DeviceBatch<float> there(device, Capacity::of(small.view()));
  there.fill(small, stream.get());
  python::CapturedObjects captured;
  std::shared_ptr<cuda::Engine> engine = engine_for(device, small);
  const std::weak_ptr<cuda::Engine> first = engine;
  device.begin_capture(stream.get());
  EXPECT_THROW(captured.call(engine,
                             [&](cuda::Engine& of) {
                               of.solve(SolveRequest<float>{nullptr, there.view(), there.solution(), nullptr,
                                                            small.law(), own, StreamRef(stream.get())});
                               throw Error(ErrorCode::device_failure, "what came after it");
                             }),
               Error);
  device.end_capture(stream.get());
  engine.reset();
  EXPECT_FALSE(first.expired());
}

}  // namespace
}  // namespace stiction::test
