#pragma once

#include <algorithm>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

#include "stiction/batch.hpp"
#include "stiction/status.hpp"

/// Environments whose contacts come and go, for the tests of the warm-start store.
namespace stiction::test {

struct Cone {
  std::uint64_t id;
  ConeKind kind;
  Index rows;
};

/// One environment at one step: its cones, and an answer made for a solver.
template <class Real>
struct EnvStep {
  std::vector<Cone> cones;
  std::vector<Real> lambda;
  EnvCode code = EnvCode::solved;
};

/// All environments at one step.
template <class Real>
struct Step {
  std::vector<EnvStep<Real>> envs;
  double dt = 0.01;
  std::vector<Offset> reset;
};

/// A step as the store sees it. A has no entries: the store reads no numbers.
template <class Real>
struct Packed {
  explicit Packed(const std::vector<EnvStep<Real>>& envs) {
    for (const EnvStep<Real>& env : envs) {
      Environment<Real> e;
      for (const Cone& cone : env.cones) {
        e.cones.push_back({cone.kind, cone.rows, -1});
        id.push_back(cone.id);
      }
      e.row_offsets.assign(env.lambda.size() + 1, 0);
      e.b.assign(env.lambda.size(), Real(0));
      batch.add(e);
      lambda.insert(lambda.end(), env.lambda.begin(), env.lambda.end());
      EnvStatus record{};
      record.code = env.code;
      status.push_back(record);
    }
  }
  ContactBatch<Real> batch;
  std::vector<std::uint64_t> id;
  std::vector<Real> lambda;
  std::vector<EnvStatus> status;
};

/// A random life of some environments. Contacts come, stay, go, change their kind and their order. Now and then one
/// fails, starts over, has no contact, or too many.
template <class Real>
std::vector<Step<Real>> random_life(std::mt19937_64& random, int envs, int steps) {
  const auto below = [&random](std::uint64_t n) { return static_cast<int>(random() % n); };
  std::vector<Step<Real>> life;
  std::vector<std::vector<Cone>> alive(static_cast<std::size_t>(envs));
  for (int s = 0; s < steps; ++s) {
    Step<Real> step;
    step.dt = below(3) == 0 ? 0.001 * (1 + below(20)) : 0.01;
    for (int e = 0; e < envs; ++e) {
      std::vector<Cone>& cones = alive[static_cast<std::size_t>(e)];
      std::erase_if(cones, [&](const Cone&) { return below(5) == 0; });
      if (below(15) == 0) cones.clear();
      const int fresh = below(12) == 0 ? 40 : below(6);
      for (int k = 0; k < fresh; ++k) {
        const bool friction = below(3) > 0;
        const std::uint64_t id = below(4) == 0 ? random() : static_cast<std::uint64_t>(below(60));
        cones.push_back({id, friction ? ConeKind::friction : static_cast<ConeKind>(below(3)),
                         friction ? 2 + static_cast<Index>(below(5)) : 1});
      }
      if (below(3) == 0) std::shuffle(cones.begin(), cones.end(), random);
      EnvStep<Real> env;
      env.cones = cones;
      for (const Cone& cone : cones)
        for (Index k = 0; k < cone.rows; ++k)
          env.lambda.push_back(below(10) == 0 ? Real(-0.0) : static_cast<Real>(below(2000) - 1000) / Real(7));
      if (below(6) == 0) env.code = static_cast<EnvCode>(below(kEnvCodeCount));
      if (below(25) == 0 && !env.lambda.empty()) env.lambda.back() = std::numeric_limits<Real>::quiet_NaN();
      step.envs.push_back(std::move(env));
      if (below(10) == 0) step.reset.push_back(e);
    }
    life.push_back(std::move(step));
  }
  return life;
}

template <class Real>
bool same_bits(const std::vector<Real>& a, const std::vector<Real>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(Real)) == 0);
}

}  // namespace stiction::test
