#include "core/algorithm/solver/admm/admm.hpp"

#include "tests/support/torture_cases.hpp"

namespace stiction::test {

TEST(torture, admm_has_the_same_bits_on_blocks_of_every_width) {
  torture_method<Admm>();
}

}  // namespace stiction::test
