#include "core/algorithm/solver/newton/newton.hpp"

#include "tests/support/torture_cases.hpp"

namespace stiction::test {

TEST(torture, newton_has_the_same_bits_on_blocks_of_every_width_and_tile) {
  torture_method<Newton>();
}

}  // namespace stiction::test
