#pragma once

#include <vector>

#include "tests/support/systems/walker.hpp"

/// States of many walkers.
namespace stiction::test {

inline constexpr Offset kEnvs = 19;

/// Numbers in [-1, 1) that every machine has.
inline double number(std::uint64_t i) {
  i = (i + 1) * 0x9e3779b97f4a7c15U;
  i ^= i >> 29U;
  return static_cast<double>(i * 0xbf58476d1ce4e5b9U >> 11U) * 0x1p-52 - 1.0;
}

/// Puts robots into the states of some of kEnvs.
template <class Real>
void put_states(ArticulatedBatch<Real>& robots, const std::vector<Offset>& envs) {
  const auto nq = static_cast<Offset>(robots.q_count()), nv = static_cast<Offset>(robots.dof_count());
  for (std::size_t e = 0; e < envs.size(); ++e) {
    const auto place = static_cast<Offset>(e), seed = 1000 * envs[e];
    for (Offset k = 0; k < nv; ++k)
      robots.qvel()[static_cast<std::size_t>(place * nv + k)] =
          static_cast<Real>(number(static_cast<std::uint64_t>(seed + k)));
    robots.qpos()[static_cast<std::size_t>(place * nq + 2)] -=
        static_cast<Real>(0.03 * static_cast<double>(envs[e] % 5));
    for (std::size_t k = 0; k < 2; ++k)
      robots.ctrl()[2 * e + k] = static_cast<Real>(number(static_cast<std::uint64_t>(seed + 500) + k));
  }
}

inline std::vector<Offset> all_envs() {
  std::vector<Offset> envs;
  for (Offset env = 0; env < kEnvs; ++env) envs.push_back(env);
  return envs;
}

}  // namespace stiction::test
