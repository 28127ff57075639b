// Errors that a user meets: one sentence on stderr, exit status 2, nothing written.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "tests/cli/batches.hpp"
#include "tests/cli/process.hpp"
#include "tests/cli/refusal.hpp"

namespace stiction::test {
namespace {

class Refused : public testing::Test {
 protected:
  std::string good() { return write_batch(folder_ / "good.h5", chain_recording(4)); }

  /// A batch with one array changed by `spoil`.
  template <class Spoil>
  std::string spoilt(Spoil spoil) {
    const io::Recording recording = chain_recording(4);
    auto arrays = recording.batch.arrays();
    spoil(arrays);
    return write_batch(folder_ / "spoilt.h5", with_arrays(recording, std::move(arrays)));
  }

  Finished solve(const std::string& batch) { return run_stiction({"solve", batch, "-o", folder_ / "solution.h5"}); }

  Folder folder_;
};

TEST_F(Refused, ATruncatedFile) {
  const std::string bytes = read_text(good());
  for (const double share : {0.02, 0.5, 0.95}) {
    const std::string path = folder_ / "truncated.h5";
    write_text(path, bytes.substr(0, static_cast<std::size_t>(share * static_cast<double>(bytes.size()))));
    EXPECT_TRUE(is_refused(solve(path), {"truncated.h5"})) << "share kept: " << share;
  }
}

TEST_F(Refused, ATextFile) {
  write_text(folder_ / "text.h5", "environments: 3\nrows: 9\n");
  EXPECT_TRUE(is_refused(solve(folder_ / "text.h5"), {"text.h5"}));
}

TEST_F(Refused, AnEmptyFile) {
  write_text(folder_ / "empty.h5", "");
  EXPECT_TRUE(is_refused(solve(folder_ / "empty.h5"), {"empty.h5"}));
}

TEST_F(Refused, AFileThatIsNotThere) {
  EXPECT_TRUE(is_refused(solve(folder_ / "nowhere.h5"), {"nowhere.h5"}));
}

TEST_F(Refused, AFolder) {
  EXPECT_TRUE(is_refused(solve(folder_ / ""), {}));
}

TEST_F(Refused, ANaNInB) {
  const auto path = spoilt([](auto& arrays) { arrays.b[4] = std::numeric_limits<double>::quiet_NaN(); });
  EXPECT_TRUE(is_refused(solve(path), {"spoilt.h5", "b[", "env 1", "row 1", "nan", "--isolate"}));
}

TEST_F(Refused, ANegativeFrictionCoefficient) {
  const auto path = spoilt([](auto& arrays) { arrays.mu[5] = -0.25; });
  EXPECT_TRUE(is_refused(solve(path), {"spoilt.h5", "mu[", "env 1", "row 2", "-0.25"}));
}

TEST_F(Refused, AColumnOutOfRangeEvenWithIsolation) {
  const auto path = spoilt([](auto& arrays) { arrays.column[2] = 77; });
  EXPECT_TRUE(is_refused(solve(path), {"spoilt.h5", "column", "77"}));
  EXPECT_TRUE(is_refused(run_stiction({"solve", path, "--isolate"}), {"77"}));
}

TEST_F(Refused, SeveralDefectsAreCounted) {
  const auto path = spoilt([](auto& arrays) { arrays.mu[1] = arrays.mu[2] = arrays.mu[5] = -1; });
  EXPECT_TRUE(is_refused(solve(path), {"(and 2 more)"}));
}

TEST_F(Refused, NothingIsWrittenForABadBatch) {
  const auto path = spoilt([](auto& arrays) { arrays.mu[5] = -0.25; });
  run_stiction({"solve", path, "-o", folder_ / "s.h5", "--json", folder_ / "r.json", "--trace", folder_ / "t.csv",
                "--convergence", folder_ / "c.csv"});
  for (const char* name : {"s.h5", "r.json", "t.csv", "c.csv"})
    EXPECT_FALSE(std::filesystem::exists(folder_ / name)) << name;
}

TEST_F(Refused, UsageErrors) {
  const std::string batch = good();
  const std::vector<std::vector<std::string>> cases{
      {},
      {"dance"},
      {"solve"},
      {"solve", batch, "--dance"},
      {"solve", batch, "--tolerance", "small"},
      {"solve", batch, "--tolerance", "-1"},
      {"solve", batch, "--tolerance", "nan"},
      {"solve", batch, "--max-iterations", "-1"},
      {"solve", batch, "--max-iterations", "99999999999999"},
      {"solve", batch, "--omega", "2.5", "--solver", "pgs"},
      {"solve", batch, "--threads", "-2"},
      {"solve", batch, "--law", "murphy"},
      {"solve", batch, "--precision", "f16"},
      {"solve", batch, "--solver", "magic"},
      {"solve", batch, "--device", "abacus"},
      {"solve", batch, "--device", "cuda:99"},
      {"solve", batch, "--pyramid", "6"},
      {"solve", batch, "--pyramid", "4", "--warm-start", batch},
      {"solve", batch, "--pyramid", "4", "--record", folder_ / "x.h5"},
      {"solve", batch, "--permute", "many"},
      {"solve", batch, "--permute", "-1"},
      {"solve", batch, "--repeat", "0"},
      {"solve", batch, "--shard", "1"},
      {"solve", batch, "--shard", "1/"},
      {"solve", batch, "--shard", "/2"},
      {"solve", batch, "--shard", "0/0"},
      {"solve", batch, "--shard", "2/2"},
      {"solve", batch, "--shard", "-1/2"},
      {"solve", batch, "--shard", "0/2/3"},
      {"solve", batch, "--shard", "0/4294967296"},
      {"merge", folder_ / "x.h5"},
      {"merge", folder_ / "x.h5", folder_ / "nowhere.h5"},
      {"generate", "stack", "--seed", "-1", "-o", folder_ / "x.h5"},
      {"verify", batch},
      {"verify", batch, batch, "--tolerance", "nan"},
      {"verify", batch, batch, "--absolute-tolerance", "-1"},
      {"inspect", batch, "--env", "4"},
      {"inspect", batch, "--env", "-1"},
      {"inspect", batch, "--graph", folder_ / "graph.bmp"},
      {"generate", "nothing", "-o", folder_ / "x.h5"},
      {"generate", "stack"},
      {"generate", "stack", "--envs", "-3", "-o", folder_ / "x.h5"},
      {"convert", batch, folder_ / "x.hdf5"},
      {"convert", batch, folder_ / "x.hdf5", "--env", "9"},
      {"convert", batch, folder_ / "x.h5", "--to", "nowhere"},
  };
  for (const auto& arguments : cases) {
    std::string shown;
    for (const std::string& word : arguments) shown += word + " ";
    EXPECT_TRUE(is_refused(run_stiction(arguments), {})) << shown;
  }
}

TEST_F(Refused, ANameThatIsNotKnownListsThoseThatAre) {
  EXPECT_TRUE(is_refused(run_stiction({"solve", good(), "--solver", "magic"}), {"magic", "pgs", "npgs", "apgd"}));
  EXPECT_TRUE(is_refused(run_stiction({"generate", "x", "-o", folder_ / "x.h5"}), {"stack", "walker"}));
  EXPECT_TRUE(is_refused(run_stiction({"slove", good()}), {"slove: there is no such command"}));
}

TEST_F(Refused, AnOutputThatCannotBeWrittenIsFoundBeforeTheBatchIsRead) {
  const std::string nowhere = folder_ / "no/such/folder/s.h5";
  const std::string missing = folder_ / "missing.h5";
  EXPECT_TRUE(is_refused(run_stiction({"solve", missing, "-o", nowhere}), {nowhere}));
  EXPECT_TRUE(is_refused(run_stiction({"solve", missing, "--json", nowhere}), {nowhere}));
  EXPECT_TRUE(is_refused(run_stiction({"solve", missing, "--trace", folder_ / ""}), {"folder"}));
  EXPECT_TRUE(is_refused(run_stiction({"solve", missing, "--convergence", folder_ / ""}), {"folder"}));
  EXPECT_TRUE(is_refused(run_stiction({"generate", "stack", "-o", nowhere}), {nowhere}));
  EXPECT_TRUE(is_refused(run_stiction({"convert", missing, nowhere}), {nowhere}));
}

TEST_F(Refused, AnOutputThatWouldReplaceTheInputOrADevice) {
  const std::string batch = good();
  const std::string before = read_text(batch);
  EXPECT_TRUE(is_refused(run_stiction({"solve", batch, "-o", batch}), {"overwrite"}));
  EXPECT_TRUE(is_refused(run_stiction({"convert", batch, batch}), {"overwrite"}));
  EXPECT_TRUE(is_refused(run_stiction({"solve", batch, "-o", "/dev/null"}), {"not an ordinary file"}));
  EXPECT_EQ(read_text(batch), before);
}

/// Found before the work, not after it.
TEST_F(Refused, AnOutputWithoutAName) {
  const std::string batch = good(), circle = folder_ / "circle";
  std::filesystem::create_symlink(circle, circle);
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"solve", batch, "-o"}, {"step", "stack", "--steps", "1", "--checkpoint"}}) {
    const auto written_to = [&](const std::string& name) {
      std::vector<std::string> words = command;
      words.push_back(name);
      return run_stiction(words);
    };
    EXPECT_TRUE(is_refused(written_to(""), {"the name of a file to write is empty"}));
    EXPECT_TRUE(is_refused(written_to("-"), {"standard output: cannot be written: a file of HDF5 needs a name"}));
    EXPECT_TRUE(is_refused(written_to(circle), {circle, "cannot be written: Too many levels of symbolic links"}));
    EXPECT_TRUE(std::filesystem::is_symlink(circle));
  }
}

TEST_F(Refused, TwoOutputsInOneFile) {
  const std::string batch = good(), one = folder_ / "one.h5", also = folder_ / "./one.h5";
  EXPECT_TRUE(is_refused(run_stiction({"solve", batch, "-o", one, "--json", also}), {also, "both -o and --json"}));
  EXPECT_TRUE(is_refused(run_stiction({"solve", batch, "-o", one, "--record", one}), {"both -o and --record"}));
  EXPECT_TRUE(is_refused(run_stiction({"solve", batch, "--trace", one, "--convergence", one}), {"--convergence"}));
  EXPECT_TRUE(
      is_refused(run_stiction({"step", "stack", "-o", one, "--checkpoint", one}), {"both -o and --checkpoint"}));
  EXPECT_TRUE(is_refused(run_stiction({"step", "stack", "--json", "beside", "--checkpoint", "./beside"}), {"--json"}));
  EXPECT_TRUE(is_refused(run_stiction({"step", "stack", "-o", "-", "--json", "-"}), {"standard output: both"}));
  EXPECT_FALSE(std::filesystem::exists(one));
}

TEST_F(Refused, ANumberThatIsNotWholeOrNotThere) {
  const auto refused = [](const std::string& option, const std::string& value, const std::string& least) {
    return is_refused(run_stiction({"step", "stack", option, value}),
                      {option + ": " + value + " is not a whole number of at least " + least + ";"});
  };
  EXPECT_TRUE(refused("--size", "0", "1"));
  EXPECT_TRUE(refused("--envs", "-1", "0"));
  EXPECT_TRUE(refused("--steps", "1.5", "0"));
  EXPECT_TRUE(refused("--every", "two", "0"));
  EXPECT_TRUE(is_refused(run_stiction({"step", "stack", "--seed", "18446744073709551616"}),  // 2^64
                         {"--seed: 18446744073709551616 is more than 64 bits hold;"}));
  EXPECT_EQ(run_stiction({"step", "stack", "--envs", "+1", "--steps", "0", "--seed", "18446744073709551615"}).status,
            0);
}

TEST_F(Refused, ASolutionOfAnotherBatch) {
  const std::string other = write_batch(folder_ / "other.h5", chain_recording(7));
  ASSERT_EQ(solve(other).status, 0);
  const std::string solution = folder_ / "solution.h5";
  EXPECT_TRUE(is_refused(run_stiction({"verify", good(), solution}), {"another batch"}));
  EXPECT_TRUE(is_refused(run_stiction({"solve", good(), "--warm-start", solution}), {"another batch"}));
}

TEST_F(Refused, ABatchWhereASolutionIsWanted) {
  const std::string batch = good();
  EXPECT_TRUE(is_refused(run_stiction({"hash", batch}), {"good.h5"}));
  EXPECT_TRUE(is_refused(run_stiction({"diff", batch, batch}), {"good.h5"}));
}

TEST_F(Refused, CudaWhereThereIsNoneSaysWhy) {
  const Finished info = run_stiction({"info"});
  if (info.out.find("cuda:") != std::string::npos && info.out.find("cuda: not usable") == std::string::npos) {
    GTEST_SKIP() << "this machine has a CUDA device";
  }
  EXPECT_TRUE(is_refused(run_stiction({"solve", good(), "--device", "cuda"}), {}));
}

TEST(Help, IsNotAnError) {
  for (const char* option : {"--help", "--version"}) {
    const Finished finished = run_stiction({option});
    EXPECT_EQ(finished.status, 0);
    EXPECT_NE(finished.out.find("stiction"), std::string::npos);
    EXPECT_EQ(finished.err, "");
  }
}

}  // namespace
}  // namespace stiction::test
