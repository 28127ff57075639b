#include <array>
#include <cstdio>

#include "stiction/stiction.hpp"

int main() {
  stiction::ContactBatch<double> batch(stiction::Law::coulomb);
  for (const double push : {2.0, 6.0}) {  // a block of 1 kg on the floor, pushed sideways [N]
    stiction::Environment<double> block;
    block.cones = {{stiction::ConeKind::friction, 3}};
    block.set_dense(std::array<double, 9>{1, 0, 0, 0, 1, 0, 0, 0, 1}, 3);
    block.b = {-9.81, push, 0};  // acceleration without contact: normal, two tangents [m/s2]
    block.mu = {0, 0.5, 0.5};
    batch.add(block);
  }
  const auto [lambda, w, status] = stiction::solve(batch);
  for (std::size_t e = 0; e < status.size(); ++e)
    std::printf("normal %.3f N, friction %.3f N, slides at %.3f m/s2: %s\n", lambda[3 * e], lambda[3 * e + 1],
                w[3 * e + 1], stiction::to_string(status[e].code));
}
