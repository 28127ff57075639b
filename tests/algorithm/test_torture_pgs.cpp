#include "core/algorithm/solver/pgs.hpp"

#include "tests/support/torture_cases.hpp"

namespace stiction::test {

TEST(torture, pgs_has_the_same_bits_on_blocks_of_every_width_tile_and_stride) {
  torture_method<Pgs>();
}

}  // namespace stiction::test
