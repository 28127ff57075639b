// stiction step, as a user runs it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/cli/process.hpp"

namespace stiction::test {
namespace {

using Json = nlohmann::ordered_json;
using testing::HasSubstr;

Json report_of(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "step");
  arguments.insert(arguments.end(), {"--json", "-"});
  const Finished run = run_stiction(arguments);
  EXPECT_EQ(run.status, 0) << run.err;
  return Json::parse(run.out);
}

}  // namespace

TEST(Step, ReportsWhatItDid) {
  const Json report = report_of({"pile", "--envs", "3", "--steps", "90", "--seed", "2"});
  EXPECT_EQ(report["scene"], "pile");
  EXPECT_EQ(report["environments"], 3);
  EXPECT_EQ(report["steps"], 90);
  EXPECT_EQ(report["bodies"], 12);
  EXPECT_GT(report["sps"], 0);
  EXPECT_GT(report["contacts"], 0);
  const double quality = report["quality"];
  EXPECT_GT(quality, 0);
  EXPECT_LE(quality, 1);
  EXPECT_DOUBLE_EQ(report["effective_sps"].get<double>(), report["sps"].get<double>() * quality);
  EXPECT_LE(report["solver_share"], 1);
  std::int64_t ended = 0;
  for (const auto& [code, count] : report["ended"].items()) ended += count.get<std::int64_t>();
  EXPECT_EQ(ended, 3 * 90);
  EXPECT_LT(report["energy"]["end"], report["energy"]["begin"]);
  EXPECT_LT(report["momentum_drift"], 1e-9);
  EXPECT_EQ(report["thread_use"]["busy"].size(), report["threads"]);
}

TEST(Step, TheHashIsThatOfScenePrecisionSeedAndStepsAlone) {
  const std::vector<std::string> base{"walker", "--envs", "5", "--steps", "40"};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.begin(), base.begin(), base.end());
    return report_of(more)["hash"].get<std::string>();
  };
  const std::string hash = with({});
  EXPECT_EQ(with({"--threads", "1"}), hash);
  EXPECT_EQ(with({"--device", "emulated"}), hash);
  EXPECT_NE(with({"--seed", "1"}), hash);
  EXPECT_NE(with({"--precision", "f32"}), hash);
  EXPECT_NE(with({"--dt", "0.003"}), hash);
}

TEST(Step, QualityFallsWithTheResidual) {
  const auto quality = [](const char* sweeps) {
    return report_of({"stack", "--envs", "1", "--steps", "30", "--iterations", sweeps, "--warm-start", "0"})["quality"]
        .get<double>();
  };
  EXPECT_LT(quality("2"), 0.5 * quality("400"));
  EXPECT_EQ(quality("4000"), 1);
}

TEST(Step, NewtonsMethodReachesWhatSweepsDoNot) {
  const std::vector<std::string> base{"stack", "--envs",       "2", "--steps", "30", "--iterations",
                                      "60",    "--warm-start", "0"};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.begin(), base.begin(), base.end());
    return report_of(more);
  };
  const Json sweeps = with({}), multigrid = with({"--solver", "multigrid"});
  EXPECT_EQ(sweeps["solver"], "si");
  EXPECT_EQ(with({"--solver", "npgs"})["hash"], sweeps["hash"]);
  EXPECT_NE(with({"--solver", "pgs"})["hash"], sweeps["hash"]);
  EXPECT_EQ(multigrid["solver"], "multigrid");
  EXPECT_LT(sweeps["quality"], multigrid["quality"]);
  EXPECT_EQ(multigrid["quality"], 1);
  const Json named = with({"--solver", "newton", "--preconditioner", "multigrid"});
  EXPECT_EQ(named["preconditioner"], "multigrid");
  EXPECT_EQ(named["hash"], multigrid["hash"]);
  EXPECT_EQ(with({"--solver", "newton"})["preconditioner"], "block_diagonal");
  EXPECT_EQ(run_stiction({"step", "stack", "--envs", "1", "--solver", "nonsense"}).status, 2);
  EXPECT_EQ(run_stiction({"step", "stack", "--envs", "1", "--preconditioner", "factor"}).status, 2);
}

TEST(Step, TheLawOfContactsIsAnOption) {
  const auto with = [](std::vector<std::string> more) {
    more.insert(more.begin(), {"pile", "--envs", "2", "--steps", "80"});
    return report_of(more);
  };
  const Json plain = with({}), boxed = with({"--law", "boxed"});
  EXPECT_EQ(plain["law"], "coulomb");
  EXPECT_EQ(boxed["law"], "boxed");
  EXPECT_EQ(with({"--law", "coulomb"})["hash"], plain["hash"]);
  EXPECT_NE(boxed["hash"], plain["hash"]);
  EXPECT_NE(with({"--law", "convex"})["hash"], plain["hash"]);
  EXPECT_EQ(with({"--law", "boxed", "--device", "emulated"})["hash"], boxed["hash"]);
  const Finished newton = run_stiction({"step", "stack", "--envs", "1", "--law", "boxed", "--solver", "multigrid"});
  EXPECT_EQ(newton.status, 2);
  EXPECT_THAT(newton.err, HasSubstr("choose --solver si"));
  EXPECT_EQ(run_stiction({"step", "stack", "--envs", "1", "--law", "ice"}).status, 2);
  const Folder folder;
  const std::string file = folder / "point.h5";
  const auto go_on = [&](const char* law) {
    return run_stiction(
        {"step", "slide", "--envs", "1", "--steps", "2", "--law", law, "--checkpoint", file, "--quiet"});
  };
  EXPECT_EQ(go_on("boxed").status, 0);
  EXPECT_EQ(go_on("boxed").status, 0);
  EXPECT_THAT(go_on("coulomb").err, HasSubstr("is of another run"));
}

TEST(Step, WritesStatesAsCsv) {
  const Folder folder;
  const std::string path = folder / "states.csv";
  const Finished run =
      run_stiction({"step", "bounce", "--envs", "2", "--steps", "20", "--every", "10", "-o", path, "--quiet"});
  EXPECT_EQ(run.status, 0);
  EXPECT_EQ(run.out, "");
  std::istringstream lines(read_text(path));
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line, "step,environment,body,x,y,z,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz");
  int count = 0;
  while (std::getline(lines, line)) {
    EXPECT_EQ(std::count(line.begin(), line.end(), ','), 15);
    ++count;
  }
  EXPECT_EQ(count, 3 * 2 * 3);  // steps 0, 10, 20; environments; balls
  EXPECT_THAT(line = read_text(path), HasSubstr("\n20,1,2,"));
}

TEST(Step, GoesOnFromItsCheckpointWithTheBitsOfARunWithoutAStop) {
  const Folder folder;
  const std::string file = folder / "point.h5";
  for (const char* precision : {"f32", "f64"}) {
    const std::string path = file + precision;
    const auto with = [&](const char* steps, std::vector<std::string> more) {
      const std::vector<std::string> base{"pile", "--envs", "3", "--steps", steps, "--precision", precision};
      more.insert(more.begin(), base.begin(), base.end());
      return report_of(more);
    };
    const Json whole = with("120", {});
    const Json first = with("70", {"--checkpoint", path, "--checkpoint-every", "20"});
    EXPECT_EQ(first["resumed_at"], 0);
    const Json second = with("120", {"--checkpoint", path, "--device", "emulated"});
    EXPECT_EQ(second["resumed_at"], 70);
    EXPECT_EQ(second["hash"], whole["hash"]);
    EXPECT_NE(second["hash"], first["hash"]);
    EXPECT_EQ(with("120", {"--checkpoint", path})["hash"], whole["hash"]) << "nothing is left to do";
  }
  const Finished other = run_stiction({"step", "pile", "--envs", "4", "--steps", "120", "--checkpoint", file + "f64"});
  EXPECT_EQ(other.status, 2);
  EXPECT_THAT(other.err, HasSubstr("is of another run: --envs is 3 in the file and 4 here; give what the file has"));
  const Finished scene = run_stiction({"step", "stack", "--envs", "3", "--seed", "7", "--size", "4", "--steps", "120",
                                       "--precision", "f64", "--checkpoint", file + "f64"});
  EXPECT_EQ(scene.status, 2);
  EXPECT_THAT(scene.err, HasSubstr("SCENE is pile in the file and stack here, --seed is 0 in the file and 7 here, "
                                   "--size is not given in the file and 4 here; "));
  const Finished fewer = run_stiction({"step", "pile", "--envs", "3", "--steps", "100", "--checkpoint", file + "f64"});
  EXPECT_EQ(fewer.status, 2);
  EXPECT_THAT(fewer.err, HasSubstr("ask for more steps"));
  EXPECT_EQ(run_stiction({"step", "pile", "--envs", "1", "--checkpoint", "/no/such/folder/c.h5"}).status, 2);
  write_text(folder / "text.h5", "no checkpoint");
  EXPECT_EQ(run_stiction({"step", "pile", "--envs", "1", "--checkpoint", folder / "text.h5"}).status, 2);
}

TEST(Step, CountsOverflows) {
  EXPECT_GT(report_of({"stack", "--envs", "2", "--steps", "20", "--max-contacts", "5"})["overflows"], 0);
}

TEST(Step, APileHasAsManyBodiesAsAreAskedFor) {
  const Json report = report_of({"pile", "--size", "2500", "--envs", "1", "--steps", "2"});
  EXPECT_EQ(report["bodies"], 2500);
  EXPECT_LT(report["momentum_drift"], 1e-6);
  const Json own = report_of({"pile", "--envs", "1", "--steps", "40"});
  EXPECT_EQ(report_of({"pile", "--size", "12", "--envs", "1", "--steps", "40"})["hash"], own["hash"]);
  const Finished refused = run_stiction({"step", "walker", "--size", "9"});
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, HasSubstr("scene 'walker' has no size"));
}

TEST(Step, ListsScenesAndRefusesOthers) {
  EXPECT_THAT(run_stiction({"step", "--list"}).out, HasSubstr("walker"));
  const Finished unknown = run_stiction({"step", "nonsense"});
  EXPECT_EQ(unknown.status, 2);
  EXPECT_THAT(unknown.err, HasSubstr("choose one of pile, walker, stack, bounce, slide"));
  EXPECT_EQ(unknown.out, "");
  EXPECT_EQ(run_stiction({"step"}).status, 2);
  EXPECT_EQ(run_stiction({"step", "pile", "--envs", "1", "--dt", "-1"}).status, 2);
  EXPECT_EQ(run_stiction({"step", "pile", "--envs", "1", "-o", "/no/such/folder/x.csv"}).status, 2);
}

}  // namespace stiction::test
