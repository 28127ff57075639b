// A ball is pushed over a floor: it slides, then rolls. With what speed must it start to be 1 m away after half a
// second? The derivative of where it ends goes back through all steps, contacts included.
#include <cstdio>
#include <exception>
#include <vector>

#include "stiction/stiction.hpp"

namespace {

constexpr int kSteps = 100;
constexpr double kGoal = 1.0;

stiction::WorldDescription describe() {
  stiction::WorldDescription description;
  stiction::WorldShape floor, ball;
  floor.kind = stiction::ShapeKind::plane;
  ball.body = 0;
  ball.size = {0.1, 0, 0};
  description.shapes = {floor, ball};
  description.bodies = {stiction::solid_body(ball, 1000.0)};
  description.bodies[0].position = {0, 0, 0.1};
  return description;
}

/// Returns where the ball ends, and the derivative of that by the speed it starts with.
struct Throw {
  double end, by_speed;
};

Throw simulate(double speed) {
  stiction::WorldOptions options;
  options.stepping.cfm = 1e-4;
  options.solver.iterations = 1000;
  options.solver.tolerance = 1e-10;
  stiction::WorldDescription description = describe();
  description.bodies[0].twist = {speed, 0, 0, 0, 0, 0};
  stiction::World<double> world(stiction::Device::cpu(), description, 1, options);
  std::vector<stiction::WorldStep<double>> steps;
  for (int step = 0; step < kSteps; ++step) steps.emplace_back(world);
  std::vector<double> twist(6, 0.0), position{1, 0, 0};
  for (auto step = steps.rbegin(); step != steps.rend(); ++step) {
    const auto gradient = step->pull(twist, position);
    twist = gradient.twist;
    position = gradient.position;
  }
  return {world.state().position[0], twist[0]};
}

}  // namespace

int main() {
  try {
    double speed = 1.0;
    for (int round = 0; round < 4; ++round) {
      const Throw found = simulate(speed);
      std::printf("%.4f m/s: ends at %.4f m\n", speed, found.end);
      speed -= (found.end - kGoal) / found.by_speed;
    }
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
