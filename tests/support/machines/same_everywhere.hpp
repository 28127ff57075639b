#pragma once

#include <gtest/gtest.h>

#include "tests/support/machines/scoped_isa.hpp"
#include "tests/support/systems/scene_batches.hpp"

namespace stiction::test {

/// Expects that neither threads, kernels, other environments nor the emulated device change a bit of a solve.
template <class Real>
void expect_equal_bits_everywhere(const ContactBatch<Real>& batch, SolverOptions own) {
  const auto expected = solve_hashes(batch, own);
  own.threads = 3;
  EXPECT_EQ(solve_hashes(batch, own), expected) << "threads";
  own.threads = 1;
  for (const char* isa : usable_shipped_isas()) {
    const ScopedIsa scope(isa);
    EXPECT_EQ(solve_hashes(batch, own), expected) << isa;
  }
  for (Offset env = 0; env < batch.env_count(); ++env) {
    const Offset only[] = {env};
    EXPECT_EQ(solve_hashes(gather(batch, only), own).front(), expected[static_cast<std::size_t>(env)])
        << "alone, " << env;
  }
  EXPECT_EQ(env_hashes(batch, solve(batch, own, Device::emulated())), expected) << "on the emulated device";
}

}  // namespace stiction::test
