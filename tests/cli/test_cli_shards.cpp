// Parts of a solve, and their merge: the file of one call, byte for byte, or one sentence.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "tests/cli/batches.hpp"
#include "tests/cli/process.hpp"
#include "tests/cli/refusal.hpp"

namespace stiction::test {
namespace {

using Json = nlohmann::ordered_json;
using Words = std::vector<std::string>;

Words operator+(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

std::string shard_text(int index, int count) {
  return std::to_string(index) + "/" + std::to_string(count);
}

class Shards : public testing::Test {
 protected:
  /// Solves every part of a batch; returns their files, the last first.
  Words solve_parts(const std::string& batch, int count, const Words& options = {}) {
    Words parts;
    for (int index = 0; index < count; ++index) {
      parts.insert(parts.begin(), folder_ / ("part-" + std::to_string(index) + ".h5"));
      const Finished finished = run_stiction(
          Words{"solve", batch, "--quiet", "--shard", shard_text(index, count), "-o", parts.front()} + options);
      EXPECT_EQ(finished.status, 0) << finished.err;
    }
    return parts;
  }

  std::string solve_whole(const std::string& batch, const Words& options = {}) {
    const Finished finished = run_stiction(Words{"solve", batch, "--quiet", "-o", folder_ / "whole.h5"} + options);
    EXPECT_EQ(finished.status, 0) << finished.err;
    return folder_ / "whole.h5";
  }

  Finished merge(const Words& parts) { return run_stiction(Words{"merge", folder_ / "merged.h5"} + parts); }

  /// Solves in parts and in one call, and compares the bytes of the files.
  void expect_one_file(const std::string& batch, int count, const Words& options = {}) {
    const std::string whole = read_text(solve_whole(batch, options));
    const Finished merged = merge(solve_parts(batch, count, options));
    ASSERT_EQ(merged.status, 0) << merged.err;
    EXPECT_EQ(read_text(folder_ / "merged.h5"), whole) << count << " parts";
    const std::string hash = run_stiction({"hash", folder_ / "whole.h5"}).out;
    EXPECT_THAT(merged.out, testing::HasSubstr("hash " + hash));
    EXPECT_EQ(run_stiction({"diff", folder_ / "whole.h5", folder_ / "merged.h5"}).status, 0);
  }

  Folder folder_;
  std::string batch_ = write_batch(folder_ / "batch.h5", chain_recording(5));
};

TEST_F(Shards, AnyNumberOfPartsMakesTheFileOfOneCall) {
  for (int count = 1; count <= 7; ++count) expect_one_file(batch_, count);
}

TEST_F(Shards, WithEveryOptionThatTouchesTheOrderOrTheNumbers) {
  for (const Words& options :
       {Words{"--precision", "f32"}, Words{"--permute", "3"}, Words{"--islands", "apart"}, Words{"--blocks", "pairs"},
        Words{"--solver", "nsgs", "--tolerance", "1e-8"}, Words{"--pyramid", "4"}})
    expect_one_file(batch_, 3, options);
  const std::string islands = write_batch(folder_ / "islands.h5", island_recording(4));
  expect_one_file(islands, 3, {"--islands", "apart"});
}

TEST_F(Shards, OfJacobiansAndOfBodies) {
  const std::string walls = folder_ / "walls.h5";
  ASSERT_EQ(run_stiction({"generate", "wall", "--envs", "4", "--size", "2", "--quiet", "-o", walls}).status, 0);
  for (const int count : {3, 6}) {
    expect_one_file(walls, count, {"--form", "jacobian", "--max-iterations", "4000"});
    expect_one_file(walls, count, {"--form", "bodies", "--solver", "si", "--max-iterations", "4000", "--permute", "1"});
  }
}

TEST_F(Shards, StartFromASolutionOfTheWholeBatch) {
  ASSERT_EQ(run_stiction({"solve", batch_, "--quiet", "--tolerance", "1e-2", "-o", folder_ / "start.h5"}).status, 0);
  expect_one_file(batch_, 3, {"--warm-start", folder_ / "start.h5"});
  expect_one_file(batch_, 3, {"--warm-start", folder_ / "start.h5", "--permute", "2"});
}

TEST_F(Shards, OfABatchWithoutEnvironments) {
  expect_one_file(write_batch(folder_ / "none.h5", chain_recording(0)), 2);
}

TEST_F(Shards, AnEnvironmentIsInOnePart) {
  std::vector<int> sizes;
  Offset next = 0;
  for (int index = 0; index < 7; ++index) {
    const Finished finished =
        run_stiction({"solve", batch_, "--shard", shard_text(index, 7), "--json", folder_ / "report.json"});
    const Json json = Json::parse(read_text(folder_ / "report.json"));
    EXPECT_EQ(json["shard"]["index"], index);
    EXPECT_EQ(json["shard"]["count"], 7);
    EXPECT_EQ(json["shard"]["environments"], 5);
    EXPECT_EQ(json["shard"]["first_environment"], next);
    EXPECT_EQ(field(finished.out, "shard"),
              shard_text(index, 7) + ", from environment " + std::to_string(next) + " of 5");
    sizes.push_back(json["environments"].get<int>());
    next += sizes.back();
  }
  EXPECT_EQ(next, 5);
  EXPECT_THAT(sizes, testing::Each(testing::Le(1)));
}

TEST_F(Shards, AMissingPartIsNamed) {
  for (int gone = 0; gone < 3; ++gone) {
    Words parts = solve_parts(batch_, 3);
    parts.erase(parts.begin() + (2 - gone));
    EXPECT_TRUE(is_refused(merge(parts), {"part " + shard_text(gone, 3) + " is missing"}));
  }
}

TEST_F(Shards, ADoubledPartIsNamed) {
  Words parts = solve_parts(batch_, 3);
  std::filesystem::copy_file(parts[1], folder_ / "copy.h5");
  EXPECT_TRUE(is_refused(merge(parts + Words{folder_ / "copy.h5"}), {"part-1.h5", "copy.h5", "both part 1/3"}));
  EXPECT_TRUE(is_refused(merge(parts + Words{parts[2]}), {"both part 0/3"}));
}

TEST_F(Shards, ForeignPartsAreNamedWithWhatDiffers) {
  const auto with_foreign = [&](const std::string& batch, const std::string& shard, const Words& options) {
    Words parts = solve_parts(batch_, 3);
    const Finished finished =
        run_stiction(Words{"solve", batch, "--quiet", "--shard", shard, "-o", folder_ / "foreign.h5"} + options);
    EXPECT_EQ(finished.status, 0) << finished.err;
    parts[1] = folder_ / "foreign.h5";
    return merge(parts);
  };
  // The same counts, and one number changed.
  const io::Recording recording = chain_recording(5);
  auto arrays = recording.batch.arrays();
  arrays.b[0] += 1e-9;
  const std::string other = write_batch(folder_ / "other.h5", with_arrays(recording, std::move(arrays)));
  EXPECT_TRUE(is_refused(with_foreign(other, "1/3", {}), {"foreign.h5", "hashes"}));
  EXPECT_TRUE(is_refused(with_foreign(batch_, "1/4", {}), {"of 3 and of 4 parts"}));
  EXPECT_TRUE(
      is_refused(with_foreign(batch_, "1/3", {"--tolerance", "1e-5"}), {"tolerance=0.0001", "tolerance=1e-05"}));
  EXPECT_TRUE(is_refused(with_foreign(batch_, "1/3", {"--precision", "f32"}), {"precision=f64", "precision=f32"}));
  EXPECT_TRUE(is_refused(with_foreign(batch_, "1/3", {"--solver", "nsgs"}), {"solver=npgs", "solver=nsgs"}));
  EXPECT_TRUE(is_refused(with_foreign(batch_, "1/3", {"--law", "coulomb"}), {"law=convex", "law=coulomb"}));
  const std::string whole = solve_whole(batch_);
  EXPECT_TRUE(is_refused(with_foreign(batch_, "1/3", {"--warm-start", whole}), {"warm_start=none"}));
  // Threads and order reach no bit.
  EXPECT_EQ(with_foreign(batch_, "1/3", {"--threads", "1", "--permute", "4"}).status, 0);
}

TEST_F(Shards, AWholeSolutionIsNoPart) {
  const std::string whole = solve_whole(batch_);
  EXPECT_TRUE(is_refused(merge({whole}), {"whole.h5", "no part"}));
  EXPECT_TRUE(is_refused(merge({batch_}), {"batch.h5", "contact-solution"}));
}

TEST_F(Shards, ATruncatedPartIsRefusedAndNothingIsWritten) {
  const Words parts = solve_parts(batch_, 2);
  const std::string bytes = read_text(parts[0]);
  for (const double share : {0.0, 0.1, 0.5, 0.9, 0.99}) {
    write_text(parts[0], bytes.substr(0, static_cast<std::size_t>(share * static_cast<double>(bytes.size()))));
    EXPECT_TRUE(is_refused(merge(parts), {"part-1.h5"})) << "share kept: " << share;
    EXPECT_FALSE(std::filesystem::exists(folder_ / "merged.h5"));
  }
}

TEST_F(Shards, APartIsNotOverwritten) {
  const Words parts = solve_parts(batch_, 2);
  const std::string before = read_text(parts[1]);
  EXPECT_TRUE(is_refused(run_stiction(Words{"merge", parts[1]} + parts), {"would overwrite"}));
  EXPECT_EQ(read_text(parts[1]), before);
}

TEST_F(Shards, ABrokenEnvironmentIsRefusedByEveryPart) {
  const io::Recording recording = chain_recording(4);
  auto arrays = recording.batch.arrays();
  arrays.mu[1] = -1;
  const std::string spoilt = write_batch(folder_ / "spoilt.h5", with_arrays(recording, std::move(arrays)));
  for (int index = 0; index < 4; ++index)
    EXPECT_TRUE(is_refused(run_stiction({"solve", spoilt, "--shard", shard_text(index, 4)}), {"env 0", "-1"}));
}

}  // namespace
}  // namespace stiction::test
