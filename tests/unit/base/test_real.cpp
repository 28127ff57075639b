#include "core/base/real.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

namespace {

using namespace stiction;

template <class Real>
class RealNumbers : public testing::Test {
 protected:
  static constexpr Real kNan = std::numeric_limits<Real>::quiet_NaN();
  static constexpr Real kInfinity = std::numeric_limits<Real>::infinity();
};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(RealNumbers, Precisions);

TYPED_TEST(RealNumbers, MaxAndMinAreSelectsWhoseSecondArgumentWinsTiesAndNaN) {
  using Real = TypeParam;
  EXPECT_EQ(max_(Real(1), Real(2)), Real(2));
  EXPECT_EQ(min_(Real(1), Real(2)), Real(1));
  EXPECT_EQ(max_(this->kNan, Real(2)), Real(2));
  EXPECT_EQ(min_(this->kNan, Real(2)), Real(2));
  EXPECT_TRUE(std::isnan(max_(Real(2), this->kNan)));
  // Equal operands of different sign: always the second, where fmax leaves it open.
  EXPECT_TRUE(std::signbit(max_(Real(0), Real(-0.0))));
  EXPECT_FALSE(std::signbit(max_(Real(-0.0), Real(0))));
  EXPECT_TRUE(std::signbit(min_(Real(0), Real(-0.0))));
}

TYPED_TEST(RealNumbers, ClampKeepsTheInsideAndItsBounds) {
  using Real = TypeParam;
  EXPECT_EQ(clamp_(Real(0.5), Real(-1), Real(1)), Real(0.5));
  EXPECT_EQ(clamp_(Real(5), Real(-1), Real(1)), Real(1));
  EXPECT_EQ(clamp_(Real(-5), Real(-1), Real(1)), Real(-1));
  EXPECT_EQ(clamp_(Real(-5), -this->kInfinity, this->kInfinity), Real(-5));
}

TYPED_TEST(RealNumbers, FiniteTellsNumbersFromTheRest) {
  using Real = TypeParam;
  EXPECT_TRUE(finite_(Real(0)));
  EXPECT_TRUE(finite_(std::numeric_limits<Real>::max()));
  EXPECT_TRUE(finite_(std::numeric_limits<Real>::denorm_min()));
  EXPECT_FALSE(finite_(this->kInfinity));
  EXPECT_FALSE(finite_(-this->kInfinity));
  EXPECT_FALSE(finite_(this->kNan));
}

TYPED_TEST(RealNumbers, MinusZeroBecomesZeroAndNothingElseChanges) {
  using Real = TypeParam;
  EXPECT_FALSE(std::signbit(canonical_zero(Real(-0.0))));
  EXPECT_EQ(canonical_zero(std::numeric_limits<Real>::denorm_min()), std::numeric_limits<Real>::denorm_min());
  EXPECT_EQ(canonical_zero(Real(-1.5)), Real(-1.5));
}

TYPED_TEST(RealNumbers, AbsoluteValueOfANumber) {
  using Real = TypeParam;
  EXPECT_EQ(abs_(Real(-2)), Real(2));
  EXPECT_EQ(abs_(Real(2)), Real(2));
  EXPECT_EQ(abs_(-this->kInfinity), this->kInfinity);
  EXPECT_TRUE(std::isnan(abs_(this->kNan)));
}

TYPED_TEST(RealNumbers, FusedMultiplyAddRoundsOnce) {
  using Real = TypeParam;
  const Real e = std::numeric_limits<Real>::epsilon();
  // (1 + e)(1 - e) - 1 = -e^2 exactly; with a rounding of the product it would be 0 or -e.
  EXPECT_EQ(fma_(Real(1) + e, Real(1) - e, Real(-1)), -e * e);
}

TYPED_TEST(RealNumbers, ProductsAndSumsAreNotFusedBehindOurBack) {
  using Real = TypeParam;
  const Real e = std::numeric_limits<Real>::epsilon();
  volatile Real a = Real(1) + e, b = Real(1) - e;
  const Real x = a, y = b;
  // The product rounds to 1 (ties to even), so the difference is 0.
  EXPECT_EQ(x * y - Real(1), Real(0));
}

TYPED_TEST(RealNumbers, UnitScaleIsThePowerOfTwoThatBringsANumberToOneToTwo) {
  using Real = TypeParam;
  const Real values[] = {Real(1),   Real(1.999), Real(2),    Real(3),
                         Real(0.1), Real(1e-20), Real(1e20), std::numeric_limits<Real>::min()};
  for (const Real value : values) {
    const Real scale = unit_scale(value);
    int exponent = 0;
    EXPECT_EQ(std::frexp(scale, &exponent), Real(0.5)) << "a power of two";
    EXPECT_GE(value * scale, Real(1));
    EXPECT_LT(value * scale, Real(2));
  }
}

TYPED_TEST(RealNumbers, UnitScaleOfAnythingElseIsOneAndItsInverseNeverOverflows) {
  using Real = TypeParam;
  const Real largest = std::numeric_limits<Real>::max();
  for (const Real value : {Real(0), Real(-3), this->kNan, this->kInfinity, std::numeric_limits<Real>::denorm_min()})
    EXPECT_EQ(unit_scale(value), Real(1));
  EXPECT_TRUE(std::isnormal(unit_scale(largest)) && std::isnormal(Real(1) / unit_scale(largest)));
  EXPECT_TRUE(std::isnormal(unit_scale(std::numeric_limits<Real>::min())));
}

TEST(RealBits, AMultiplicationByTheUnitScaleIsExact) {
  for (std::uint64_t k = 1; k < 2000; ++k) {
    const double value = 0.1 * static_cast<double>(k * k);
    const double scaled = value * unit_scale(value);
    EXPECT_EQ(std::bit_cast<std::uint64_t>(scaled / unit_scale(value)), std::bit_cast<std::uint64_t>(value));
  }
}

}  // namespace
