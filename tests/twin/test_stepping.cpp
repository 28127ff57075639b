#include <gtest/gtest.h>

#include "scenes/rng.hpp"
#include "stiction/error.hpp"
#include "stiction/stepping.hpp"
#include "tests/support/systems/scene_batches.hpp"

/// One call per step, warm from the step before, with environments that start over: the same bits on every device.
namespace stiction::test {
namespace {

constexpr Offset kEnvs = 12;

/// A step of a simulation in which contacts come, go and change places. Environment e is a stack of 1 to 4 boxes; ids
/// are those of the contacts of a full stack.
struct Step {
  ContactBatch<double> batch{Law::coulomb};
  std::vector<std::uint64_t> ids;
};

Step make_step(int number) {
  Step step;
  for (Offset e = 0; e < kEnvs; ++e) {
    const int boxes = 1 + static_cast<int>((e + number / 3) % 4);
    Environment<double> env = scenes::make("stack", 4, static_cast<std::uint64_t>(e), boxes).system;
    scenes::Rng rng(static_cast<std::uint64_t>(100 * number + static_cast<int>(e)));
    for (double& b : env.b) b *= 1.0 + 0.02 * rng.symmetric(1.0);
    for (std::size_t c = 0; c < env.cones.size(); ++c) step.ids.push_back(7000 + c);
    step.batch.add(env);
  }
  return step;
}

SolverOptions tight() {
  SolverOptions options;
  options.tolerance = 1e-5;
  options.max_iterations = 80;
  options.threads = 1;
  return options;
}

Capacity room_for(int steps) {
  Capacity room;
  for (int k = 0; k < steps; ++k) {
    const Step step = make_step(k);
    const Capacity need = Capacity::of(step.batch.view());
    room.envs = std::max(room.envs, need.envs);
    room.rows = std::max(room.rows, need.rows);
    room.cones = std::max(room.cones, need.cones);
    room.nonzeros = std::max(room.nonzeros, need.nonzeros);
    room.env_rows = std::max(room.env_rows, need.env_rows);
    room.env_nonzeros = std::max(room.env_nonzeros, need.env_nonzeros);
  }
  return room;
}

Solution<double> take(SteppingSolver<double>& solver, const Step& step, bool on_device, double dt = 0.01) {
  const auto rows = static_cast<std::size_t>(step.batch.row_count());
  Solution<double> answer{std::vector<double>(rows), std::vector<double>(rows),
                          std::vector<EnvStatus>(static_cast<std::size_t>(kEnvs))};
  ContactBatchView<double> view = step.batch.view();
  if (on_device) view.space = MemorySpace::cuda;
  solver.solve(view, step.ids.data(), dt, {answer.lambda.data(), answer.w.data(), answer.status.data()});
  solver.solver().synchronize();
  return answer;
}

TEST(Stepping, EveryDeviceTakesTheSameSteps) {
  constexpr int kSteps = 6;
  SteppingSolver<double> cpu(Device::cpu(), tight(), room_for(kSteps));
  SteppingSolver<double> device(Device::emulated(), tight(), room_for(kSteps));
  for (int k = 0; k < kSteps; ++k) {
    const Step step = make_step(k);
    EXPECT_EQ(env_hashes(step.batch, take(device, step, true)), env_hashes(step.batch, take(cpu, step, false))) << k;
    if (k == 4) {
      const std::vector<Offset> over{2, 5, 11};
      cpu.reset(over);
      device.reset(over);
    }
  }
}

TEST(Stepping, AStepStartsWhereTheLastOneEnded) {
  SteppingSolver<double> solver(Device::cpu(), tight(), room_for(1));
  const Step step = make_step(0);
  const Solution<double> cold = take(solver, step, false);
  const Solution<double> warm = take(solver, step, false);
  int cold_sum = 0, warm_sum = 0;
  for (std::size_t e = 0; e < cold.status.size(); ++e) {
    cold_sum += cold.status[e].iterations;
    warm_sum += warm.status[e].iterations;
  }
  EXPECT_LT(warm_sum, cold_sum);
}

TEST(Stepping, WhatWasResetStartsColdAndNothingElseDoes) {
  const Step step = make_step(0);
  SteppingSolver<double> untouched(Device::cpu(), tight(), room_for(1)), solver(Device::cpu(), tight(), room_for(1));
  const auto cold = env_hashes(step.batch, take(solver, step, false));
  take(untouched, step, false);
  std::vector<std::uint8_t> mask(static_cast<std::size_t>(kEnvs), 0);
  mask[3] = mask[7] = 1;
  solver.reset_where(mask.data());
  const auto again = env_hashes(step.batch, take(solver, step, false));
  const auto warm = env_hashes(step.batch, take(untouched, step, false));
  for (std::size_t e = 0; e < cold.size(); ++e) EXPECT_EQ(again[e], mask[e] != 0 ? cold[e] : warm[e]) << e;
  solver.reset_all();
  EXPECT_EQ(env_hashes(step.batch, take(solver, step, false)), cold);
}

TEST(Stepping, MisuseIsRefused) {
  EXPECT_THROW(SteppingSolver<double>(Device::cpu(), tight(), Capacity{}), Error);
  Capacity small = room_for(1);
  small.rows = 3;
  SteppingSolver<double> solver(Device::cpu(), tight(), small);
  const Step step = make_step(0);
  EXPECT_THROW(take(solver, step, false), Error);
}

}  // namespace
}  // namespace stiction::test
