#include <gtest/gtest.h>

#include <bit>
#include <limits>
#include <vector>

#include "stiction/hash.hpp"

namespace {

using stiction::hash_bits;

std::uint64_t hash_of(std::vector<float> values) {
  return hash_bits(std::span<const float>(values));
}
std::uint64_t hash_of(std::vector<double> values) {
  return hash_bits(std::span<const double>(values));
}

// Constants: computed with Python integers from the definition in hash.hpp; splitmix64(0) of that script is the
// published 0xe220a8397b1dcdaf.
TEST(Hash, ThreeValuesHashAsTheDefinitionSays) {
  EXPECT_EQ(hash_of(std::vector<float>{1.0F, -2.5F, 0.1F}), 0x6c94c3aea2a142fbULL);
  EXPECT_EQ(hash_of(std::vector<double>{1.0, -2.5, 0.1}), 0xd214326fac8c806ULL);
}

TEST(Hash, NothingHashesToZero) {
  EXPECT_EQ(hash_of(std::vector<float>{}), 0U);
  EXPECT_EQ(hash_of(std::vector<double>{}), 0U);
}

TEST(Hash, TheTwoZerosDiffer) {
  EXPECT_EQ(hash_of(std::vector<double>{0.0}), 0x6e789e6aa1b965f4ULL);
  EXPECT_EQ(hash_of(std::vector<double>{-0.0}), 0xc46fa638a6309012ULL);
  EXPECT_NE(hash_of(std::vector<float>{0.0F}), hash_of(std::vector<float>{-0.0F}));
}

TEST(Hash, PositionMatters) {
  EXPECT_NE(hash_of(std::vector<double>{1.0, 2.0}), hash_of(std::vector<double>{2.0, 1.0}));
  EXPECT_NE(hash_of(std::vector<double>{1.0}), hash_of(std::vector<double>{1.0, 0.0}));
}

TEST(Hash, OneUlpChangesIt) {
  const double next = std::bit_cast<double>(std::bit_cast<std::uint64_t>(1.0) + 1);
  EXPECT_NE(hash_of(std::vector<double>{1.0}), hash_of(std::vector<double>{next}));
}

TEST(Hash, EveryNanHashesAlike) {
  for (const std::uint32_t bits : {0x7fc00000U, 0xffc00000U, 0x7f800001U, 0x7fffffffU}) {
    EXPECT_EQ(hash_of(std::vector<float>{std::bit_cast<float>(bits)}),
              hash_of(std::vector<float>{std::numeric_limits<float>::quiet_NaN()}));
  }
  for (const std::uint64_t bits : {0x7ff8000000000000ULL, 0xfff8000000000000ULL, 0x7ff0000000000001ULL}) {
    EXPECT_EQ(hash_of(std::vector<double>{std::bit_cast<double>(bits)}),
              hash_of(std::vector<double>{std::numeric_limits<double>::quiet_NaN()}));
  }
}

TEST(Hash, InfinityIsNotANan) {
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_NE(hash_of(std::vector<double>{infinity}), hash_of(std::vector<double>{infinity - infinity}));
  EXPECT_NE(hash_of(std::vector<double>{infinity}), hash_of(std::vector<double>{-infinity}));
}

TEST(Hash, IsTheSumOfItsParts) {
  const std::vector<double> all{1, -0.0, 2.5, 1, 1e300, -7};
  const std::span<const double> values(all);
  EXPECT_EQ(stiction::hash_part(values.first(2), 0) + stiction::hash_part(values.subspan(2), 2), hash_bits(values));
  EXPECT_NE(stiction::hash_part(values.first(2), 0) + stiction::hash_part(values.subspan(2), 3), hash_bits(values));
  const std::vector<float> single{3, 4, 5};
  const std::span<const float> numbers(single);
  EXPECT_EQ(stiction::hash_part(numbers.first(1), 0) + stiction::hash_part(numbers.subspan(1), 1), hash_bits(numbers));
}

}  // namespace
