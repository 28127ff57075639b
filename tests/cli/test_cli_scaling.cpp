// stiction scaling, and reports of solve and step on their threads.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "cli/scaling_report.hpp"
#include "cli/thread_use.hpp"
#include "tests/cli/batches.hpp"
#include "tests/cli/process.hpp"

namespace stiction::test {
namespace {

using cli::Json;
using testing::HasSubstr;

cli::ScalingPoint point(int threads, std::int64_t environments, double seconds, std::uint64_t hash = 7) {
  return {threads, environments, seconds, {}, hash};
}

TEST(Scaling, SpeedUpAndEfficiencyOfNumbersThatOneCanWorkOut) {
  // Strong: 8 s on 2 threads are 4 s on 4, which is perfect. They are 2 s on 16, which is half.
  const cli::ScalingSeries strong{{point(2, 100, 8), point(4, 100, 4), point(16, 100, 2)}};
  EXPECT_DOUBLE_EQ(strong.speedup(strong.points[0]).value_or(-1), 1);
  EXPECT_DOUBLE_EQ(strong.efficiency(strong.points[0]).value_or(-1), 1);
  EXPECT_DOUBLE_EQ(strong.speedup(strong.points[1]).value_or(-1), 2);
  EXPECT_DOUBLE_EQ(strong.efficiency(strong.points[1]).value_or(-1), 1);
  EXPECT_DOUBLE_EQ(strong.speedup(strong.points[2]).value_or(-1), 4);
  EXPECT_DOUBLE_EQ(strong.efficiency(strong.points[2]).value_or(-1), 0.5);
  // Weak: three times the work on three threads in 4 s where one thread took 3 s.
  const cli::ScalingSeries weak{{point(1, 100, 3), point(3, 300, 4)}};
  EXPECT_DOUBLE_EQ(weak.speedup(weak.points[1]).value_or(-1), 2.25);
  EXPECT_DOUBLE_EQ(weak.efficiency(weak.points[1]).value_or(-1), 0.75);
  const cli::ScalingSeries nothing{{point(1, 0, 0)}};
  EXPECT_FALSE(nothing.speedup(nothing.points[0]));
  EXPECT_FALSE(nothing.efficiency(nothing.points[0]));
  cli::ScalingPoint half = point(1, 1, 4);
  half.use.seconds = 3;
  EXPECT_DOUBLE_EQ(cli::serial_share(half).value_or(-1), 0.25);
}

TEST(Scaling, OtherBitsAreFoundInEitherSeries) {
  cli::ScalingReport report;
  report.strong.points = {point(1, 4, 1), point(2, 4, 1)};
  report.weak.emplace();
  report.weak->points = {point(1, 4, 1), point(2, 8, 1)};
  EXPECT_TRUE(report.bits_agree());
  EXPECT_THAT(to_text(report), HasSubstr("equal for every number of threads"));
  report.weak->points[1].hash = 8;
  EXPECT_FALSE(report.bits_agree());
  EXPECT_THAT(to_text(report), HasSubstr("DIFFER"));
  EXPECT_EQ(Json::parse(to_json(report))["bits_agree"], false);
  report.weak.reset();
  EXPECT_TRUE(report.bits_agree());
  report.strong.points[1].hash = 8;
  EXPECT_FALSE(report.bits_agree());
}

TEST(Scaling, ThreadUseIsNullWithoutSections) {
  EXPECT_TRUE(cli::json_of(ThreadUse{}).is_null());
  const ThreadUse use{2, 4, {2, 1}};
  const Json json = cli::json_of(use);
  EXPECT_EQ(json["seconds"], 2);
  EXPECT_EQ(json["busy"], (std::vector<double>{2, 1}));
  EXPECT_DOUBLE_EQ(json["synchronisation_share"].get<double>(), 0.25);
  EXPECT_DOUBLE_EQ(json["imbalance"].get<double>(), 4 / 3.0);
}

Json report_of(std::vector<std::string> arguments) {
  arguments.insert(arguments.end(), {"--json", "-"});
  const Finished run = run_stiction(arguments);
  EXPECT_EQ(run.status, 0) << run.err;
  return Json::parse(run.out);
}

void expect_series(const Json& series, std::int64_t environments, bool is_weak) {
  ASSERT_EQ(series.size(), 3U);
  for (std::size_t k = 0; k < 3; ++k) {
    const auto threads = static_cast<std::int64_t>(k) + 1;
    EXPECT_EQ(series[k]["threads"], threads);
    EXPECT_EQ(series[k]["environments"], is_weak ? threads * environments : environments);
    EXPECT_EQ(series[k]["thread_use"]["busy"].size(), k + 1);
    EXPECT_EQ(series[k]["hash"], series[0]["hash"]);
  }
}

TEST(Scaling, AFileIsSolvedWithTheBitsOfSolve) {
  const Folder folder;
  const std::string batch = write_batch(folder / "batch.h5", chain_recording(60));
  for (const char* precision : {"f32", "f64"}) {
    const Json report =
        report_of({"scaling", batch, "--threads", "3,1,2", "--weak", "--repeat", "2", "--precision", precision});
    EXPECT_EQ(report["file"], batch);
    EXPECT_EQ(report["hash"], report_of({"solve", batch, "--precision", precision})["hash"]);
    EXPECT_EQ(report["bits_agree"], true);
    expect_series(report["strong"], 60, false);
    expect_series(report["weak"], 60, true);
  }
  EXPECT_FALSE(report_of({"scaling", batch, "--threads", "1", "--repeat", "1"}).contains("weak"));
}

TEST(Scaling, ASceneIsSteppedWithTheBitsOfStep) {
  const Json report = report_of({"scaling", "pile", "--envs", "9", "--steps", "12", "--seed", "4", "--threads", "1,2,3",
                                 "--weak", "--repeat", "1"});
  const Json step = report_of({"step", "pile", "--envs", "9", "--steps", "12", "--seed", "4"});
  EXPECT_EQ(report["scene"], "pile");
  EXPECT_EQ(report["solver"], "si");
  EXPECT_EQ(report["hash"], step["hash"]);
  expect_series(report["strong"], 9, false);
  expect_series(report["weak"], 9, true);
}

TEST(Scaling, PrintsATable) {
  const Finished run = run_stiction({"scaling", "slide", "--envs", "4", "--steps", "2", "--threads", "1,2"});
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("Strong scaling"));
  EXPECT_THAT(run.out, testing::Not(HasSubstr("Weak scaling")));
  EXPECT_THAT(run.out, HasSubstr("equal for every number of threads"));
}

TEST(Scaling, RefusesWhatItCannotRun) {
  const Finished none = run_stiction({"scaling", "nowhere.h5"});
  EXPECT_EQ(none.status, 2);
  EXPECT_THAT(none.err, HasSubstr("nowhere.h5: neither a file nor a scene of stiction step (pile, "));
  for (const auto& more : std::vector<std::vector<std::string>>{
           {"--threads", "0"}, {"--threads", "2,-1"}, {"--repeat", "0"}, {"--solver", "nonsense"}, {"--envs", "0"}}) {
    std::vector<std::string> arguments{"scaling", "pile"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Finished run = run_stiction(arguments);
    EXPECT_EQ(run.status, 2) << more[0] << ' ' << more[1];
    EXPECT_EQ(run.out, "");
  }
}

TEST(ThreadUseOfAReport, IsOfTheThreadsThatWereAskedFor) {
  const Folder folder;
  const std::string batch = write_batch(folder / "batch.h5", chain_recording(60));
  for (const char* threads : {"1", "3"}) {
    const std::size_t count = threads[0] == '1' ? 1 : 3;
    const Json solve = report_of({"solve", batch, "--threads", threads, "--repeat", "2"});
    const Json step = report_of({"step", "pile", "--envs", "6", "--steps", "4", "--threads", threads});
    for (const Json& report : {solve, step}) {
      EXPECT_EQ(report["threads"], count);
      const Json& use = report["thread_use"];
      ASSERT_EQ(use["busy"].size(), count);
      double work = 0;
      for (const double busy : use["busy"]) work += busy;
      EXPECT_GT(work, 0);
      EXPECT_GE(use["synchronisation_share"], 0);
      EXPECT_LT(use["synchronisation_share"], 1);
      EXPECT_GE(use["imbalance"].get<double>(), 1 - 1e-12);
      EXPECT_LE(use["imbalance"].get<double>(), static_cast<double>(count) + 1e-12);
    }
    EXPECT_LE(solve["thread_use"]["seconds"], solve["seconds"]["solve"]);
    EXPECT_LE(step["thread_use"]["seconds"], step["seconds"]["wall"]);
  }
  const Json emulated = report_of({"solve", batch, "--device", "emulated"});
  EXPECT_TRUE(emulated["threads"].is_null());
  EXPECT_TRUE(emulated["thread_use"].is_null());
}

TEST(ThreadUseOfAReport, IsInTheTableAndInTheTrace) {
  const Folder folder;
  const std::string batch = write_batch(folder / "batch.h5", chain_recording(60));
  const Finished run = run_stiction({"solve", batch, "--threads", "2", "--trace", folder / "trace.json"});
  EXPECT_THAT(field(run.out, "thread use"), HasSubstr("% waiting, imbalance "));
  int waits = 0;
  for (const Json& event : Json::parse(read_text(folder / "trace.json"))) waits += event["name"] == "wait" ? 1 : 0;
  EXPECT_GE(waits, 2) << "one of each thread in a section at least";
}

}  // namespace
}  // namespace stiction::test
