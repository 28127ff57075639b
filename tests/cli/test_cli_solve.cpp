#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <iomanip>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "stiction/hash.hpp"
#include "stiction/solver.hpp"
#include "tests/cli/batches.hpp"
#include "tests/cli/process.hpp"

namespace stiction::test {
namespace {

using Json = nlohmann::ordered_json;
using Words = std::vector<std::string>;

class Solve : public testing::Test {
 protected:
  Finished solve(const Words& more) {
    Words words{"solve", batch_};
    words.insert(words.end(), more.begin(), more.end());
    return run_stiction(words);
  }

  Json report(const Words& more) {
    Words words = more;
    words.insert(words.end(), {"--json", "-"});
    return Json::parse(solve(words).out);
  }

  Folder folder_;
  io::Recording recording_ = chain_recording(40);
  std::string batch_ = write_batch(folder_ / "batch.h5", recording_);
};

Words keys(const Json& json) {
  Words names;
  for (const auto& item : json.items()) names.push_back(item.key());
  return names;
}

TEST_F(Solve, TheReportHasTheAgreedKeys) {
  const Json json = report({});
  EXPECT_EQ(keys(json), (Words{"schema_version",
                               "device",
                               "solver",
                               "precision",
                               "law",
                               "environments",
                               "rows",
                               "cones",
                               "threads",
                               "seconds",
                               "thread_use",
                               "gpu_utilisation",
                               "gpu_utilisation_reason",
                               "iterations",
                               "residual",
                               "flags",
                               "answered",
                               "unconverged",
                               "hash",
                               "epoch"}));
  EXPECT_EQ(keys(json["seconds"]), (Words{"load", "plan", "solve"}));
  for (const char* spread : {"iterations", "residual"}) {
    EXPECT_EQ(keys(json[spread]), (Words{"min", "median", "p90", "max"}));
  }
  EXPECT_EQ(json["flags"].size(), static_cast<std::size_t>(kEnvFlagCount));
  EXPECT_EQ(json["schema_version"], 2);
  EXPECT_EQ(json["environments"], 40);
  EXPECT_EQ(json["rows"], recording_.batch.row_count());
  EXPECT_EQ(json["cones"], recording_.batch.row_count() / 3);
  EXPECT_EQ(json["law"], "convex");
  EXPECT_EQ(json["precision"], "f64");
  EXPECT_EQ(json["unconverged"], 0);
  EXPECT_LE(json["residual"]["max"].get<double>(), 1e-4);
}

TEST_F(Solve, TheTableSaysTheSameAsTheReport) {
  const Finished finished = solve({"--json", folder_ / "report.json"});
  ASSERT_EQ(finished.status, 0) << finished.err;
  const Json json = Json::parse(read_text(folder_ / "report.json"));
  EXPECT_EQ(field(finished.out, "environments"), "40");
  EXPECT_EQ(field(finished.out, "hash").substr(0, 16), json["hash"].get<std::string>());
  EXPECT_EQ(field(finished.out, "unconverged"), "0");
  EXPECT_EQ(field(finished.out, "ended"), "40 solved");
  EXPECT_EQ(field(finished.out, "flags"), "none");
  EXPECT_EQ(finished.err, "") << "nothing is drawn where stderr is no terminal";
}

TEST_F(Solve, QuietSaysNothing) {
  const Finished finished = solve({"--quiet"});
  EXPECT_EQ(finished.status, 0);
  EXPECT_EQ(finished.out + finished.err, "");
}

TEST_F(Solve, TheHashIsThatOfTheFileAndOfTheLibrary) {
  for (const char* precision : {"f32", "f64"}) {
    const std::string solution = folder_ / "solution.h5";
    const Json json = report({"--precision", precision, "-o", solution});
    EXPECT_EQ(run_stiction({"hash", solution}).out, json["hash"].get<std::string>() + "\n") << precision;
  }
  const Solution<double> solution = stiction::solve(recording_.batch);
  std::ostringstream hex;
  hex << std::hex << std::setw(16) << std::setfill('0') << hash_bits(std::span<const double>(solution.lambda));
  EXPECT_EQ(report({"--max-iterations", "1000", "--tolerance", "1e-4"})["hash"], hex.str());
}

TEST_F(Solve, OrderAndThreadsDoNotReachTheHash) {
  for (const char* precision : {"f32", "f64"}) {
    const Json plain = report({"--precision", precision});
    for (const Words& more : {Words{"--permute", "1"}, Words{"--permute", "2"}, Words{"--permute", "3"},
                              Words{"--threads", "1"}, Words{"--threads", "2", "--permute", "9"}}) {
      Words words = more;
      words.insert(words.end(), {"--precision", precision});
      const Json other = report(words);
      EXPECT_EQ(other["hash"], plain["hash"]) << more.front() << " " << more.back();
      EXPECT_EQ(other["iterations"], plain["iterations"]);
    }
  }
}

TEST_F(Solve, APermutedSolutionIsWrittenInFileOrder) {
  solve({"-o", folder_ / "a.h5"});
  solve({"-o", folder_ / "b.h5", "--permute", "5"});
  EXPECT_EQ(run_stiction({"diff", folder_ / "a.h5", folder_ / "b.h5"}).status, 0);
  const io::SolutionFile a = io::read_solution(folder_ / "a.h5");
  const io::SolutionFile b = io::read_solution(folder_ / "b.h5");
  EXPECT_EQ(a.w, b.w);
  ASSERT_EQ(a.status.size(), 40U);
  for (std::size_t env = 0; env < 40; ++env) {
    EXPECT_EQ(a.status[env].iterations, b.status[env].iterations);
    EXPECT_EQ(a.status[env].residual, b.status[env].residual);
  }
}

TEST_F(Solve, AnEnvironmentThatMissesTheToleranceGivesExitStatusOne) {
  const Finished finished = solve({"--max-iterations", "1", "--tolerance", "1e-14"});
  EXPECT_EQ(finished.status, 1);
  EXPECT_NE(field(finished.out, "unconverged"), "0");
  EXPECT_NE(field(finished.out, "ended").find("max_iterations"), std::string::npos);
}

TEST_F(Solve, TheLawCanBeOverridden) {
  EXPECT_EQ(report({"--law", "coulomb"})["law"], "coulomb");
  solve({"--law", "coulomb", "--tolerance", "1e-10", "--max-iterations", "10000", "-o", folder_ / "s.h5"});
  EXPECT_EQ(run_stiction({"verify", batch_, folder_ / "s.h5", "--law", "coulomb"}).status, 0);
  const Finished by_file_law = run_stiction({"verify", batch_, folder_ / "s.h5"});
  EXPECT_NE(by_file_law.err.find("was solved with law coulomb"), std::string::npos);
}

TEST_F(Solve, AWarmStartFromTheSolutionNeedsFewerIterations) {
  const Json cold = report({"--tolerance", "1e-9", "-o", folder_ / "s.h5"});
  const Json warm = report({"--tolerance", "1e-9", "--warm-start", folder_ / "s.h5", "--permute", "4"});
  EXPECT_LT(warm["iterations"]["max"].get<int>(), cold["iterations"]["min"].get<int>());
  EXPECT_EQ(warm["unconverged"], 0);
}

TEST_F(Solve, APoisonedEnvironmentIsIsolatedAndChangesNoOther) {
  auto arrays = recording_.batch.arrays();
  const auto poisoned_row = static_cast<std::size_t>(arrays.env_row_offsets[7]);
  arrays.b[poisoned_row] = std::numeric_limits<double>::quiet_NaN();
  const std::string poisoned = write_batch(folder_ / "poisoned.h5", with_arrays(recording_, std::move(arrays)));
  const Finished finished =
      run_stiction({"solve", poisoned, "--isolate", "-o", folder_ / "p.h5", "--json", folder_ / "p.json"});
  EXPECT_EQ(finished.status, 1);
  const Json json = Json::parse(read_text(folder_ / "p.json"));
  EXPECT_EQ(json["unconverged"], 1);
  EXPECT_EQ(json["flags"]["non_finite_input"], 1);
  solve({"-o", folder_ / "clean.h5"});
  std::istringstream clean(run_stiction({"hash", folder_ / "clean.h5", "--per-environment"}).out);
  std::istringstream other(run_stiction({"hash", folder_ / "p.h5", "--per-environment"}).out);
  std::string clean_line, other_line;
  int env = 0;
  for (; env < 40 && std::getline(clean, clean_line) && std::getline(other, other_line); ++env) {
    EXPECT_EQ(clean_line == other_line, env != 7) << clean_line << " and " << other_line;
  }
  EXPECT_EQ(env, 40);
}

TEST_F(Solve, TheConvergenceFallsAndEndsAtTheIterationLimit) {
  ASSERT_EQ(solve({"--convergence", folder_ / "t.csv", "--max-iterations", "20"}).status, 0);
  std::istringstream csv(read_text(folder_ / "t.csv"));
  std::string line;
  std::getline(csv, line);
  EXPECT_EQ(line, "iteration,median,p90,max");
  std::vector<int> iterations;
  std::vector<double> worst;
  while (std::getline(csv, line)) {
    iterations.push_back(std::stoi(line));
    worst.push_back(std::stod(line.substr(line.rfind(',') + 1)));
  }
  EXPECT_EQ(iterations, (std::vector<int>{1, 2, 3, 4, 6, 8, 12, 16, 20}));
  EXPECT_LT(worst.back(), worst.front());
}

TEST_F(Solve, TheConvergenceIsWhatVerifySaysOfAShorterRun) {
  solve({"--convergence", folder_ / "t.csv", "--max-iterations", "4"});
  solve({"--tolerance", "0", "--max-iterations", "3", "-o", folder_ / "s.h5"});
  const Json verdict = Json::parse(run_stiction({"verify", batch_, folder_ / "s.h5", "--json"}).out);
  const std::string csv = read_text(folder_ / "t.csv");
  const std::size_t line = csv.find("\n3,") + 1;
  const double traced = std::stod(csv.substr(csv.rfind(',', csv.find('\n', line)) + 1));
  EXPECT_NEAR(traced, verdict["residual"]["max"].get<double>(), 1e-6 * traced) << "seven digits are printed";
}

TEST_F(Solve, RepeatedSolvesAreSoManyOfTheSameAndTheShortestIsReported) {
  const Json json = report({"--repeat", "3", "--trace", folder_ / "t.json"});
  EXPECT_EQ(json["hash"], report({})["hash"]);
  EXPECT_EQ(json["environments"], 40) << "not counted three times";
  std::vector<double> microseconds;
  for (const Json& event : Json::parse(read_text(folder_ / "t.json")))
    if (event["name"] == "solve") microseconds.push_back(event["dur"]);
  ASSERT_EQ(microseconds.size(), 3U);
  // The report has the answer's memory around each solve, which the trace does not have.
  EXPECT_GE(1e6 * json["seconds"]["solve"].get<double>(), *std::min_element(microseconds.begin(), microseconds.end()));
}

TEST_F(Solve, TheTraceIsAChromeTraceOfTheSolve) {
  for (const std::string device : {"cpu", "emulated"}) {
    ASSERT_EQ(
        solve({"--trace", folder_ / "t.json", "--device", device, "--threads", "2", "-o", folder_ / "s.h5"}).status, 0);
    const Json trace = Json::parse(read_text(folder_ / "t.json"));
    ASSERT_TRUE(trace.is_array());
    std::set<std::string> names;
    std::int64_t environments = 0;
    for (const Json& event : trace) {
      EXPECT_EQ(event["ph"], "X");
      for (const char* number : {"ts", "dur", "pid", "tid"}) EXPECT_TRUE(event[number].is_number()) << event;
      EXPECT_GE(event["dur"], 0);
      names.insert(event["name"]);
      if (event["name"] == "pack" || event["name"] == "one by one") {
        environments += event["args"]["environments"].get<std::int64_t>();
        EXPECT_LT(event["tid"], 2);
      }
    }
    for (const char* name : {"load", "plan", "solve", "write"}) EXPECT_EQ(names.count(name), 1U) << name;
    for (const char* name : {"upload", "download", "thread_small"})
      EXPECT_EQ(names.count(name), device == "cpu" ? 0U : 1U);
    EXPECT_EQ(environments, device == "cpu" ? 40 : 0);
  }
}

TEST(SolveIslands, ApartIsSaidAndIsAnotherIteration) {
  const Folder folder;
  const std::string batch = write_batch(folder / "islands.h5", island_recording(12));
  const auto solve = [&](const Words& more) {
    Words words{"solve", batch};
    words.insert(words.end(), more.begin(), more.end());
    return run_stiction(words);
  };
  const Json apart = Json::parse(solve({"--islands", "apart", "--json", "-", "--tolerance", "1e-6"}).out);
  const Json together = Json::parse(solve({"--islands", "together", "--json", "-", "--tolerance", "1e-6"}).out);
  EXPECT_EQ(apart["islands"], "apart");
  EXPECT_FALSE(together.contains("islands") || together.contains("islands_apart"));
  EXPECT_EQ(apart["islands_apart"], (Json{{"min", 2}, {"median", 2}, {"p90", 2}, {"max", 2}}));
  EXPECT_NE(apart["hash"], together["hash"]);
  EXPECT_EQ(apart["unconverged"], 0);
  const Finished said = solve({"--islands", "apart", "--tolerance", "1e-6", "-o", folder / "s.h5", "--permute", "3"});
  EXPECT_EQ(field(said.out, "islands"), "apart");
  EXPECT_EQ(field(said.out, "islands apart"), "min 2  median 2  p90 2  max 2");
  for (const EnvStatus& status : io::read_solution(folder / "s.h5").status) EXPECT_EQ(status.islands, 2);
  EXPECT_EQ(field(said.out, "hash").substr(0, 16), apart["hash"].get<std::string>());
  EXPECT_EQ(run_stiction({"verify", batch, folder / "s.h5", "--tolerance", "1.000001e-6"}).status, 0);
  EXPECT_EQ(Json::parse(run_stiction({"inspect", batch, "--json"}).out)["islands"]["min"], 2);
  EXPECT_EQ(solve({"--islands", "adrift"}).status, 2);
  EXPECT_NE(solve({"--islands", "adrift"}).err.find("together, apart"), std::string::npos);
}

TEST_F(Solve, JAndMOfTheFileAreSolvedWithoutA) {
  const std::string robot = STICTION_EXAMPLES_DIR "/data/humanoid.h5";
  const std::string solution = folder_ / "solution.h5";
  const auto report_of = [&](Words more) {
    more.insert(more.begin(), {"solve", robot, "--form", "jacobian", "--tolerance", "1e-6", "--json", "-"});
    return Json::parse(run_stiction(more).out);
  };
  const Json json = report_of({"-o", solution});
  EXPECT_EQ(json["form"], "jacobian");
  EXPECT_EQ(json["solver"], "auto");
  EXPECT_EQ(json["answered"], (Json{{"velocity_newton", json["environments"]}}));
  EXPECT_EQ(json["unconverged"], 0);
  // The judge has the file's A, not ours.
  EXPECT_EQ(run_stiction({"verify", robot, solution, "--tolerance", "2e-6"}).status, 0);
  EXPECT_EQ(report_of({"--permute", "3"})["hash"], json["hash"]);
  EXPECT_EQ(report_of({"--device", "emulated"})["hash"], json["hash"]);
  EXPECT_LT(report_of({"--warm-start", solution})["iterations"]["max"], json["iterations"]["max"]);
  const Json sweeps = report_of({"--solver", "npgs", "--max-iterations", "20000"});
  EXPECT_EQ(sweeps["answered"], (Json{{"npgs", json["environments"]}}));
}

TEST_F(Solve, WhatHasNoJAndMOrIsOfAIsRefusedInThatForm) {
  EXPECT_THAT(solve({"--form", "jacobian"}).err,
              testing::HasSubstr("batch.h5: the recording has no J and M with v_free: solve it by its matrix A"));
  EXPECT_THAT(solve({"--form", "dense"}).err, testing::HasSubstr("--form dense: expected matrix, jacobian or bodies"));
  for (const Words& other :
       {Words{"--pyramid", "4"}, Words{"--record", folder_ / "r.h5"}, Words{"--convergence", folder_ / "c.csv"}}) {
    const Finished refused = solve({"--form", "jacobian", other[0], other[1]});
    EXPECT_EQ(refused.status, 2);
    EXPECT_THAT(refused.err, testing::HasSubstr("--form jacobian and " + other[0] + " exclude one another"));
  }
}

TEST_F(Solve, BodiesOfJAndMAreSolvedByWhatSolvesBodies) {
  const std::string wall = folder_ / "wall.h5", solution = folder_ / "solution.h5";
  ASSERT_EQ(run_stiction({"generate", "stack", "--envs", "2", "--size", "4", "--seed", "5", "-o", wall}).status, 0);
  const auto report_of = [&](Words more) {
    // Without momentum a stack takes ten times the sweeps.
    const bool is_plain = std::find(more.begin(), more.end(), "pgs") != more.end();
    const std::string iterations = is_plain ? "50000" : "5000";
    more.insert(more.begin(), {"solve", wall, "--form", "bodies", "--law", "convex", "--tolerance", "1e-5",
                               "--max-iterations", iterations, "--json", "-"});
    return Json::parse(run_stiction(more).out);
  };
  for (const char* solver : {"si", "pgs", "newton", "multigrid"}) {
    const Json json = report_of({"--solver", solver, "-o", solution});
    EXPECT_EQ(json["form"], "bodies");
    EXPECT_EQ(json["solver"], solver);
    EXPECT_EQ(json["unconverged"], 0) << solver;
    EXPECT_EQ(json.contains("preconditioner"), std::string(solver) == "newton");
    // The judge has the file's A; residuals are relative to a number that depends on tangents.
    EXPECT_EQ(run_stiction({"verify", wall, solution, "--law", "convex", "--tolerance", "1.42e-5"}).status, 0);
    EXPECT_EQ(report_of({"--solver", solver, "--permute", "3"})["hash"], json["hash"]);
    EXPECT_EQ(report_of({"--solver", solver, "--warm-start", solution})["unconverged"], 0);
  }
  // Sequential impulses are npgs on bodies, and pgs is without momentum.
  EXPECT_EQ(report_of({"--solver", "npgs"})["hash"], report_of({"--solver", "si"})["hash"]);
  EXPECT_NE(report_of({"--solver", "pgs"})["hash"], report_of({"--solver", "si"})["hash"]);
  EXPECT_EQ(report_of({"--preconditioner", "factor"})["preconditioner"], "factor");
  const auto error_of = [&](const Words& more) {
    Words words{"solve", wall, "--form", "bodies"};
    words.insert(words.end(), more.begin(), more.end());
    const Finished refused = run_stiction(words);
    EXPECT_EQ(refused.status, 2);
    return refused.err;
  };
  EXPECT_THAT(error_of({"--solver", "nsgs"}),
              testing::HasSubstr("--solver nsgs: expected si, npgs, pgs, newton or multigrid"));
  EXPECT_THAT(error_of({"--solver", "si", "--preconditioner", "factor"}), testing::HasSubstr("choose --solver newton"));
  EXPECT_THAT(error_of({"--preset", "grasping"}), testing::HasSubstr("--form bodies and --preset exclude"));
  EXPECT_THAT(error_of({"--islands", "apart"}), testing::HasSubstr("--form bodies and --islands apart exclude"));
  const std::string robot = STICTION_EXAMPLES_DIR "/data/humanoid.h5";
  const Finished jointed = run_stiction({"solve", robot, "--form", "bodies"});
  EXPECT_EQ(jointed.status, 2);
  EXPECT_THAT(jointed.err, testing::HasSubstr("environment 0: "));
  EXPECT_THAT(jointed.err, testing::HasSubstr("as_bodies() takes free rigid bodies"));
}

TEST_F(Solve, PyramidsAreSolvedByPivotingAndWrittenInTheRowsOfTheCones) {
  double before = std::numeric_limits<double>::infinity();
  for (const char* sides : {"4", "8", "16"}) {
    const Json json = report({"--solver", "lemke", "--pyramid", sides, "--tolerance", "1e-10", "-o", folder_ / "s.h5"});
    EXPECT_EQ(json["pyramid"], std::stoi(sides));
    EXPECT_EQ(json["law"], "convex");
    EXPECT_EQ(json["rows"], recording_.batch.row_count());
    EXPECT_EQ(json["unconverged"], 0);
    EXPECT_LE(json["residual"]["max"].get<double>(), 1e-10);
    const Json verdict = Json::parse(run_stiction({"verify", batch_, folder_ / "s.h5", "--json"}).out);
    const double off = verdict["residual"]["max"].get<double>();
    EXPECT_GT(off, 1e-10) << "the cones are not the pyramids";
    EXPECT_LT(off, 0.6 * before) << "and the pyramids come closer";
    before = off;
  }
  EXPECT_EQ(report({"--solver", "lemke"})["flags"]["unsupported_cone"], 40);
}

TEST_F(Solve, PyramidsOfACoulombFileAreSolvedUnderTheConvexLawAndSaySo) {
  const Finished finished = solve({"--law", "coulomb", "--pyramid", "8", "--tolerance", "1e-3"});
  EXPECT_EQ(field(finished.out, "law"), "convex");
  EXPECT_NE(field(finished.out, "pyramid").find("8 sides"), std::string::npos);
}

TEST(SolveEdge, ABatchWithoutEnvironmentsIsSolved) {
  const Folder folder;
  const std::string batch = write_batch(folder / "none.h5", chain_recording(0));
  const Finished finished = run_stiction({"solve", batch, "-o", folder / "s.h5", "--json", folder / "r.json"});
  EXPECT_EQ(finished.status, 0) << finished.err;
  EXPECT_TRUE(Json::parse(read_text(folder / "r.json"))["residual"]["max"].is_null());
  EXPECT_EQ(run_stiction({"verify", batch, folder / "s.h5"}).status, 0);
  EXPECT_EQ(run_stiction({"inspect", batch}).status, 0);
}

TEST(SolveEdge, ASharedFileIsSolvedAndVerified) {
  const std::string shared = STICTION_SHARED_DIR;
  const std::string batch = shared + "/data/mujoco/go1.h5";
  if (!std::filesystem::exists(batch)) GTEST_SKIP() << "no shared data at " << shared;
  const Folder folder;
  const Finished finished =
      run_stiction({"solve", batch, "--tolerance", "1e-6", "--max-iterations", "20000", "-o", folder / "s.h5"});
  EXPECT_EQ(finished.status, 0) << finished.out << finished.err;
  EXPECT_EQ(run_stiction({"verify", batch, folder / "s.h5"}).status, 0);
}

}  // namespace
}  // namespace stiction::test
