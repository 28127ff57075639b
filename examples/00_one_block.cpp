#include <array>
#include <cstdio>

#include "stiction/stiction.hpp"

int main() {
  stiction::Environment<double> block;  // 1 kg on the floor, pushed with 6 N
  block.cones = {{stiction::ConeKind::friction, 3}};
  block.set_dense(std::array<double, 9>{1, 0, 0, 0, 1, 0, 0, 0, 1}, 3);  // A: 1 N accelerates 1 kg by 1 m/s2
  block.b = {-9.81, 6, 0};  // acceleration without contact: normal, two tangents [m/s2]
  block.mu = {0, 0.5, 0.5};
  stiction::ContactBatch<double> batch(stiction::Law::coulomb);
  batch.add(block);
  const auto [lambda, w, status] = stiction::solve(batch);
  std::printf("friction %.3f N, slides at %.3f m/s2: %s\n", lambda[1], w[1], stiction::to_string(status[0].code));
}
