#include <cstdio>

#include "stiction/stiction.hpp"

// A unit mass on the floor, pushed sideways within its friction cone: it must not move.
int main() {
  stiction::Environment<double> env;
  env.cones = {{stiction::ConeKind::friction, 3}};
  const double identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  env.set_dense(identity, 3);
  env.b = {-9.81, 2.0, 0.0};
  env.mu = {0.0, 0.5, 0.5};
  stiction::ContactBatch<double> batch(stiction::Law::coulomb);
  batch.add(env);
  const auto solution = stiction::solve(batch);
  const bool held =
      solution.status[0].code == stiction::EnvCode::solved && solution.w[1] < 1e-3 && solution.w[1] > -1e-3;
  std::printf("lambda = %g %g %g\n", solution.lambda[0], solution.lambda[1], solution.lambda[2]);
  return held ? 0 : 1;
}
