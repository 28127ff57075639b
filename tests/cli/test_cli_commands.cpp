// info, generate, inspect, verify, hash, diff and convert, as a user runs them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "stiction/config.hpp"
#include "tests/cli/batches.hpp"
#include "tests/cli/process.hpp"

namespace stiction::test {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

/// Returns true if the `dot` family is installed, asked without running it.
bool graphviz_is_there() {
  for (const char* folder : {"/usr/bin/", "/usr/local/bin/", "/bin/"}) {
    for (const char* program : {"fdp", "sfdp", "dot"}) {
      if (fs::exists(std::string(folder) + program)) return true;
    }
  }
  return false;
}

std::string write_solution(const std::string& path, std::vector<double> lambda, std::vector<Offset> offsets,
                           Precision precision = Precision::f64) {
  io::SolutionFile file;
  file.precision = precision;
  file.lambda = std::move(lambda);
  file.env_row_offsets = std::move(offsets);
  io::write_solution(path, file);
  return path;
}

TEST(Info, NamesTheVersionAndTheDevicesOrWhyNot) {
  const Json json = Json::parse(run_stiction({"info", "--json"}).out);
  EXPECT_EQ(json["version"], kVersion);
  EXPECT_EQ(json["epoch"], kNumericsEpoch);
  ASSERT_GE(json["devices"].size(), 1U);
  EXPECT_EQ(json["devices"][0]["device"], "cpu");
  for (const Json& device : json["devices"]) {
    EXPECT_NE(device["usable"].get<bool>(), !device["reason"].get<std::string>().empty());
  }
  const Finished text = run_stiction({"info"});
  EXPECT_EQ(text.status, 0);
  EXPECT_EQ(field(text.out, "stiction"), kVersion);
}

TEST(Generate, BoxedFrictionIsWrittenSolvedAndCounted) {
  const Folder folder;
  const std::string path = folder / "boxed.h5", solution = folder / "solution.h5";
  ASSERT_EQ(run_stiction({"generate", "stack", "--size", "2", "--envs", "3", "--box-friction", "-o", path}).status, 0);
  const Json seen = Json::parse(run_stiction({"inspect", path, "--json"}).out);
  EXPECT_EQ(seen["cones"]["box_friction"]["3"], 24);
  EXPECT_EQ(seen["cones"]["friction"]["3"], 0);
  EXPECT_NE(run_stiction({"inspect", path}).out.find("24 box_friction of 3 rows"), std::string::npos);
  EXPECT_EQ(run_stiction({"solve", path, "--tolerance", "1e-8", "-o", solution}).status, 0);
  EXPECT_EQ(run_stiction({"verify", path, solution, "--tolerance", "1e-8"}).status, 0);
  EXPECT_EQ(run_stiction({"solve", path, "--solver", "lemke", "--tolerance", "1e-8"}).status, 0);
  EXPECT_EQ(run_stiction({"solve", path, "--solver", "apgd"}).status, 1) << "another law's solver has no answer";
}

TEST(Generate, EverySceneIsAValidBatchWithItsOrigin) {
  const Folder folder;
  const Finished list = run_stiction({"generate", "--list"});
  ASSERT_EQ(list.status, 0);
  std::istringstream lines(list.out);
  int scenes = 0;
  for (std::string line; std::getline(lines, line); ++scenes) {
    const std::string scene = line.substr(0, line.find(' '));
    const std::string path = folder / (scene + ".h5");
    const Finished made = run_stiction({"generate", scene, "--envs", "3", "--seed", "5", "-o", path});
    ASSERT_EQ(made.status, 0) << scene << ": " << made.err;
    const io::Recording recording = io::read_batch(path);
    EXPECT_EQ(recording.batch.env_count(), 3) << scene;
    EXPECT_TRUE(validate(recording.batch.view()).empty()) << scene;
    EXPECT_EQ(recording.J.ptr.size(), static_cast<std::size_t>(recording.batch.row_count()) + 1) << scene;
    EXPECT_EQ(recording.v_free.size(), static_cast<std::size_t>(recording.env_dof_offsets.back())) << scene;
  }
  EXPECT_GE(scenes, 9);
}

TEST(Generate, TheSameSeedGivesTheSameFileWithAnyNumberOfThreads) {
  const Folder folder;
  for (const char* threads : {"1", "3"}) {
    run_stiction({"generate", "mixed", "--envs", "12", "--seed", "8", "--threads", threads, "-o",
                  folder / (std::string(threads) + ".h5")});
  }
  const auto one = io::read_batch(folder / "1.h5").batch.arrays();
  const auto three = io::read_batch(folder / "3.h5").batch.arrays();
  EXPECT_FALSE(one.A.empty());
  EXPECT_EQ(one.A, three.A);
  EXPECT_EQ(one.b, three.b);
  EXPECT_EQ(one.env_row_offsets, three.env_row_offsets);
}

TEST(Generate, AnotherSeedGivesAnotherFile) {
  const Folder folder;
  run_stiction({"generate", "stack", "--seed", "1", "-o", folder / "1.h5"});
  run_stiction({"generate", "stack", "--seed", "2", "-o", folder / "2.h5"});
  EXPECT_NE(io::read_batch(folder / "1.h5").batch.arrays().b, io::read_batch(folder / "2.h5").batch.arrays().b);
}

/// One environment: rows 0 and 1 unilateral and coupled, row 2 a single box row. A = [2 1 0; 1 2 0; 0 0 5]:
/// eigenvalues 1, 3, 5; two islands.
io::Recording hand_made() {
  Environment<double> environment;
  environment.cones = {{ConeKind::unilateral, 1, -1}, {ConeKind::unilateral, 1, -1}, {ConeKind::box, 1, -1}};
  environment.set_dense(std::vector<double>{2, 1, 0, 1, 2, 0, 0, 0, 5}, 3);
  environment.b = {-1, -2, 1};
  environment.lo = {0, 0, -0.5};
  environment.hi = {0, 0, 0.5};
  environment.R = {0, 0, 0};
  environment.mu = {0, 0, 0};
  io::Recording recording;
  recording.batch = ContactBatch<double>(Law::convex);
  recording.batch.add(environment);
  return recording;
}

TEST(Inspect, CountsWhatIsThere) {
  const Folder folder;
  const std::string batch = write_batch(folder / "b.h5", hand_made());
  const Json json = Json::parse(run_stiction({"inspect", batch, "--json"}).out);
  EXPECT_EQ(json["environments"], 1);
  EXPECT_EQ(json["rows"]["total"], 3);
  EXPECT_EQ(json["cones"]["unilateral"], 2);
  EXPECT_EQ(json["cones"]["box"], 1);
  EXPECT_EQ(json["nonzeros"]["total"], 5);
  EXPECT_NEAR(json["density"]["median"].get<double>(), 5.0 / 9, 1e-15);
  EXPECT_EQ(json["paths"]["dense"], 1);
  EXPECT_EQ(json["islands"]["max"], 2);
  EXPECT_EQ(json["asymmetry"]["max"], 0.0);
  EXPECT_NEAR(json["condition_estimate"]["max"].get<double>(), 5, 1e-12) << "eigenvalues 1, 3, 5";
  EXPECT_EQ(json["condition_estimate"]["settled"], 1);
  EXPECT_EQ(json["condition_estimate"]["singular"], 0);
  EXPECT_EQ(json["operators"]["environments"], 1);
  EXPECT_EQ(json["operators"]["positive_definite"], 1);
  EXPECT_NEAR(json["operators"]["largest_singular_value"]["median"].get<double>(), 5, 1e-12);
  EXPECT_NEAR(json["operators"]["smallest_singular_value"]["median"].get<double>(), 1, 1e-12);
  EXPECT_EQ(json["operators"]["rank_deficiency"]["max"], 0.0);
  EXPECT_EQ(json["operators"]["normal_spread"]["max"], 2.5) << "diagonals 2, 2, 5";
  EXPECT_TRUE(json["warnings"].empty());
}

TEST(Inspect, SingularAndIndefiniteOperatorsAreCounted) {
  const Folder folder;
  io::Recording recording = hand_made();
  auto environment = Environment<double>{};
  environment.cones.assign(2, {ConeKind::unilateral, 1, -1});
  environment.b = {-1, -1};
  for (const double coupling : {1.0, 2.0}) {
    environment.set_dense(std::vector<double>{1, coupling, coupling, 1}, 2);
    recording.batch.add(environment);
  }
  recording.batch.add(Environment<double>{});
  const std::string batch = write_batch(folder / "b.h5", recording);
  const Json json = Json::parse(run_stiction({"inspect", batch, "--json"}).out);
  EXPECT_EQ(json["operators"]["environments"], 3) << "the empty one is left out";
  EXPECT_EQ(json["operators"]["positive_definite"], 1);
  EXPECT_EQ(json["operators"]["positive_semidefinite"], 1);
  EXPECT_EQ(json["operators"]["indefinite"], 1);
  EXPECT_EQ(json["operators"]["rank_deficiency"]["max"], 1.0);
  EXPECT_EQ(json["condition_estimate"]["singular"], 1);
  EXPECT_TRUE(json["condition_estimate"]["max"].is_null()) << "infinite";
  ASSERT_EQ(json["warnings"].size(), 1U);
  EXPECT_EQ(json["warnings"][0].get<std::string>().find("1 of 3 environments"), 0U);
  const std::string text = run_stiction({"inspect", batch}).out;
  EXPECT_NE(text.find("1 positive definite, 1 positive semidefinite, 1 indefinite, 0 not tested"), std::string::npos);
  EXPECT_NE(text.find("3 settled, 1 singular)"), std::string::npos);
}

TEST(Inspect, OneEnvironmentCanBeLookedAt) {
  const Folder folder;
  const std::string batch = write_batch(folder / "b.h5", chain_recording(6));
  const Json json = Json::parse(run_stiction({"inspect", batch, "--json", "--env", "4"}).out);
  EXPECT_EQ(json["environments"], 1);
  EXPECT_EQ(json["rows"]["total"], 6) << "environment 4 of the chains has two cones";
}

TEST(Inspect, BrokenNumbersAreWarnings) {
  const Folder folder;
  const io::Recording recording = chain_recording(3);
  auto arrays = recording.batch.arrays();
  arrays.mu[1] = -0.5;
  const std::string batch = write_batch(folder / "b.h5", with_arrays(recording, std::move(arrays)));
  const Finished finished = run_stiction({"inspect", batch, "--json"});
  EXPECT_EQ(finished.status, 0);
  const Json json = Json::parse(finished.out);
  ASSERT_EQ(json["warnings"].size(), 1U);
  EXPECT_NE(json["warnings"][0].get<std::string>().find("-0.5"), std::string::npos);
}

TEST(Inspect, TheGraphHasAVertexPerConeAndABoxPerIsland) {
  const Folder folder;
  const std::string batch = write_batch(folder / "b.h5", hand_made());
  ASSERT_EQ(run_stiction({"inspect", batch, "--graph", folder / "g.dot"}).status, 0);
  const std::string dot = read_text(folder / "g.dot");
  EXPECT_NE(dot.find("0 -- 1"), std::string::npos);
  EXPECT_EQ(dot.find("-- 2"), std::string::npos);
  EXPECT_NE(dot.find("cluster_1"), std::string::npos);
  EXPECT_EQ(dot.find("cluster_2"), std::string::npos);
  EXPECT_NE(dot.find("3 cones, 1 couplings, 2 islands, 2 colours"), std::string::npos);
}

TEST(Inspect, TheGraphIsDrawnByGraphviz) {
  if (!graphviz_is_there()) GTEST_SKIP() << "Graphviz is not installed";
  const Folder folder;
  const std::string batch = write_batch(folder / "b.h5", chain_recording(5));
  const Finished finished = run_stiction({"inspect", batch, "--graph", folder / "g.svg"});
  ASSERT_EQ(finished.status, 0) << finished.err;
  EXPECT_NE(read_text(folder / "g.svg").find("<svg"), std::string::npos);
  EXPECT_EQ(field(finished.out, "drawn"), "environment 2") << "the first with the most cones";
}

TEST(Inspect, WithoutGraphvizAnSvgIsRefused) {
  const Folder folder;
  const std::string batch = write_batch(folder / "b.h5", hand_made());
  const Finished finished = run_stiction({"inspect", batch, "--graph", folder / "g.svg"}, {"PATH=/nowhere"});
  EXPECT_EQ(finished.status, 2);
  EXPECT_NE(finished.err.find("Graphviz is not installed"), std::string::npos) << finished.err;
  EXPECT_FALSE(fs::exists(folder / "g.svg"));
}

TEST(Verify, AgreesWithTheResidualWorkedOutByHand) {
  const Folder folder;
  const std::string batch = write_batch(folder / "b.h5", hand_made());
  // w = A (0, 1, -0.2) + b = (0, 0, 0): solved.
  const std::string exact = write_solution(folder / "exact.h5", {0, 1, -0.2}, {0, 3});
  EXPECT_EQ(run_stiction({"verify", batch, exact}).status, 0);
  // lambda = 0: w = b = (-1, -2, 1). Row 1 is off by 2, which is the scale of its island, too.
  const std::string zero = write_solution(folder / "zero.h5", {0, 0, 0}, {0, 3});
  const Finished finished = run_stiction({"verify", batch, zero, "--json"});
  EXPECT_EQ(finished.status, 1);
  const Json json = Json::parse(finished.out);
  EXPECT_NEAR(json["residual"]["max"].get<double>(), 1, 1e-15);
  EXPECT_NEAR(json["residual_absolute"]["max"].get<double>(), 2, 1e-15);
  EXPECT_EQ(json["above"], 1);
  EXPECT_EQ(json["worst_environment"], 0);
  EXPECT_EQ(json["worst_cone"], 1);
  EXPECT_NEAR(json["worst_error"].get<double>(), 2, 1e-15);
  EXPECT_NEAR(json["worst_scale"].get<double>(), 2, 1e-15);
  EXPECT_NE(run_stiction({"verify", batch, zero}).out.find("cone 1 (" + json["worst_kind"].get<std::string>() + ")"),
            std::string::npos);
  EXPECT_EQ(run_stiction({"verify", batch, zero, "--tolerance", "1"}).status, 0);
  EXPECT_EQ(run_stiction({"verify", batch, zero, "--absolute-tolerance", "2"}).status, 0) << "either will do";
  EXPECT_EQ(run_stiction({"verify", batch, zero, "--absolute-tolerance", "1.9"}).status, 1);
  EXPECT_TRUE(Json::parse(run_stiction({"verify", batch, exact, "--json"}).out)["worst_cone"].is_null());
}

TEST(Verify, ASolutionThatIsNotFiniteIsAboveAnyTolerance) {
  const Folder folder;
  const std::string batch = write_batch(folder / "b.h5", hand_made());
  const std::string broken = write_solution(folder / "s.h5", {0, std::nan(""), 0}, {0, 3});
  EXPECT_EQ(run_stiction({"verify", batch, broken, "--tolerance", "1e300"}).status, 1);
}

TEST(Diff, FindsTheFirstDifferenceAndItsSize) {
  const Folder folder;
  const std::string a = write_solution(folder / "a.h5", {1, 2, 3, 4}, {0, 2, 4});
  const std::string b = write_solution(folder / "b.h5", {1, 2, 3, std::nextafter(4.0, 5.0)}, {0, 2, 4});
  EXPECT_EQ(run_stiction({"diff", a, a}).status, 0);
  const Finished finished = run_stiction({"diff", a, b});
  EXPECT_EQ(finished.status, 1);
  EXPECT_NE(finished.out.find("environment 1, row 1"), std::string::npos) << finished.out;
  EXPECT_NE(finished.out.find(", 1 ulp\n"), std::string::npos) << finished.out;
  EXPECT_NE(finished.out.find("1 of 2 environments"), std::string::npos) << finished.out;
}

TEST(Diff, CountsUlpsInThePrecisionOfTheFiles) {
  const Folder folder;
  const float next = std::nextafter(std::nextafter(1.0F, 2.0F), 2.0F);
  const std::string a = write_solution(folder / "a.h5", {1}, {0, 1}, Precision::f32);
  const std::string b = write_solution(folder / "b.h5", {static_cast<double>(next)}, {0, 1}, Precision::f32);
  EXPECT_NE(run_stiction({"diff", a, b}).out.find(", 2 ulps\n"), std::string::npos);
  const std::string c = write_solution(folder / "c.h5", {1}, {0, 1}, Precision::f64);
  EXPECT_EQ(run_stiction({"diff", a, c}).status, 2) << "bits of different precisions cannot be compared";
}

TEST(Diff, SeesSignedZerosAsTheHashDoes) {
  const Folder folder;
  const std::string a = write_solution(folder / "a.h5", {0.0}, {0, 1});
  const std::string b = write_solution(folder / "b.h5", {-0.0}, {0, 1});
  EXPECT_EQ(run_stiction({"diff", a, b}).status, 1);
  EXPECT_NE(run_stiction({"hash", a}).out, run_stiction({"hash", b}).out);
}

TEST(Hash, OfAnEnvironmentIsThatOfAFileOfItsOwn) {
  const Folder folder;
  const std::string both = write_solution(folder / "both.h5", {1, 2, 3}, {0, 2, 3});
  const std::string second = write_solution(folder / "second.h5", {3}, {0, 1});
  const std::string lines = run_stiction({"hash", both, "--per-environment"}).out;
  EXPECT_NE(lines.find("\n1 " + run_stiction({"hash", second}).out), std::string::npos) << lines;
}

TEST(Convert, AProblemSurvivesTheWayToFclibAndBack) {
  const Folder folder;
  io::Recording recording = chain_recording(3);
  recording.batch.set_law(Law::coulomb);
  const std::string batch = write_batch(folder / "b.h5", recording);
  const std::string fclib = folder / "problem.hdf5";
  const Finished to = run_stiction({"convert", batch, fclib, "--env", "2"});
  ASSERT_EQ(to.status, 0) << to.err;
  ASSERT_EQ(run_stiction({"convert", fclib, folder / "back.h5"}).status, 0);
  const auto original = gather(recording.batch, std::span<const Offset>(std::vector<Offset>{2})).arrays();
  const auto back = io::read_batch(folder / "back.h5").batch.arrays();
  EXPECT_EQ(back.b, original.b);
  EXPECT_EQ(back.mu, original.mu);
  EXPECT_EQ(back.cone_row_offsets, original.cone_row_offsets);
  ASSERT_EQ(run_stiction({"solve", fclib, "--tolerance", "1e-10", "-o", folder / "s.h5"}).status, 0);
  EXPECT_EQ(run_stiction({"verify", folder / "back.h5", folder / "s.h5"}).status, 0);
}

TEST(Convert, ASharedFclibFileIsReadDirectlyAndByWayOfABatch) {
  const std::string shared = STICTION_SHARED_DIR;
  const std::string fclib = shared + "/data/fclib/local_problem_test.hdf5";
  if (!fs::exists(fclib)) GTEST_SKIP() << "no shared data at " << shared;
  const Folder folder;
  ASSERT_EQ(run_stiction({"convert", fclib, folder / "b.h5"}).status, 0);
  run_stiction({"solve", fclib, "-o", folder / "direct.h5"});
  run_stiction({"solve", folder / "b.h5", "-o", folder / "batch.h5"});
  EXPECT_EQ(run_stiction({"diff", folder / "direct.h5", folder / "batch.h5"}).status, 0);
}

}  // namespace
}  // namespace stiction::test
