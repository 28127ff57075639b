#include "tools/gpu_first/robot_case.hpp"
#include "tools/gpu_first/timing.hpp"

/// Recorded robots and piles: their bits, then times of many of them.
namespace stiction::gpu_first {

namespace {

constexpr double kTolerances[] = {1e-4, 1e-6};
constexpr Offset kSizes[] = {1024, 4096, 16384, 65536}, kFewEnvs = 2;
constexpr std::size_t kMostBytes = std::size_t{3} << 30;  ///< of a batch's matrices

std::vector<RobotSolve> solves_of(RobotForm form) {
  std::vector<RobotSolve> solves;
  for (const double tolerance : kTolerances) {
    if (form == RobotForm::matrix) solves.emplace_back(form, SolverKind::npgs, tolerance);
    solves.emplace_back(form, SolverKind::automatic, tolerance);
  }
  return solves;
}

std::optional<RobotCase> case_of(Report& report, const std::string& name) {
  auto found = robot_case(report.setting(), name);
  if (!found) report.left_out("", "there is no " + name + ".batch in '" + report.setting().batches + "'");
  return found;
}

Hashes cold_and_warm(const std::function<Hashes(bool)>& solved) {
  Hashes all = solved(false);
  for (const std::uint64_t hash : solved(true)) all.push_back(hash);
  return all;
}

void compare_robot(Report& report, const std::string& name, RobotForm form) {
  const auto robot = case_of(report, name);
  if (!robot) return;
  for (const RobotSolve& how : solves_of(form))
    report.compare(
        how.name(), [&] { return cold_and_warm([&](bool is_warm) { return solved_here(*robot, how, is_warm); }); },
        [&] {
          RobotThere there(*report.target(), *robot, how);
          return cold_and_warm([&](bool is_warm) {
            there.queue(is_warm);
            return there.hashes();
          });
        });
}

/// Returns true if each environment has the hash of the one that it repeats.
bool all_repeat(const Hashes& all, const Hashes& once) {
  for (std::size_t i = 0; i < all.size(); ++i)
    if (all[i] != once[i % once.size()]) return false;
  return !all.empty();
}

/// A solve, and the CPU's answers: cold, warm.
struct Expected {
  RobotSolve how;
  Hashes expected[2];
};

void time_solve(Report& report, const Expected& solve, const RobotCase& many, Offset envs, const std::string& title) {
  RobotThere there(*report.target(), many, solve.how);
  for (const bool is_warm : {false, true}) {
    const Time time = time_graph(*report.target(), there.stream(), repeats(report), [&] { there.queue(is_warm); });
    const bool is_right = all_repeat(there.hashes(), solve.expected[is_warm ? 1 : 0]);
    const char* const start = is_warm ? "warm" : "cold";
    const double each = 1e3 * time.median / static_cast<double>(envs);
    const std::string part = solve.how.name() + " " + std::to_string(envs) + " " + start;
    if (!is_right) report.judge(part, "its answers are not the CPU's");
    report.measured(part, [&](JsonLine& line) {
      line.add("solver", to_string(solve.how.options.solver)).add("tolerance", solve.how.options.tolerance);
      line.add("envs", envs).add("start", start);
      line.add("rows", static_cast<double>(many.reactions.size()) / static_cast<double>(envs));
      line.add("us", time.median).add("us_least", time.least).add("ns_per_env", each);
      line.add("answers", is_right ? "equal" : "different");
    });
    report.say(title + " " + solve.how.name(), std::to_string(envs) + " " + start + " " + brief(each));
  }
}

void time_robot(Report& report, const std::string& name, RobotForm form) {
  if (report.target() == nullptr) return report.left_out("", "the CPU is timed by bench/");
  const auto robot = case_of(report, name);
  if (!robot) return;
  std::vector<Expected> solves;
  for (const RobotSolve& how : solves_of(form))
    solves.push_back({how, {solved_here(*robot, how, false), solved_here(*robot, how, true)}});
  const Offset entries = robot->matrices.view().nonzero_count / robot->env_count();
  for (const Offset size : kSizes) {
    const Offset envs = report.setting().full ? size : kFewEnvs;
    const std::size_t bytes = static_cast<std::size_t>(entries * envs) * sizeof(float);
    if (bytes > kMostBytes) {
      report.left_out(std::to_string(envs), "its matrices take " + std::to_string(bytes >> 20) + " MiB");
    } else {
      const RobotCase many = repeated(*robot, envs, form);
      for (const Expected& solve : solves)
        time_solve(report, solve, many, envs, name + (form == RobotForm::jacobian ? " J M" : " A"));
    }
    if (!report.setting().full) break;
  }
}

}  // namespace

void add_robot_hashes(Checks& checks) {
  for (const char* const name : kRobots) {
    checks.push_back({std::string("hash/") + name + "/jm", 15,
                      [name](Report& report) { compare_robot(report, name, RobotForm::jacobian); }});
    checks.push_back({std::string("hash/") + name + "/a", 15,
                      [name](Report& report) { compare_robot(report, name, RobotForm::matrix); }});
  }
}

void add_robot_times(Checks& checks) {
  for (const RobotForm form : {RobotForm::jacobian, RobotForm::matrix})
    for (const char* const name : kRobots)
      checks.push_back({std::string("robot/") + name + (form == RobotForm::jacobian ? "/jm" : "/a"), 30,
                        [name, form](Report& report) { time_robot(report, name, form); }});
}

}  // namespace stiction::gpu_first
