#include <algorithm>

#include "stiction/articulated.hpp"
#include "tests/support/systems/walker_states.hpp"
#include "tools/gpu_first/check.hpp"
#include "tools/gpu_first/timing.hpp"

/// Whole steps of robots in lanes: the bits of some, and how long a step of thousands takes.
namespace stiction::gpu_first {

namespace {

constexpr Index kSteps = 20;  // of a call, which is one launch
constexpr Offset kSizes[] = {1024, 4096, 16384, 65536};

/// Walkers in the states of kEnvs, again and again.
template <class Real>
ArticulatedBatch<Real> walkers(Device device, Offset envs, bool is_elliptic) {
  const double tolerance = sizeof(Real) == sizeof(float) ? 1e-4 : 1e-6;
  ArticulatedBatch<Real> robots(device, test::walker(is_elliptic), envs, {tolerance});
  std::vector<Offset> states;
  for (Offset env = 0; env < envs; ++env) states.push_back(env % test::kEnvs);
  test::put_states(robots, states);
  return robots;
}

template <class Real>
Hashes stepped(Device device, bool is_elliptic) {
  auto robots = walkers<Real>(device, 3 * test::kEnvs, is_elliptic);
  robots.step(kSteps);
  return {robots.hash()};
}

template <class Real>
void time_steps(Report& report, const std::string& cones, bool is_elliptic) {
  const std::string precision = sizeof(Real) == sizeof(float) ? "f32" : "f64";
  report.compare(
      precision, [&] { return stepped<Real>(Device::cpu(), is_elliptic); },
      [&] { return stepped<Real>(report.target()->device(), is_elliptic); });
  if (report.target() == nullptr || !report.setting().full) return;
  for (const Offset envs : kSizes) {
    auto robots = walkers<Real>(report.target()->device(), envs, is_elliptic);
    robots.step(kSteps);
    robots.synchronize();
    std::vector<double> seconds;
    for (int repeat = 0; repeat < repeats(report); ++repeat) {
      const double start = wall_seconds();
      robots.step(kSteps);
      robots.synchronize();
      seconds.push_back(wall_seconds() - start);
    }
    std::sort(seconds.begin(), seconds.end());
    const double each = 1e9 * seconds[seconds.size() / 2] / (static_cast<double>(envs) * kSteps);
    report.measured(precision + " " + std::to_string(envs),
                    [&](JsonLine& line) { line.add("envs", envs).add("steps", kSteps).add("ns_per_env_step", each); });
    report.say("walkers in lanes, " + cones + " " + precision, std::to_string(envs) + " " + brief(each));
  }
}

}  // namespace

void add_lanes(Checks& checks) {
  for (const bool is_elliptic : {false, true}) {
    const std::string cones = is_elliptic ? "elliptic" : "pyramids";
    checks.push_back({"lanes/" + cones, 15, [cones, is_elliptic](Report& report) {
                        time_steps<float>(report, cones, is_elliptic);
                        time_steps<double>(report, cones, is_elliptic);
                      }});
  }
}

}  // namespace stiction::gpu_first
