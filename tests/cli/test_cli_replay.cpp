#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "stiction/config.hpp"
#include "tests/cli/batches.hpp"
#include "tests/cli/process.hpp"

namespace stiction::test {
namespace {

using Words = std::vector<std::string>;

class Replay : public testing::Test {
 protected:
  Finished record(const Words& more) {
    Words words{"solve", batch_, "--record", file_};
    words.insert(words.end(), more.begin(), more.end());
    return run_stiction(words);
  }

  Folder folder_;
  std::string batch_ = write_batch(folder_ / "batch.h5", chain_recording(20));
  std::string file_ = folder_ / "recording.h5";
};

TEST_F(Replay, WhatIsRecordedHasTheSameBitsAgainOnEveryDevice) {
  for (const char* precision : {"f32", "f64"}) {
    ASSERT_EQ(record({"--record-when", "always", "--precision", precision, "--solver", "apgd", "--tolerance", "1e-9",
                      "--permute", "7", "--json", folder_ / "r.json"})
                      .status &
                  ~1,
              0);
    for (const char* device : {"cpu", "emulated"}) {
      const Finished finished = run_stiction({"replay", file_, "--device", device});
      EXPECT_EQ(finished.status, 0) << finished.err;
      EXPECT_NE(finished.out.find("20 of 20 environments have the recorded bits"), std::string::npos) << finished.out;
    }
    EXPECT_EQ(run_stiction({"replay", file_, "--quiet"}).out, "");
  }
}

TEST_F(Replay, IslandsSolvedApartAreReplayedApart) {
  batch_ = write_batch(folder_ / "islands.h5", island_recording(6));
  record({"--record-when", "always", "--islands", "apart", "--tolerance", "1e-6"});
  EXPECT_EQ(run_stiction({"replay", file_}).status, 0);
  io::Recording recording = io::read_batch(file_);
  recording.solve->islands = IslandMode::together;
  io::write_batch(file_, recording);
  EXPECT_EQ(run_stiction({"replay", file_}).status, 1) << "the mode is part of what is replayed";
}

TEST_F(Replay, AChoiceBySpectrumIsReplayedByItsRules) {
  record({"--record-when", "always", "--choose", "spectrum", "--tolerance", "1e-6"});
  EXPECT_EQ(run_stiction({"replay", file_}).status, 0);
  io::Recording recording = io::read_batch(file_);
  EXPECT_EQ(recording.solve->choose, SolverChoice::spectrum);
  EXPECT_EQ(recording.solve->spectrum, SpectrumRules{});
  SpectrumRules& rules = recording.solve->spectrum;
  rules.direct = rules.preconditioned = rules.decomposed = rules.otherwise = SolverKind::jacobi;
  rules.steps = 3;
  io::write_batch(file_, recording);
  EXPECT_EQ(io::read_batch(file_).solve->spectrum, rules);
  EXPECT_EQ(run_stiction({"replay", file_}).status, 1) << "the rules are part of what is replayed";
  EXPECT_EQ(run_stiction({"solve", batch_, "--choose", "spectrum", "--solver", "pgs"}).status, 2);
  EXPECT_EQ(run_stiction({"solve", batch_, "--choose", "best"}).status, 2);
}

TEST_F(Replay, OnlyWhatFailedIsRecordedUnlessAskedFor) {
  EXPECT_EQ(record({}).status, 0);
  EXPECT_FALSE(std::filesystem::exists(file_));
  EXPECT_EQ(record({"--max-iterations", "1", "--tolerance", "1e-12"}).status, 1);
  EXPECT_EQ(run_stiction({"replay", file_}).status, 0);
}

TEST_F(Replay, AWarmStartIsReplayedToo) {
  ASSERT_EQ(
      run_stiction({"solve", batch_, "--max-iterations", "2", "--tolerance", "0", "-o", folder_ / "s.h5"}).status & ~1,
      0);
  record({"--record-when", "always", "--warm-start", folder_ / "s.h5", "--max-iterations", "1", "--tolerance", "0"});
  EXPECT_FALSE(io::read_batch(file_).solve->warm_start.empty());
  EXPECT_EQ(run_stiction({"replay", file_}).status, 0);
}

TEST_F(Replay, ABitThatDiffersIsNamed) {
  record({"--record-when", "always"});
  io::Recording recording = io::read_batch(file_);
  const auto row = static_cast<std::size_t>(recording.batch.arrays().env_row_offsets[4]) + 1;
  recording.solve->lambda[row] = std::nextafter(recording.solve->lambda[row], 1e9);
  io::write_batch(file_, recording);
  const Finished finished = run_stiction({"replay", file_});
  EXPECT_EQ(finished.status, 1);
  for (const char* part : {"environment 4 ", "row 1:", "1 ulp", "19 of 20 environments have the recorded bits"})
    EXPECT_NE(finished.out.find(part), std::string::npos) << finished.out;
}

TEST_F(Replay, WhatCannotBeReplayedIsRefused) {
  EXPECT_EQ(run_stiction({"replay", batch_}).status, 2);
  EXPECT_NE(run_stiction({"replay", batch_}).err.find("not written by a recorder"), std::string::npos);
  EXPECT_EQ(record({"--record-when", "often"}).status, 2);
  EXPECT_EQ(run_stiction({"solve", batch_, "--record", batch_}).status, 2);
  record({"--record-when", "always"});
  io::Recording recording = io::read_batch(file_);
  recording.solve->numerics_epoch = kNumericsEpoch + 1;
  io::write_batch(file_, recording);
  const Finished finished = run_stiction({"replay", file_});
  EXPECT_EQ(finished.status, 2);
  EXPECT_NE(finished.err.find("epoch"), std::string::npos);
}

}  // namespace
}  // namespace stiction::test
