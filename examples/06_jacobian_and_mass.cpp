#include <array>
#include <cstdio>

#include "stiction/stiction.hpp"

namespace {

constexpr double kStep = 0.01, kGravity = 9.81;  // [s], [m/s2]

/// Appends a contact at `r` from the centre of mass. Its rows of J v are the point's velocity along z, x and y.
void add_contact(stiction::JacobianEnvironment<double>& cube, const std::array<double, 3>& r) {
  const auto [x, y, z] = r;
  for (const std::array<double, 6>& row :
       {std::array<double, 6>{0, 0, 1, y, -x, 0}, {1, 0, 0, 0, z, -y}, {0, 1, 0, -z, 0, x}})
    cube.J.insert(cube.J.end(), row.begin(), row.end());
  cube.cones.push_back({stiction::ConeKind::friction, 3});
  cube.mu.insert(cube.mu.end(), {0, 0.5, 0.5});
}

/// A cube of 1 kg and 0.2 m that stands on the floor with four corners, `depth` [m] too deep, and slides along x.
stiction::JacobianEnvironment<double> cube_of(double speed, double depth) {
  stiction::JacobianEnvironment<double> cube;
  cube.M = {1, 1, 1, 1 / 150., 1 / 150., 1 / 150.};      // mass [kg], inertia [kg m2]
  cube.v_free = {speed, 0, -kStep * kGravity, 0, 0, 0};  // [m/s], [rad/s]
  for (const double x : {-0.1, 0.1})
    for (const double y : {-0.1, 0.1}) {
      add_contact(cube, {x, y, -0.1});
      cube.target.insert(cube.target.end(), {0.2 * depth / kStep, 0, 0});  // a fifth of the depth in this step [m/s]
    }
  return cube;
}

}  // namespace

int main() {
  stiction::JacobianBatch<double> batch(stiction::Law::coulomb, stiction::MassForm::matrix, 1);
  batch.add(cube_of(1.0, 0.0));
  batch.add(cube_of(0.0, 0.001));
  stiction::SolverOptions options;
  options.solver = stiction::SolverKind::automatic;
  options.tolerance = 1e-8;
  const auto solution = stiction::solve(batch, options);
  for (std::size_t e = 0; e < solution.contact.status.size(); ++e)
    std::printf("slides at %.3f m/s, rises at %.3f m/s: %s\n", solution.velocity[6 * e], solution.velocity[6 * e + 2],
                stiction::to_string(solution.contact.status[e].code));
}
