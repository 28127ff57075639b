#include "core/base/pack.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/algorithm/problem/cone_projection.hpp"
#include "scenes/rng.hpp"

namespace {

using namespace stiction;

template <class P>
struct PackOf;
template <class T, int W>
struct PackOf<Pack<T, W>> {
  using Scalar = T;
  static constexpr int kWidth = W;
};

template <class T>
auto bits(T value) {
  if constexpr (sizeof(T) == 4) {
    return std::bit_cast<std::uint32_t>(value);
  } else {
    return std::bit_cast<std::uint64_t>(value);
  }
}

/// Numbers of every sort: ordinary, tiny, huge, zeros of both signs, infinities and NaN.
template <class T>
std::vector<T> samples(std::size_t count) {
  const T special[] = {T(0),
                       T(-0.0),
                       T(1),
                       T(-1),
                       std::numeric_limits<T>::infinity(),
                       -std::numeric_limits<T>::infinity(),
                       std::numeric_limits<T>::quiet_NaN(),
                       std::numeric_limits<T>::denorm_min(),
                       std::numeric_limits<T>::max(),
                       std::numeric_limits<T>::min()};
  scenes::Rng rng(99);
  std::vector<T> values;
  while (values.size() < count) {
    if (rng.chance(0.3)) {
      values.push_back(special[rng.below(10)]);
    } else {
      const double magnitude = std::ldexp(1.0, rng.below(40) - 20);
      values.push_back(static_cast<T>(rng.symmetric(1.0) * magnitude));
    }
  }
  return values;
}

template <class P>
class PackLanes : public testing::Test {};
// Widths of all three instruction sets: on the baseline build the wide ones are the compiler's emulation.
using Packs =
    testing::Types<Pack<float, 4>, Pack<float, 8>, Pack<float, 16>, Pack<double, 2>, Pack<double, 4>, Pack<double, 8>>;
TYPED_TEST_SUITE(PackLanes, Packs);

TYPED_TEST(PackLanes, EveryOperationDoesInEachLaneWhatTheScalarDoes) {
  using P = TypeParam;
  using T = typename PackOf<P>::Scalar;
  constexpr int kWidth = PackOf<P>::kWidth;
  const auto x = samples<T>(3 * 4000);
  for (std::size_t at = 0; at + 3 * kWidth <= x.size(); at += 3 * kWidth) {
    P a(T(0)), b(T(0)), c(T(0));
    for (int l = 0; l < kWidth; ++l) {
      a.v[l] = x[at + static_cast<std::size_t>(l)];
      b.v[l] = x[at + static_cast<std::size_t>(kWidth + l)];
      c.v[l] = x[at + static_cast<std::size_t>(2 * kWidth + l)];
    }
    const auto same = [&](const char* what, P packed, auto&& scalar) {
      for (int l = 0; l < kWidth; ++l) {
        const T expected = scalar(T(a.v[l]), T(b.v[l]), T(c.v[l]));
        const T got = packed.v[l];
        // Payloads and signs of NaN are the machine's affair; that it is NaN is not.
        if (std::isnan(expected)) {
          ASSERT_TRUE(std::isnan(got)) << what;
        } else {
          ASSERT_EQ(bits(got), bits(expected)) << what << " of " << T(a.v[l]) << ", " << T(b.v[l]) << ", " << T(c.v[l]);
        }
      }
    };
    same("sum", a + b, [](T p, T q, T) { return p + q; });
    same("difference", a - b, [](T p, T q, T) { return p - q; });
    same("product", a * b, [](T p, T q, T) { return p * q; });
    same("quotient", div_(a, b), [](T p, T q, T) { return div_(p, q); });
    same("fma", fma_(a, b, c), [](T p, T q, T r) { return fma_(p, q, r); });
    same("root", sqrt_(a), [](T p, T, T) { return sqrt_(p); });
    same("max", max_(a, b), [](T p, T q, T) { return max_(p, q); });
    same("min", min_(a, b), [](T p, T q, T) { return min_(p, q); });
    same("clamp", clamp_(a, b, c), [](T p, T q, T r) { return clamp_(p, q, r); });
    same("abs", abs_(a), [](T p, T, T) { return abs_(p); });
    same("zero", canonical_zero(a), [](T p, T, T) { return canonical_zero(p); });
    same("select <", select(a < b, b, c), [](T p, T q, T r) { return select(p < q, q, r); });
    same("select >", select(a > b, b, c), [](T p, T q, T r) { return select(p > q, q, r); });
    same("select <=", select(a <= b, b, c), [](T p, T q, T r) { return select(p <= q, q, r); });
    same("select >=", select(a >= b, b, c), [](T p, T q, T r) { return select(p >= q, q, r); });
    same("select ==", select(a == b, b, c), [](T p, T q, T r) { return select(p == q, q, r); });
    same("select !=", select(a != b, b, c), [](T p, T q, T r) { return select(p != q, q, r); });
    same("select and", select(and_(a < b, b < c), b, c), [](T p, T q, T r) { return select(p < q && q < r, q, r); });
    same("select or", select(or_(a < b, b < c), b, c), [](T p, T q, T r) { return select(p < q || q < r, q, r); });
    same("select not", select(not_(a < b), b, c), [](T p, T q, T r) { return select(!(p < q), q, r); });
    same("finite", select(finite_(a), b, c), [](T p, T q, T r) { return select(finite_(p), q, r); });
  }
}

TYPED_TEST(PackLanes, AProjectionDoesInEachLaneWhatTheScalarDoes) {
  using P = TypeParam;
  using T = typename PackOf<P>::Scalar;
  constexpr int kWidth = PackOf<P>::kWidth;
  const auto x = samples<T>(3 * 4000);
  for (std::size_t at = 0; at + 3 * kWidth <= x.size(); at += 3 * kWidth) {
    P packed[3] = {P(T(0)), P(T(0)), P(T(0))};
    for (std::size_t k = 0; k < 3; ++k)
      for (int l = 0; l < kWidth; ++l) packed[k].v[l] = x[at + k * kWidth + static_cast<std::size_t>(l)];
    P projected[3] = {packed[0], packed[1], packed[2]};
    project_second_order_cone<3>(projected);
    for (int l = 0; l < kWidth; ++l) {
      T scalar[3] = {packed[0].v[l], packed[1].v[l], packed[2].v[l]};
      project_second_order_cone<3>(scalar);
      for (std::size_t k = 0; k < 3; ++k) {
        const T got = projected[k].v[l];
        if (std::isnan(scalar[k])) {
          ASSERT_TRUE(std::isnan(got));
        } else {
          ASSERT_EQ(bits(got), bits(scalar[k]));
        }
      }
    }
  }
}

TYPED_TEST(PackLanes, AnyAsksAllLanes) {
  using P = TypeParam;
  using T = typename PackOf<P>::Scalar;
  P a(T(0));
  EXPECT_FALSE(any(a > P(T(1))));
  for (int lane = 0; lane < PackOf<P>::kWidth; ++lane) {
    P one(T(0));
    one.v[lane] = T(2);
    EXPECT_TRUE(any(one > P(T(1)))) << lane;
    EXPECT_TRUE(any(not_(one == P(T(0))))) << lane;
  }
}

TYPED_TEST(PackLanes, ABroadcastReachesEveryLaneExactly) {
  using P = TypeParam;
  using T = typename PackOf<P>::Scalar;
  for (const T value : {T(0.1), T(-3), std::numeric_limits<T>::infinity(), T(0)})
    for (int lane = 0; lane < PackOf<P>::kWidth; ++lane) EXPECT_EQ(bits(T(P(value).v[lane])), bits(value));
}

}  // namespace
