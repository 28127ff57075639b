#include "stiction/stepping.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/warm_start_life.hpp"
#include "tools/gpu_first/arrays.hpp"
#include "tools/gpu_first/check.hpp"

/// Data that one step leaves for the next: first guesses, and solves that begin with them.
namespace stiction::gpu_first {

namespace {

/// Steps of one life, each from the reactions of the step before.
Hashes warm_steps(const std::vector<test::Step<float>>& life, Offset envs, Target* target) {
  const Device device = target == nullptr ? Device::cpu() : target->device();
  const WarmStartCapacity capacity{envs, 200 * envs, 900 * envs};
  WarmStartStore<float> store(device, capacity);
  Hashes hashes;
  for (const auto& step : life) {
    const test::Packed<float> packed(step.envs);
    const auto host = packed.batch.view();
    const auto status = [&](const std::vector<float>& guess) {
      std::vector<WarmStartRecord> records(static_cast<std::size_t>(envs));
      store.records(records);
      std::uint64_t hash = hash_of(guess);
      for (const auto& record : records)
        hash =
            (hash ^ static_cast<std::uint64_t>(record.hits * 1000 + record.misses)) * 0x100000001b3ULL + record.flags;
      hashes.push_back(hash);
    };
    if (target == nullptr) {
      std::vector<float> guess(packed.lambda.size());
      store.load(host, packed.id.data(), step.dt, guess.data());
      store.store(host, packed.id.data(),
                  {const_cast<float*>(packed.lambda.data()), nullptr, const_cast<EnvStatus*>(packed.status.data())},
                  step.dt);
      status(guess);
      continue;
    }
    Arrays arrays(target->api());
    const auto view = on_device(arrays, host);
    const std::uint64_t* const id = arrays.put(packed.id);
    float* const guess = arrays.room<float>(host.row_count);
    const SolutionView<float> answer{arrays.put(packed.lambda), nullptr, arrays.put(packed.status)};
    store.load(view, id, step.dt, guess, StreamRef(arrays.stream()));
    store.store(view, id, answer, step.dt, StreamRef(arrays.stream()));
    arrays.synchronize();
    status(arrays.fetch(guess, host.row_count));
  }
  return hashes;
}

void warm_start(Report& report) {
  std::mt19937_64 random(100);  // NOLINT(bugprone-random-generator-seed): the same life everywhere
  const int envs = report.setting().full ? 300 : 9;
  const auto life = test::random_life<float>(random, envs, 12);
  report.compare(
      "", [&] { return warm_steps(life, envs, nullptr); }, [&] { return warm_steps(life, envs, report.target()); });
}

/// Solves of a batch whose b changes, each from the answer before.
Hashes stepped(const ContactBatch<float>& first, Target* target) {
  const Device device = target == nullptr ? Device::cpu() : target->device();
  SolverOptions options;
  options.solver = SolverKind::npgs;
  options.tolerance = 1e-5;
  options.max_iterations = 80;
  SteppingSolver<float> solver(device, options, Capacity::of(first.view()));
  std::vector<std::uint64_t> ids(static_cast<std::size_t>(first.view().cone_count));
  for (std::size_t c = 0; c < ids.size(); ++c) ids[c] = 7000 + c;
  Hashes hashes;
  for (int k = 0; k < 5; ++k) {
    auto arrays_of = first.arrays();
    for (std::size_t i = 0; i < arrays_of.b.size(); ++i)
      arrays_of.b[i] *= 1.0F + 0.001F * static_cast<float>((i * 7 + static_cast<std::size_t>(k) * 3) % 11);
    const auto batch = ContactBatch<float>::from_arrays(first.law(), arrays_of);
    if (target == nullptr) {
      Solution<float> answer{std::vector<float>(static_cast<std::size_t>(batch.row_count())),
                             std::vector<float>(static_cast<std::size_t>(batch.row_count())),
                             std::vector<EnvStatus>(static_cast<std::size_t>(batch.env_count()))};
      solver.solve(batch.view(), ids.data(), 0.01, {answer.lambda.data(), answer.w.data(), answer.status.data()});
      hashes.push_back(joined(test::env_hashes(batch, answer)));
      continue;
    }
    Arrays arrays(target->api());
    const auto view = on_device(arrays, batch.view());
    const auto there = solution_room(arrays, view);
    solver.solve(view, arrays.put(ids), 0.01, there, StreamRef(arrays.stream()));
    arrays.synchronize();
    hashes.push_back(joined(test::env_hashes(batch, fetch(arrays, view, there))));
  }
  return hashes;
}

void stepping(Report& report) {
  const auto batch = convert<float>(test::scene_batch("walker", report.setting().full ? 1000 : 6, 4));
  report.compare("", [&] { return stepped(batch, nullptr); }, [&] { return stepped(batch, report.target()); });
}

}  // namespace

void add_steps(Checks& checks) {
  checks.push_back({"form/warm_start", 20, warm_start});
  checks.push_back({"form/stepping", 20, stepping});
}

}  // namespace stiction::gpu_first
