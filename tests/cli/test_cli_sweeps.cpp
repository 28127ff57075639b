// Sentences about how sweeps go: contacts in blocks, and threads that wait for no colour.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/cli/batches.hpp"
#include "tests/cli/process.hpp"

namespace stiction::test {

namespace {

using Json = nlohmann::ordered_json;
using Words = std::vector<std::string>;

class Sweeps : public testing::Test {
 protected:
  void SetUp() override {
    const Words words{"generate", "stack", "--envs", "2", "--size", "4", "--seed", "5", "-o", stacks_};
    ASSERT_EQ(run_stiction(words).status, 0);
  }
  [[nodiscard]] Finished solve(const Words& more) const {
    Words words{"solve", stacks_, "--tolerance", "1e-5", "--max-iterations", "20000"};
    words.insert(words.end(), more.begin(), more.end());
    return run_stiction(words);
  }

  Folder folder_;
  std::string stacks_ = folder_ / "stacks.h5";
};

TEST_F(Sweeps, BlocksAreSaidAndAnotherIteration) {
  const Json plain = Json::parse(solve({"--json", "-"}).out);
  EXPECT_FALSE(plain.contains("blocks"));
  for (const char* mode : {"pairs", "strong"}) {
    const Json json = Json::parse(solve({"--blocks", mode, "--json", "-", "-o", folder_ / "s.h5"}).out);
    EXPECT_EQ(json["blocks"], mode);
    EXPECT_EQ(json["unconverged"], 0);
    EXPECT_NE(json["hash"], plain["hash"]);
    EXPECT_EQ(run_stiction({"verify", stacks_, folder_ / "s.h5", "--tolerance", "1.000001e-5"}).status, 0);
    const Words recorded{"--blocks", mode, "--record", folder_ / "record.h5", "--record-when", "always"};
    EXPECT_EQ(field(solve(recorded).out, "blocks"), mode);
    EXPECT_EQ(run_stiction({"replay", folder_ / "record.h5"}).status, 0);
    std::filesystem::remove(folder_ / "record.h5");
  }
  EXPECT_THAT(solve({"--blocks", "boxes"}).err, testing::HasSubstr("cones, pairs, strong"));
  EXPECT_THAT(solve({"--blocks", "pairs", "--solver", "auto"}).err, testing::HasSubstr("choose pgs, npgs or nsgs"));
}

TEST_F(Sweeps, BlocksOfBodiesAreSaidAndAnotherIteration) {
  const Words bodies{"--form", "bodies", "--solver", "si", "--json", "-"};
  const auto with = [&](const Words& more) {
    Words words = bodies;
    words.insert(words.end(), more.begin(), more.end());
    return solve(words);
  };
  const Json plain = Json::parse(with({}).out), pairs = Json::parse(with({"--blocks", "pairs"}).out);
  EXPECT_FALSE(plain.contains("blocks"));
  EXPECT_EQ(pairs["blocks"], "pairs");
  EXPECT_EQ(pairs["unconverged"], 0);
  EXPECT_NE(pairs["hash"], plain["hash"]);
  EXPECT_EQ(Json::parse(with({"--blocks", "pairs", "--device", "emulated"}).out)["hash"], pairs["hash"]);
  EXPECT_THAT(with({"--blocks", "strong"}).err, testing::HasSubstr("choose --blocks pairs --solver si"));
  EXPECT_THAT(solve({"--blocks", "pairs", "--form", "bodies"}).err,
              testing::HasSubstr("choose --blocks pairs --solver si"));
}

TEST_F(Sweeps, StepsInBlocksAreSaidAndAnotherIteration) {
  const auto step = [&](const Words& more) {
    Words words{"step", "stack", "--envs", "2", "--steps", "30", "--json", "-"};
    words.insert(words.end(), more.begin(), more.end());
    return run_stiction(words);
  };
  const Json plain = Json::parse(step({}).out), pairs = Json::parse(step({"--blocks", "pairs"}).out);
  EXPECT_FALSE(plain.contains("blocks"));
  EXPECT_EQ(pairs["blocks"], "pairs");
  EXPECT_NE(pairs["hash"], plain["hash"]);
  EXPECT_EQ(Json::parse(step({"--blocks", "pairs", "--device", "emulated"}).out)["hash"], pairs["hash"]);
  EXPECT_THAT(step({"--blocks", "pairs", "--solver", "newton"}).err, testing::HasSubstr("blocks are of sweeps"));
  const Words kept{"--blocks", "pairs", "--checkpoint", folder_ / "run.h5"};
  EXPECT_EQ(step(kept).status, 0);
  EXPECT_THAT(step({"--checkpoint", folder_ / "run.h5"}).err, testing::HasSubstr("blocks"));
}

TEST_F(Sweeps, WhatIsNotReproducibleSaysSo) {
  const Words bodies{"--form", "bodies", "--solver", "si", "--law", "convex", "--device", "cpu", "--json", "-"};
  Words asynchronous = bodies;
  asynchronous.emplace_back("--asynchronous");
  const Json json = Json::parse(solve(asynchronous).out), plain = Json::parse(solve(bodies).out);
  EXPECT_EQ(json["asynchronous"], true);
  EXPECT_EQ(json["reproducible"], false);
  EXPECT_FALSE(plain.contains("reproducible"));
  EXPECT_EQ(json["hash"], plain["hash"]) << "small environments keep their bits";
  const auto error_of = [&](const Words& more) {
    Words words = asynchronous;
    words.insert(words.end(), more.begin(), more.end());
    const Finished refused = solve(words);
    EXPECT_EQ(refused.status, 2);
    return refused.err;
  };
  EXPECT_THAT(error_of({"--shard", "0/2"}), testing::HasSubstr("--asynchronous and --shard exclude one another"));
  EXPECT_THAT(solve({"--asynchronous"}).err, testing::HasSubstr("choose --form bodies --solver si"));
  EXPECT_THAT(
      solve({"--form", "bodies", "--solver", "si", "--law", "coulomb", "--device", "cpu", "--asynchronous"}).err,
      testing::HasSubstr("asynchronous = true with law = coulomb"));
}

}  // namespace

}  // namespace stiction::test
