#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <random>

#include "cuda/emulated/emulated_device.hpp"
#include "cuda/machine/engine.hpp"
#include "tests/support/machines/device_batch.hpp"
#if defined(STICTION_TEST_HAS_IO)
#include "stiction/io.hpp"
#endif

/// A training loop's load: thousands of ragged environments, including recorded robots, captured once and replayed
/// with other environments in other places every time. STICTION_REPLAY_ENVS and STICTION_REPLAYS make it as large as
/// the loop is (8192 and 100).
namespace stiction::test {
namespace {

int number_from(const char* variable, int otherwise) {
  const char* text = std::getenv(variable);
  return text == nullptr ? otherwise : std::stoi(text);
}

/// Pool that environments are drawn from: the mixed scene, and every recorded robot that is there.
ContactBatch<float> pool() {
  ContactBatch<double> all = scene_batch("mixed", 256, 12);
  all.set_law(Law::coulomb);
#if defined(STICTION_TEST_HAS_IO)
  for (const char* file : {"humanoid", "quadruped_rough", "hand_cube", "pile"}) {
    const auto path = std::filesystem::path(STICTION_EXAMPLES_DIR) / "data" / (std::string(file) + ".h5");
    if (!std::filesystem::exists(path)) continue;
    const io::Recording recording = io::read_batch(path);
    for (Offset e = 0; e < recording.batch.env_count(); ++e) all.add(environment_of(recording.batch.view(), e));
  }
#endif
  return convert<float>(all);
}

TEST(DeviceReplay, OneGraphAnswersWhateverBatchIsInItsPlace) {
  const Offset envs = number_from("STICTION_REPLAY_ENVS", 256);
  const int replays = number_from("STICTION_REPLAYS", 8);
  const ContactBatch<float> source = pool();
  std::mt19937_64 random(1);
  const auto draw = [&] {
    std::vector<Offset> order(static_cast<std::size_t>(envs));
    for (Offset& env : order) env = static_cast<Offset>(random() % static_cast<std::uint64_t>(source.env_count()));
    return gather(source, std::span<const Offset>(order));
  };
  // Room for twice the need of a first draw; no draw of this many comes near it.
  Capacity room = Capacity::of(draw().view());
  const Capacity largest = Capacity::of(source.view());
  room.rows *= 2;
  room.cones *= 2;
  room.nonzeros *= 2;
  room.env_rows = largest.env_rows;
  room.env_nonzeros = largest.env_nonzeros;

  SolverOptions options;
  options.max_iterations = 12;
  options.law = Law::coulomb;
  options.invalid = InvalidPolicy::isolate;
  cuda::EmulatedDevice device({number_from("STICTION_REPLAY_LANES", 1), 4, 3});
  cuda::Engine engine(device);
  engine.reserve(room, options.solver, Precision::f32);
  const cuda::Stream stream(device);
  DeviceBatch<float> there(device, room);
  device.begin_capture(stream.get());
  engine.solve(SolveRequest<float>{nullptr, there.view(), there.solution(), nullptr, Law::coulomb, options,
                                   StreamRef(stream.get())});
  const auto graph = device.end_capture(stream.get());

  int equal = 0;
  Offset fewest = room.rows, most = 0;
  for (int replay = 0; replay < replays; ++replay) {
    const ContactBatch<float> batch = draw();
    fewest = std::min(fewest, batch.row_count());
    most = std::max(most, batch.row_count());
    there.fill(batch, stream.get());
    device.launch(graph, stream.get());
    const bool same = env_hashes(batch, there.fetch(batch, stream.get())) == solve_hashes(batch, options);
    EXPECT_TRUE(same) << "replay " << replay;
    equal += same ? 1 : 0;
  }
  std::printf("%lld environments, %d replays of one graph, %lld to %lld rows: %d with the CPU's hashes\n",
              static_cast<long long>(envs), replays, static_cast<long long>(fewest), static_cast<long long>(most),
              equal);
}

}  // namespace
}  // namespace stiction::test
