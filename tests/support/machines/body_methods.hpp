#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/support/bits.hpp"
#include "tests/support/systems/body_systems.hpp"

/// Every way in which bodies are solved, and solutions compared.
namespace stiction::test {

/// One method under one law: sweeps with momentum or without, or Newton's with one preconditioner.
struct BodyMethodCase {
  Law law;
  BodyMethod method;
  bool momentum;
  BodyPreconditioner preconditioner;

  [[nodiscard]] std::string name() const {
    const std::string how = method == BodyMethod::newton ? std::string("newton, ") + to_string(preconditioner)
                            : momentum                   ? "impulses with momentum"
                                                         : "impulses";
    return how + ", " + to_string(law);
  }
  /// A few iterations, so that no two environments need be done together.
  [[nodiscard]] BodySolverOptions options() const {
    BodySolverOptions options;
    options.law = law;
    options.method = method;
    options.momentum = momentum;
    options.space.preconditioner = preconditioner;
    options.iterations = method == BodyMethod::newton ? 3 : 19;
    options.tolerance = 1e-3;
    options.substeps = momentum ? 2 : 1;
    options.threads = 1;
    options.invalid = InvalidPolicy::isolate;
    return options;
  }
};

inline std::vector<BodyMethodCase> every_body_method() {
  std::vector<BodyMethodCase> all;
  for (const Law law : {Law::convex, Law::coulomb}) {
    for (const bool momentum : {false, true})
      all.push_back({law, BodyMethod::impulses, momentum, BodyPreconditioner::diagonal});
    for (int kind = 0; kind < kBodyPreconditionerCount; ++kind)
      all.push_back({law, BodyMethod::newton, false, static_cast<BodyPreconditioner>(kind)});
  }
  return all;
}

template <class Real>
void expect_same_bodies(const BodySolution<Real>& a, const BodySolution<Real>& b, const std::string& label) {
  EXPECT_TRUE(same_bits(std::span<const Real>(a.impulse), std::span<const Real>(b.impulse))) << label;
  EXPECT_TRUE(same_bits(std::span<const Real>(a.twist), std::span<const Real>(b.twist))) << label;
  EXPECT_TRUE(same_bits(std::span<const Real>(a.w), std::span<const Real>(b.w))) << label;
  EXPECT_TRUE(same_bits(std::span<const EnvStatus>(a.status), std::span<const EnvStatus>(b.status))) << label;
}

/// One environment of a solution, as a solution that stands alone.
template <class Real>
BodySolution<Real> part_of(const BodySolution<Real>& all, const BodyBatchView<Real>& batch, Offset env) {
  const auto cut = [env](const std::vector<Real>& array, Offset width, const Offset* offsets) {
    return std::vector<Real>(array.begin() + width * offsets[env], array.begin() + width * offsets[env + 1]);
  };
  return {cut(all.impulse, 3, batch.env_contact_offsets),
          cut(all.twist, 6, batch.env_body_offsets),
          cut(all.w, 3, batch.env_contact_offsets),
          {all.status[static_cast<std::size_t>(env)]}};
}

}  // namespace stiction::test
