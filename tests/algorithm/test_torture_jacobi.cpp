#include "core/algorithm/solver/jacobi.hpp"

#include "tests/support/torture_cases.hpp"

namespace stiction::test {

TEST(torture, jacobi_has_the_same_bits_on_blocks_of_every_width_tile_and_stride) {
  torture_method<Jacobi>();
}

}  // namespace stiction::test
