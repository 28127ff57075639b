#pragma once

#include <gtest/gtest.h>

#include "tests/support/machines/scoped_isa.hpp"

namespace stiction::test {

/// Expects that neither threads nor kernels change hash(Real(), threads), in either precision.
template <class Hash>
void expect_same_on_all_kernels(const Hash& hash) {
  const auto wide = hash(double(), 1), narrow = hash(float(), 1);
  EXPECT_EQ(hash(double(), 3), wide);
  for (const char* isa : usable_isas()) {
    const ScopedIsa scoped(isa);
    EXPECT_EQ(hash(double(), 1), wide) << isa;
    EXPECT_EQ(hash(float(), 1), narrow) << isa;
  }
}

}  // namespace stiction::test
