#include <unistd.h>

#include "stiction/jacobian_solver.hpp"
#include "tests/support/golden/case.hpp"
#include "tests/support/machines/device_batch.hpp"
#include "tests/support/systems/jacobian_answer.hpp"
#include "tests/support/systems/roomy_jacobians.hpp"
#include "tests/support/systems/small_systems.hpp"
#include "tests/support/systems/twin_batches.hpp"
#include "tests/support/systems/velocity_cases.hpp"
#include "tools/gpu_first/arrays.hpp"
#include "tools/gpu_first/check.hpp"

/// Captures and concurrent calls; the same solve many times; many environments.
namespace stiction::gpu_first {

namespace {

using test::env_hashes;

SolverOptions few_sweeps(SolverKind solver, Index most) {
  SolverOptions options = test::options(solver, 1e-6, most);
  options.law = Law::coulomb;  // captured work has a law before it has a batch
  options.invalid = InvalidPolicy::isolate;
  options.threads = 0;
  return options;
}

/// The first solve of a process, captured: nothing has loaded a kernel before but the solver's own room.
void capture_cold(Report& report) {
  const auto batch = convert<float>(test::scene_batch("mixed", 24, 9));
  const SolverOptions options = few_sweeps(SolverKind::npgs, 24);
  report.compare(
      "npgs f32", [&] { return env_hashes(batch, solve(batch, options)); },
      [&] {
        const auto api = report.target()->api();
        const Capacity room = Capacity::of(batch.view());
        const Solver solver(report.target()->device(), options, room);
        const cuda::Stream stream(*api);
        test::DeviceBatch<float> there(*api, room);
        const auto launch = report.target()->capture(stream.get(), [&] {
          solver.solve(there.view(), there.solution(), static_cast<const float*>(nullptr), StreamRef(stream.get()));
        });
        there.fill(batch, stream.get());
        launch();
        return env_hashes(batch, there.fetch(batch, stream.get()));
      });
}

/// One graph for each solver, launched with other numbers, contacts and counts.
void capture_replay(Report& report) {
  const bool full = report.setting().full;
  const auto batches = test::different_batches(full ? 12 : 4, full ? 64 : 6);
  Capacity room;
  for (const auto& batch : batches) room = test::larger(room, Capacity::of(batch.view()));
  for (const SolverKind kind : {SolverKind::npgs, SolverKind::apgd, SolverKind::automatic}) {
    const SolverOptions options = few_sweeps(kind, full ? 24 : 8);
    report.compare(
        to_string(kind),
        [&] {
          Hashes hashes;
          for (const auto& batch : batches) hashes.push_back(joined(env_hashes(batch, solve(batch, options))));
          return hashes;
        },
        [&] {
          const auto api = report.target()->api();
          const Solver solver(report.target()->device(), options, room);
          const cuda::Stream stream(*api);
          test::DeviceBatch<float> there(*api, room);
          const auto launch = report.target()->capture(stream.get(), [&] {
            solver.solve(there.view(), there.solution(), static_cast<const float*>(nullptr), StreamRef(stream.get()));
          });
          Hashes hashes;
          for (const auto& batch : batches) {
            there.fill(batch, stream.get());
            launch();
            hashes.push_back(joined(env_hashes(batch, there.fetch(batch, stream.get()))));
          }
          return hashes;
        });
  }
}

/// Iterations that environments may have in three launches of one graph. In the second one Newton's method in
/// velocities leaves some.
std::vector<std::vector<Index>> iterations_by_launch(Offset envs) {
  const std::vector<Index> enough(static_cast<std::size_t>(envs), 60);
  std::vector<Index> few = enough;
  for (std::size_t env = 0; env < few.size(); env += 5) few[env] = 2;
  return {enough, few, enough};
}

std::uint64_t hash_of_answer(const test::JacobianAnswer<float>& answer) {
  test::Digest status;
  status.add(std::span<const EnvStatus>(answer.status));
  return joined(Hashes{hash_of(answer.lambda), hash_of(answer.w), hash_of(answer.velocity), status.value()});
}

/// One graph of `auto` on J and M, in which the work after Newton's method in velocities is behind a condition.
void capture_leftovers(Report& report) {
  JacobianBatch<float> batch(Law::convex);
  for (std::uint64_t seed = 1; seed <= (report.setting().full ? 400U : 6U); ++seed)
    batch.add(test::cast<float>(test::random_chain({seed, static_cast<Index>(9 + seed % 20)})));
  SolverOptions options = test::options(SolverKind::automatic, 1e-4, 60);
  options.threads = 0;
  JacobianBatchView<float> host = batch.view();
  const auto launches = iterations_by_launch(host.env_count);
  const JacobianCapacity capacity = JacobianCapacity::of(host);
  report.compare(
      "auto f32",
      [&] {
        Hashes hashes;
        for (const std::vector<Index>& iterations : launches) {
          host.env_max_iterations = iterations.data();
          test::JacobianAnswer<float> answer(host);
          JacobianSolver<float>(Device::cpu(), options, capacity).solve(host, answer.view(), JacobianStart<float>{});
          hashes.push_back(hash_of_answer(answer));
        }
        return hashes;
      },
      [&] {
        Arrays arrays(report.target()->api());
        JacobianSolver<float> solver(report.target()->device(), options, capacity);
        host.env_max_iterations = nullptr;
        JacobianBatchView<float> view = on_device(arrays, host);
        Index* const allowed = arrays.room<Index>(host.env_count);
        view.env_max_iterations = allowed;
        const JacobianSolutionView<float> there{arrays.room<float>(host.row_count), arrays.room<float>(host.row_count),
                                                arrays.room<float>(host.dof_count),
                                                arrays.room<EnvStatus>(host.env_count)};
        const auto launch = report.target()->capture(
            arrays.stream(), [&] { solver.solve(view, there, JacobianStart<float>{}, StreamRef(arrays.stream())); });
        Hashes hashes;
        for (const std::vector<Index>& iterations : launches) {
          report.target()->api()->copy(allowed, iterations.data(), iterations.size() * sizeof(Index),
                                       cuda::CopyKind::to_device, arrays.stream());
          launch();
          test::JacobianAnswer<float> answer(host);
          answer.lambda = arrays.fetch(there.lambda, host.row_count);
          answer.w = arrays.fetch(there.w, host.row_count);
          answer.velocity = arrays.fetch(there.velocity, host.dof_count);
          answer.status = arrays.fetch(there.status, host.env_count);
          hashes.push_back(hash_of_answer(answer));
        }
        return hashes;
      });
}

/// Two solvers whose cooperative grids are on the device at once. Each asks for all of it: if the driver let both
/// begin, neither could end.
void two_grids(Report& report) {
  const auto batch = convert<float>(test::scene_batch("pile", 1, 5, 2100));
  const SolverOptions options = few_sweeps(SolverKind::npgs, report.setting().full ? 8 : 1);
  report.compare(
      "npgs f32",
      [&] {
        const std::uint64_t once = joined(env_hashes(batch, solve(batch, options)));
        return Hashes{once, once};
      },
      [&] {
        Arrays arrays(report.target()->api()), other(report.target()->api());
        const Solver first(report.target()->device(), options, Capacity::of(batch.view()));
        const Solver second(report.target()->device(), options, Capacity::of(batch.view()));
        const auto view = on_device(arrays, batch.view()), copy = on_device(other, batch.view());
        const auto there = solution_room(arrays, view), beside = solution_room(other, copy);
        const int rounds = report.setting().full ? 5 : 1;
        // A signal ends this process: the parent then prints "died", and the signal.
        alarm(static_cast<unsigned>(5 * report.setting().patience));
        for (int round = 0; round < rounds; ++round) {
          first.solve(view, there, static_cast<const float*>(nullptr), StreamRef(arrays.stream()));
          second.solve(copy, beside, static_cast<const float*>(nullptr), StreamRef(other.stream()));
        }
        arrays.synchronize();
        other.synchronize();
        alarm(0);
        return Hashes{joined(env_hashes(batch, fetch(arrays, view, there))),
                      joined(env_hashes(batch, fetch(other, copy, beside)))};
      });
}

/// The order that lanes, blocks and streams happened to take must not show.
void repeat(Report& report) {
  const bool full = report.setting().full;
  const ContactBatch<double> all = full ? test::twin_batch() : test::small_twin_batch();
  const auto batch = convert<float>(all);
  const int times = full ? 200 : 3;
  for (const SolverKind kind : {SolverKind::npgs, SolverKind::apgd}) {
    const SolverOptions options = few_sweeps(kind, full ? 30 : 6);
    report.compare(
        to_string(kind),
        [&] { return Hashes(static_cast<std::size_t>(times), joined(env_hashes(batch, solve(batch, options)))); },
        [&] {
          Arrays arrays(report.target()->api());
          const Solver solver(report.target()->device(), options, Capacity::of(batch.view()));
          const auto view = on_device(arrays, batch.view());
          const auto there = solution_room(arrays, view);
          Hashes hashes;
          for (int time = 0; time < times; ++time) {
            solver.solve(view, there, static_cast<const float*>(nullptr), StreamRef(arrays.stream()));
            hashes.push_back(joined(env_hashes(batch, fetch(arrays, view, there))));
          }
          return hashes;
        });
  }
}

void many_environments(Report& report) {
  const bool full = report.setting().full;
  const auto distinct = convert<float>(test::ragged_batch(full ? 8 : 1, 21));
  std::vector<Offset> order(full ? 65536 : 60);
  for (std::size_t i = 0; i < order.size(); ++i)
    order[i] = static_cast<Offset>((i * 7919 + i / 64) % static_cast<std::size_t>(distinct.env_count()));
  // Large environments take the room of many small ones; a few of them are enough.
  for (std::size_t i = 0; i < order.size(); ++i)
    while (distinct.view().env_rows(order[i]) > 100 && i % 512 != 0) order[i] = (order[i] + 1) % distinct.env_count();
  const auto batch = gather(distinct, std::span<const Offset>(order));
  const SolverOptions options = few_sweeps(SolverKind::npgs, full ? 60 : 8);
  report.compare(
      "npgs f32", [&] { return env_hashes(batch, solve(batch, options)); },
      [&] { return env_hashes(batch, solve(batch, options, report.target()->device())); });
}

}  // namespace

void add_capture(Checks& checks) {
  checks.push_back({"capture/cold", 20, capture_cold});
  checks.push_back({"capture/replay", 30, capture_replay});
  checks.push_back({"capture/leftovers", 20, capture_leftovers});
  checks.push_back({"capture/two_grids", 25, two_grids});
}

void add_repetition(Checks& checks) {
  checks.push_back({"repeat/same", 30, repeat});
  checks.push_back({"repeat/many", 40, many_environments});
}

}  // namespace stiction::gpu_first
