#include "core/algorithm/solver/ipm/ipm.hpp"

#include "tests/support/torture_cases.hpp"

namespace stiction::test {

TEST(torture, ipm_has_the_same_bits_on_blocks_of_every_width_and_tile) {
  torture_method<Ipm>();
}

}  // namespace stiction::test
