#include <filesystem>

#include "bench/support/contact_batch.hpp"
#include "tools/gpu_first/check.hpp"
#include "tools/gpu_first/child.hpp"
#include "tools/gpu_first/robot_case.hpp"

/// Stalls of three kernels, by NVIDIA's ncu, if it is there and may count. It looks at checks `profile/...`.
namespace stiction::gpu_first {

namespace {

constexpr Offset kEnvs = 8192, kFewerThanMany = 4096;
constexpr double kLimit = 24;  // s

struct Profile {
  const char* name;
  const char* kernel;  ///< part of its name
};
constexpr Profile kProfiles[] = {
    {"velocity", "SolveVelocityTeams"}, {"bundles", "SolveThreadPerEnv"}, {"dense_warp", "SolveTeams"}};

void solve_robot(Report& report, const std::string& name, RobotForm form, SolverKind solver) {
  const auto robot = robot_case(report.setting(), name);
  if (!robot) return report.left_out("", "there is no " + name + ".batch in '" + report.setting().batches + "'");
  const RobotCase many = repeated(*robot, report.setting().full ? kEnvs : robot->env_count(), form);
  RobotThere there(*report.target(), many, RobotSolve(form, solver, 1e-4));
  there.queue(false);
  report.judge("", there.hashes().empty() ? "there is no answer" : "");
}

void solve_faces(Report& report) {
  SolverOptions options = bench::fixed_sweeps(SolverKind::npgs, 20);
  options.law = Law::convex;
  const auto batch = bench::make_contacts<float>("face", 22, report.setting().full ? kFewerThanMany : 4);
  report.judge("", solve(batch, options, report.target()->device()).lambda.empty() ? "there is no answer" : "");
}

void profile(Report& report, const Profile& of) {
  if (report.target() == nullptr || !report.target()->is_native()) return report.left_out("", "ncu needs a GPU");
  const std::string self = std::filesystem::read_symlink("/proc/self/exe").string();
  const auto table =
      std::filesystem::path(report.setting().out).parent_path() / ("ncu_" + std::string(of.name) + ".csv");
  std::vector<std::string> command{"ncu",
                                   "--clock-control",
                                   "none",
                                   "--launch-count",
                                   "1",
                                   "--kernel-name-base",
                                   "demangled",
                                   "--kernel-name",
                                   std::string("regex:") + of.kernel,
                                   "--csv",
                                   "--force-overwrite",
                                   "--log-file",
                                   table.string()};
  for (const char* const section : {"SpeedOfLight", "WarpStateStats", "MemoryWorkloadAnalysis", "Occupancy"})
    command.insert(command.end(), {"--section", section});
  command.insert(command.end(), {self, "--run", std::string("profile/") + of.name, "--device", "cuda", "--hashes",
                                 report.setting().hashes, "--batches", report.setting().batches});
  const Ending ending = run_child(command, kLimit * report.setting().patience);
  const bool is_done = ending.kind == Ending::Kind::exited && ending.number == 0;
  if (ending.kind == Ending::Kind::exited && ending.number == 127) return report.left_out("", "ncu is not here");
  if (!is_done) return report.left_out("", "ncu did not end well; it printed: " + ending.printed);
  report.judge("", std::filesystem::exists(table) ? "" : "there is no " + table.string());
}

}  // namespace

void add_profiles(Checks& checks) {
  for (const Profile& of : kProfiles)
    checks.push_back({std::string("ncu/") + of.name, kLimit + 2, [&of](Report& report) { profile(report, of); }});
  checks.push_back({"profile/velocity", kLimit,
                    [](Report& report) { solve_robot(report, "g1", RobotForm::jacobian, SolverKind::automatic); }});
  checks.push_back({"profile/bundles", kLimit,
                    [](Report& report) { solve_robot(report, "humanoid", RobotForm::matrix, SolverKind::npgs); }});
  checks.push_back({"profile/dense_warp", kLimit, solve_faces});
}

}  // namespace stiction::gpu_first
