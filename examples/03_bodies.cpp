// A tower of 50 boxes under its weight, given as bodies and contact points: sequential impulses against Newton's method
// with multigrid. The floor must carry the weight of all 50.
#include <cstdio>
#include <exception>
#include <string>

#include "stiction/stiction.hpp"

namespace {

constexpr int kBoxes = 50;
constexpr double kStep = 0.005, kGravity = 9.81;

/// Cubes of 1 kg and 1 m; between two, and on the floor, a contact at each of four corners.
stiction::BodyEnvironment<double> build_tower() {
  stiction::BodyEnvironment<double> tower;
  for (int box = 0; box < kBoxes; ++box) {
    auto& body = tower.bodies.emplace_back();
    body.inv_inertia = {6, 0, 0, 6, 0, 6};
    body.twist_change = {0, 0, -kGravity * kStep, 0, 0, 0};
    for (const double x : {-0.5, 0.5})
      for (const double y : {-0.5, 0.5}) {
        auto& contact = tower.contacts.emplace_back();
        contact.body_a = box - 1;  // -1 is the world
        contact.body_b = box;
        contact.arm_a = {x, y, 0.5};
        contact.arm_b = {x, y, -0.5};
        contact.mu = 0.5;
      }
  }
  return tower;
}

void report(const std::string& name, const stiction::BodySolution<double>& solution) {
  double floor_impulse = 0;
  for (std::size_t contact = 0; contact < 4; ++contact) floor_impulse += solution.impulse[3 * contact];
  const stiction::EnvStatus& status = solution.status[0];
  std::printf("%s: floor carries %.2f N of %.2f N, %s\n", name.c_str(), floor_impulse / kStep, kBoxes * kGravity,
              to_string(status.code));
  std::printf("  %d iterations, relative residual %.1e\n", status.iterations, status.residual);
}

void run() {
  stiction::BodyBatch<double> batch;
  batch.add(build_tower());
  const stiction::TimeStepping stepping{.dt = kStep};
  stiction::BodySolverOptions options;
  options.law = stiction::Law::convex;
  options.tolerance = 1e-6;
  options.iterations = 200;
  report("200 sweeps", stiction::solve_bodies(batch, stepping, options));
  options.method = stiction::BodyMethod::newton;
  report("Newton's method", stiction::solve_bodies(batch, stepping, options));
}

}  // namespace

int main() {
  try {
    run();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
