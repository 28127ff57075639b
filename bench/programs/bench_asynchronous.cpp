// Sweeps of threads on one scene of bodies, by colours and without waiting for them, when one thread is slow.
//
//   bench_asynchronous [--threads 2] [--repeats 5] [--slow 1,2,10] [--tolerance 1e-3] [--wall 30]
//                      [--pile 10000] [--csv PATH]
//
// A team of this program makes its last thread slow. After each run of items it spins until they have taken so many
// times as long, by the thread's own clock. The library has no such hook. Wall clock, median of the repeats; solves
// with colours and without alternate.

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <string>
#include <vector>

#include "bench/support/arguments.hpp"
#include "bench/support/csv.hpp"
#include "bench/support/machine.hpp"
#include "bench/support/table_main.hpp"
#include "core/algorithm/rigid/asynchronous_sweeps.hpp"
#include "core/plan/body_plan.hpp"
#include "cpu_fallback/threads/threaded_team.hpp"
#include "scenes/body_scenes.hpp"
#include "scenes/box_scenes.hpp"

namespace stiction::bench {

/// Threads of which the last is slow: whatever it does in a loop takes it so many times as long.
class SlowTeam : public ThreadedTeam {
 public:
  SlowTeam(cpu::ThreadTeam& team, Index rank, double slow)
      : ThreadedTeam(team, rank), slow_(rank + 1 == team.width() ? slow : 1) {}

  template <class F>
  void deal(Offset count, Offset window, F&& f) {
    ThreadedTeam::deal(count, window, [&](Offset item) { slowly([&] { f(item); }); });
  }
  template <class Work>
  void slowly(Work&& work) const {
    if (slow_ == 1) return work();
    const double start = own_seconds();
    work();
    const double end = start + slow_ * (own_seconds() - start);
    while (own_seconds() < end) {
    }
  }

 private:
  /// CPU time of this thread: other work on its core does not make it slower still.
  static double own_seconds() {
    timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  }

  double slow_;
};

/// The library's loop, found by the team's namespace.
template <class F>
void for_each_tiled(SlowTeam& team, Index n, F&& f) {
  constexpr Index kRun = ThreadedTeam::kRowTile;
  const Index runs = (n + kRun - 1) / kRun;
  for (Index run = team.rank(); run < runs; run += team.size())
    team.slowly([&] {
      const Index end = std::min((run + 1) * kRun, n);
      for (Index i = run * kRun; i < end; ++i) f(i);
    });
  team.sync();
}

namespace {

using Real = float;

double wall_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// One scene, by sweeps of one kind.
class Scene {
 public:
  Scene(const std::string& name, const BodyEnvironment<double>& env, double tolerance) : name_(name) {
    batch_.add(scenes::rounded(env));
    plan_ = make_body_plan(batch_.view(), 0);
    options_.law = Law::convex;
    options_.tolerance = tolerance;
    options_.iterations = 100'000;
    stepping_.cfm = 1e-5;
    impulse_.resize(3 * env.contacts.size());
    twist_.resize(6 * env.bodies.size());
  }

  /// Seconds of a solve.
  double solve(int threads, double slow) {
    using System = BodySystem<Real, Law::convex>;
    const BodyJob<Real> job{batch_.view(), plan_.view(), {impulse_.data(), twist_.data(), nullptr, &status_},
                            nullptr,       stepping_,    options_};
    std::vector<Real> memory(static_cast<std::size_t>(System::elements(plan_.kept[0], batch_.body_count(), true)));
    std::vector<double> exact(static_cast<std::size_t>(System::exact_elements(batch_.body_count())));
    const double start = wall_seconds();
    cpu::run_team(threads, [&](cpu::ThreadTeam& shared, Index rank) {
      SlowTeam team(shared, rank, slow);
      DealtSweeps<Law::convex, Real>::solve(team, job, slice_bodies(job, 0), memory.data(), exact.data());
    });
    return wall_seconds() - start;
  }

  const std::string& name() const { return name_; }
  BodySolverOptions& options() { return options_; }
  const EnvStatus& status() const { return status_; }
  Index contacts() const { return plan_.kept[0]; }
  Index colors() const { return plan_.color_count[0]; }

 private:
  std::string name_;
  BodyBatch<Real> batch_;
  BodyPlanData plan_;
  BodySolverOptions options_;
  TimeStepping stepping_;
  std::vector<Real> impulse_, twist_;
  EnvStatus status_;
};

void run_scene(Scene& scene, const Arguments& arguments, Csv* csv) {
  const int threads = arguments.count("--threads");
  for (const bool momentum : {false, true})
    for (const double slow : arguments.numbers("--slow")) {
      scene.options().momentum = momentum;
      // They alternate, so that whatever else runs meets both.
      std::vector<double> seconds[2], sweeps[2];
      bool solved = true;
      for (int repeat = 0; repeat < arguments.count("--repeats"); ++repeat)
        for (const bool asynchronous : {false, true}) {
          scene.options().asynchronous = asynchronous;
          seconds[asynchronous].push_back(scene.solve(threads, slow));
          sweeps[asynchronous].push_back(scene.status().iterations);
          solved = solved && scene.status().code == EnvCode::solved;
        }
      const auto median = [](std::vector<double>& all) {
        std::sort(all.begin(), all.end());
        return all[all.size() / 2];
      };
      std::vector<std::string> cells{scene.name(),
                                     std::to_string(scene.contacts()),
                                     std::to_string(scene.colors()),
                                     momentum ? "si" : "pgs",
                                     std::to_string(threads),
                                     number(slow)};
      for (const int k : {0, 1}) {
        cells.push_back(number(median(sweeps[k])));
        cells.push_back(number(median(seconds[k])));
      }
      cells.push_back(number(median(seconds[0]) / median(seconds[1])));
      cells.push_back(solved ? "all" : "not all");
      for (const std::string& cell : cells) std::printf("%10s", cell.c_str());
      std::printf("\n");
      std::fflush(stdout);
      if (csv != nullptr) csv->row(cells);
    }
}

}  // namespace

int run(int argc, char** argv) {
  const Arguments arguments(argc, argv,
                            {{"--threads", "2"},
                             {"--repeats", "5"},
                             {"--slow", "1,2,10"},
                             {"--tolerance", "1e-3"},
                             {"--wall", "30"},
                             {"--pile", "10000"}});
  const auto csv = arguments.csv(
      "scene,contacts,colors,method,threads,slow,sweeps_colored,seconds_colored,sweeps_asynchronous,"
      "seconds_asynchronous,gain,solved");
  for (const auto& [name, value] : describe_machine()) std::printf("# %s: %s\n", name.c_str(), value.c_str());
  const int wide = arguments.count("--wall");
  BodyEnvironment<double> wall = scenes::box_bodies(scenes::box_wall(wide, wide), 0.5);
  wall.bodies[3].twist = {0.7, 0.3, 0, 0, 1, 0};
  Scene scenes_of[] = {{"wall", wall, arguments.number("--tolerance")},
                       {"pile", scenes::make_body_pile(1, arguments.count("--pile")), arguments.number("--tolerance")}};
  for (Scene& scene : scenes_of) run_scene(scene, arguments, csv.get());
  return 0;
}

}  // namespace stiction::bench
