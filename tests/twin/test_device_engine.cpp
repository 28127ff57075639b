#include <gtest/gtest.h>

#include "cuda/emulated/emulated_device.hpp"
#include "cuda/machine/contact_machine.hpp"
#include "cuda/machine/engine.hpp"
#include "stiction/error.hpp"
#include "tests/support/machines/device_batch.hpp"
#include "tests/support/machines/every_solver.hpp"
#include "tests/support/machines/on_engine.hpp"
#include "tests/support/sanitizers.hpp"

/// The GPU's host code and kernels on the emulated device: queued work, in any order the streams allow, gives the
/// CPU's bits.
namespace stiction::test {
namespace {

SolverOptions quick(SolverKind solver) {
  SolverOptions options;
  options.solver = solver;
  options.max_iterations = 24;
  options.invalid = InvalidPolicy::isolate;
  options.threads = 1;
  return options;
}

/// Every solver and the fallback chain in one precision; costly ones on all but the largest.
template <class Real>
void expect_the_cpus_bits_of_every_solver() {
  cuda::EmulatedDevice device({2, 3, 11});
  for (const SolverKind solver : kEveryChoice) {
    const ContactBatch<Real> batch = batch_for<Real>(solver, ragged_batch(2, 7), 100);
    for (const Law law : kBothLaws) {
      SCOPED_TRACE(label(solver, law));
      SolverOptions options = quick(solver);
      options.law = law;
      options.max_iterations = few_iterations(solver, kSanitizer ? 3 : 24);
      EXPECT_EQ(on_engine(device, batch, options), solve_hashes(batch, options));
    }
  }
}

TEST(DeviceEngine, EverySolverAndLawGivesTheCpusBitsInSinglePrecision) {
  expect_the_cpus_bits_of_every_solver<float>();
}

TEST(DeviceEngine, EverySolverAndLawGivesTheCpusBitsInDoublePrecision) {
  if (kThreadSanitizer) GTEST_SKIP() << "the thread sanitizer sees the same accesses in single precision";
  expect_the_cpus_bits_of_every_solver<double>();
}

TEST(DeviceEngine, LanesTeamsAndTheOrderOfExecutionChangeNothing) {
  const ContactBatch<float> batch = convert<float>(ragged_batch(3, 3));
  const SolverOptions options = quick(SolverKind::npgs);
  const auto expected = solve_hashes(batch, options);
  for (const int lanes : {1, 2, 3, 7})
    for (const std::uint64_t seed : {0, 1}) {
      cuda::EmulatedDevice device({lanes, 1 + lanes, seed});
      EXPECT_EQ(on_engine(device, batch, options), expected) << lanes << " lanes, seed " << seed;
    }
}

TEST(DeviceEngine, TheClassOfAnEnvironmentChangesNothing) {
  const ContactBatch<float> batch = convert<float>(ragged_batch(2, 6));
  const SolverOptions options = quick(SolverKind::npgs);
  const auto expected = solve_hashes(batch, options);
  for (const SizeClass finest : {SizeClass::dense_large, SizeClass::dense_block, SizeClass::dense_warp,
                                 SizeClass::dense_tile, SizeClass::thread_medium}) {
    cuda::EmulatedDevice device({2, 3, 4});
    EXPECT_EQ(on_engine(device, batch, options, cuda::ClassRules::from(finest)), expected) << static_cast<int>(finest);
  }
}

TEST(DeviceEngine, LargeEnvironmentsHaveALaneEachWhereThereAreManyOfThem) {
  const ContactBatch<float> ragged = convert<float>(scene_batch("mixed", 40, 3)),
                            easy = convert<float>(scene_batch("grasp", 6, 3));
  for (const SolverKind solver : {SolverKind::npgs, SolverKind::automatic}) {
    // Batch that the chain solves at once: its later stages are slow here, and are tested elsewhere.
    const ContactBatch<float>& batch = solver == SolverKind::automatic ? easy : ragged;
    SolverOptions options = quick(solver);
    if (solver == SolverKind::automatic) options.tolerance = 1e-2;
    const auto expected = solve_hashes(batch, options);
    for (const Index most_rows : {24, 72}) {
      cuda::EmulatedDevice device({3, 2, 5});
      cuda::ClassRules rules;
      rules.many_per_processor = 1;
      rules.most_rows_of_many = most_rows;
      EXPECT_EQ(on_engine(device, batch, options, rules), expected)
          << to_string(solver) << ", " << most_rows << " rows";
    }
  }
}

TEST(DeviceEngine, RoomThatGraphsUseIsNotTakenFromThem) {
  const ContactBatch<float> small = convert<float>(ragged_batch(1, 1)), large = convert<float>(ragged_batch(4, 1));
  const SolverOptions options = quick(SolverKind::npgs);
  cuda::EmulatedDevice device;
  cuda::Engine engine(device);
  engine.reserve(Capacity::of(small.view()), options.solver, Precision::f32);
  const cuda::Stream stream(device);
  DeviceBatch<float> there(device, Capacity::of(small.view()));
  there.fill(small, stream.get());
  device.begin_capture(stream.get());
  engine.solve(SolveRequest<float>{nullptr, there.view(), there.solution(), nullptr, Law::coulomb, options,
                                   StreamRef(stream.get())});
  const auto graph = device.end_capture(stream.get());
  EXPECT_THROW(engine.reserve(Capacity::of(large.view()), options.solver, Precision::f32), Error);
  device.launch(graph, stream.get());
  EXPECT_EQ(env_hashes(small, there.fetch(small, stream.get())), solve_hashes(small, options));
}

TEST(DeviceEngine, APlanIsMadeAgainOnceGraphsMayHaveWrittenOverIt) {
  const ContactBatch<float> one = convert<float>(scene_batch("mixed", 20, 1)),
                            two = convert<float>(scene_batch("mixed", 20, 2));
  const SolverOptions options = quick(SolverKind::npgs);
  const Capacity reserved = larger(Capacity::of(one.view()), Capacity::of(two.view()));
  const auto device = std::make_shared<cuda::EmulatedDevice>();
  cuda::DeviceContactMachine machine(device);
  machine.reserve(reserved, options.solver);
  const cuda::Stream stream(*device);
  DeviceBatch<float> there_one(*device, reserved), there_two(*device, reserved);
  there_one.fill(one, stream.get());
  there_two.fill(two, stream.get());
  const auto plan = std::make_shared<const PlanData>(make_plan(one.view()));
  ContactBatchView<float> exact = there_one.view();
  exact.row_count = one.row_count();
  exact.cone_count = one.view().cone_count;
  exact.nonzero_count = one.view().nonzero_count;
  const auto solve_planned = [&] {
    machine.solve(SolveRequest<float>{plan.get(), exact, there_one.solution(), nullptr, one.law(), options,
                                      StreamRef(stream.get())});
  };
  device->begin_capture(stream.get());
  machine.solve(SolveRequest<float>{nullptr, there_two.view(), there_two.solution(), nullptr, two.law(), options,
                                    StreamRef(stream.get())});
  const auto graph = device->end_capture(stream.get());
  solve_planned();
  device->launch(graph, stream.get());
  solve_planned();
  EXPECT_EQ(env_hashes(one, there_one.fetch(one, stream.get())), solve_hashes(one, options));
  EXPECT_EQ(env_hashes(two, there_two.fetch(two, stream.get())), solve_hashes(two, options));
}

TEST(DeviceEngine, AGraphIsReplayedWithOtherNumbersContactsAndCounts) {
  constexpr Offset kEnvs = 16;
  constexpr int kReplays = 18;
  std::vector<ContactBatch<float>> batches;
  Capacity reserved;
  for (int replay = 0; replay < kReplays; ++replay) {
    const char* scene = replay % 3 == 0 ? "mixed" : replay % 3 == 1 ? "walker" : "stack";
    batches.push_back(convert<float>(scene_batch(scene, kEnvs, 100 + static_cast<std::uint64_t>(replay))));
    batches.back().set_law(Law::coulomb);
    reserved = larger(reserved, Capacity::of(batches.back().view()));
  }
  const SolverOptions options = quick(SolverKind::npgs);
  cuda::EmulatedDevice device({2, 3, 17});
  cuda::Engine engine(device);
  engine.reserve(reserved, options.solver, Precision::f32);
  const cuda::Stream stream(device);
  DeviceBatch<float> there(device, reserved);

  const int allocations = device.calls(cuda::DeviceCall::allocate);
  device.begin_capture(stream.get());
  engine.solve(SolveRequest<float>{nullptr, there.view(), there.solution(), nullptr, Law::coulomb, options,
                                   StreamRef(stream.get())});
  const auto graph = device.end_capture(stream.get());
  for (int replay = 0; replay < kReplays; ++replay) {
    const ContactBatch<float>& batch = batches[static_cast<std::size_t>(replay)];
    there.fill(batch, stream.get());
    device.launch(graph, stream.get());
    EXPECT_EQ(env_hashes(batch, there.fetch(batch, stream.get())), solve_hashes(batch, options)) << replay;
  }
  EXPECT_EQ(device.calls(cuda::DeviceCall::allocate), allocations);
}

TEST(DeviceEngine, SolvesOnTwoStreamsDoNotMeet) {
  const ContactBatch<float> one = convert<float>(ragged_batch(2, 1)), two = convert<float>(ragged_batch(2, 2));
  const SolverOptions options = quick(SolverKind::npgs);
  const Capacity reserved = larger(Capacity::of(one.view()), Capacity::of(two.view()));
  for (std::uint64_t seed = 1; seed < 9; ++seed) {
    cuda::EmulatedDevice device({1, 3, seed});
    cuda::Engine engine(device);
    engine.reserve(reserved, options.solver, Precision::f32);
    const cuda::Stream first(device), second(device);
    DeviceBatch<float> there_one(device, reserved), there_two(device, reserved);
    there_one.fill(one, first.get());
    there_two.fill(two, second.get());
    for (const auto& [there, stream] : {std::pair{&there_one, first.get()}, std::pair{&there_two, second.get()}})
      engine.solve(SolveRequest<float>{nullptr, there->view(), there->solution(), nullptr, Law::coulomb, options,
                                       StreamRef(stream)});
    EXPECT_EQ(env_hashes(two, there_two.fetch(two, second.get())), solve_hashes(two, options)) << seed;
    EXPECT_EQ(env_hashes(one, there_one.fetch(one, first.get())), solve_hashes(one, options)) << seed;
  }
}

TEST(DeviceEngine, NothingToSolveIsNoTrouble) {
  const SolverOptions options = quick(SolverKind::npgs);
  EXPECT_TRUE(solve(ContactBatch<float>(Law::convex), options, Device::emulated()).status.empty());
  ContactBatch<float> empty(Law::convex);
  for (int k = 0; k < 70; ++k) empty.add(Environment<float>{});
  const Solution<float> answer = solve(empty, options, Device::emulated());
  for (const EnvStatus& status : answer.status) EXPECT_EQ(status.code, EnvCode::solved);
}

TEST(DeviceEngine, AGiantAmongManyChangesNobodysBits) {
  ContactBatch<double> batch(Law::coulomb);
  for (std::uint64_t e = 0; e < 40; ++e) {
    if (e == 21) batch.add(scenes::make("pile", 9, 0, 900).system);
    batch.add(scenes::make("stack", 9, e, 1).system);
  }
  const SolverOptions options = quick(SolverKind::npgs);
  cuda::EmulatedDevice device({2, 3, 2});
  const ContactBatch<float> single = convert<float>(batch);
  EXPECT_EQ(on_engine(device, single, options), solve_hashes(single, options));
}

TEST(DeviceEngine, AMethodWithMatricesHasRoomForTheSmallBesideTheGiant) {
  // The giant gets no matrices, and so needs less memory than those that do.
  ContactBatch<double> batch(Law::convex);
  for (std::uint64_t e = 0; e < 4; ++e) {
    if (e == 1) batch.add(scenes::make("stack", 9, e, 90).system);
    batch.add(scenes::make("stack", 9, e, 12).system);
  }
  SolverOptions options = quick(SolverKind::ipm);
  options.max_iterations = 2;
  cuda::EmulatedDevice device({2, 3, 2});
  const ContactBatch<float> single = convert<float>(batch);
  EXPECT_EQ(on_engine(device, single, options), solve_hashes(single, options));
  for (const EnvStatus& status : solve(single, options).status) EXPECT_EQ(status.iterations, 2);
}

TEST(DeviceEngine, AnEnvironmentBeyondTheCapacityIsFlaggedAndLeftOut) {
  const ContactBatch<float> batch = convert<float>(ragged_batch(3, 4));
  const SolverOptions options = quick(SolverKind::npgs);
  Capacity reserved = Capacity::of(batch.view());
  reserved.env_rows = 30;
  cuda::EmulatedDevice device({2, 3, 2});
  cuda::Engine engine(device);
  engine.reserve(reserved, options.solver, Precision::f32);
  const cuda::Stream stream(device);
  DeviceBatch<float> there(device, Capacity::of(batch.view()));
  there.fill(batch, stream.get());
  engine.solve(SolveRequest<float>{nullptr, there.view(), there.solution(), nullptr, Law::coulomb, options,
                                   StreamRef(stream.get())});
  const Solution<float> answer = there.fetch(batch, stream.get());
  const auto hashes = env_hashes(batch, answer);
  const auto expected = solve_hashes(batch, options);
  int left_out = 0;
  for (Offset e = 0; e < batch.env_count(); ++e) {
    const auto index = static_cast<std::size_t>(e);
    if (batch.view().env_rows(e) <= 30) {
      EXPECT_EQ(hashes[index], expected[index]);
      continue;
    }
    ++left_out;
    EXPECT_EQ(answer.status[index].code, EnvCode::unsupported);
    EXPECT_EQ(answer.status[index].flags, kFlagOverCapacity);
    for (Offset row = batch.view().env_row_offsets[e]; row < batch.view().env_row_offsets[e + 1]; ++row)
      EXPECT_EQ(answer.lambda[static_cast<std::size_t>(row)], 0.0F);
  }
  EXPECT_GT(left_out, 0);
}

TEST(DeviceEngine, ABrokenStructureIsFlaggedWhereItIs) {
  const ContactBatch<float> batch = convert<float>(ragged_batch(2, 4));
  const SolverOptions options = quick(SolverKind::npgs);
  const auto expected = solve_hashes(batch, options);
  const Capacity need = Capacity::of(batch.view());
  cuda::EmulatedDevice device({2, 3, 2});
  cuda::Engine engine(device);
  engine.reserve(need, options.solver, Precision::f32);
  const cuda::Stream stream(device);
  DeviceBatch<float> there(device, need);
  const auto& arrays = batch.arrays();
  for (const Offset victim : {Offset{0}, Offset{3}, batch.env_count() - 2}) {
    const Offset row = arrays.env_row_offsets[static_cast<std::size_t>(victim)];
    if (batch.view().env_rows(victim) == 0) continue;
    there.fill(batch, stream.get());
    const Index wrong = 1 << 29;
    const Offset entry = arrays.row_offsets[static_cast<std::size_t>(row)];
    device.copy(const_cast<Index*>(there.view().column) + entry, &wrong, sizeof(wrong), cuda::CopyKind::to_device,
                stream.get());
    engine.solve(SolveRequest<float>{nullptr, there.view(), there.solution(), nullptr, Law::coulomb, options,
                                     StreamRef(stream.get())});
    const Solution<float> answer = there.fetch(batch, stream.get());
    const auto hashes = env_hashes(batch, answer);
    for (Offset e = 0; e < batch.env_count(); ++e) {
      const auto index = static_cast<std::size_t>(e);
      if (e == victim) {
        EXPECT_EQ(answer.status[index].code, EnvCode::invalid_input);
        EXPECT_EQ(answer.status[index].flags, kFlagBadStructure);
      } else {
        EXPECT_EQ(hashes[index], expected[index]) << "environment " << e << ", victim " << victim;
      }
    }
  }
}

}  // namespace
}  // namespace stiction::test
