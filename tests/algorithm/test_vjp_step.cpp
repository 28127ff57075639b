// Steps of one cone in reverse, against differences of the step itself.
#include "core/algorithm/unrolled/vjp_step.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <gtest/gtest.h>

#include "scenes/rng.hpp"

namespace {

using namespace stiction;

/// One cone and the motion that its step sees, as numbers in a row: B, then x, then y.
template <int M>
struct Numbers {
  static constexpr int kCount = M * M + 2 * M;
  double at[kCount];
};

template <int M>
LoneCone<M> lone(const Numbers<M>& numbers) {
  LoneCone<M> cone{};
  for (int i = 0; i < M; ++i) {
    for (int j = 0; j < M; ++j) cone.B[i][j] = numbers.at[i * M + j];
    cone.x[i] = numbers.at[M * M + i];
  }
  cone.measure();
  return cone;
}

/// bar times the reaction after the step.
template <Law kLaw, int M>
double loss(const Numbers<M>& numbers, double omega, const double (&bar)[M]) {
  const LoneCone<M> cone = lone(numbers);
  double y[M], sum = 0;
  for (int k = 0; k < M; ++k) y[k] = numbers.at[M * M + M + k];
  const auto step = local_step<kLaw>(ConeShape<ConeKind::friction, M>{}, cone, 0, 0, y, omega);
  for (int k = 0; k < M; ++k) sum += bar[k] * (cone.x[k] + step.d[k]);
  return sum;
}

/// Differences of cones whose last axes have friction of their own; where the two sides differ, the step has an edge.
template <Law kLaw, int M>
void compare(double own, int own_axes) {
  int uneven = 0, used = 0, outside = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    scenes::Rng rng(seed);
    double G[M][M], scale[M], bar[M];
    for (int i = 0; i < M; ++i) {
      scale[i] = i >= M - own_axes ? own : i == 0 ? 1 : 0.7;
      bar[i] = rng.symmetric(1.0);
      for (int j = 0; j < M; ++j) G[i][j] = rng.symmetric(0.4) + (i == j ? 1.0 : 0.0);
    }
    Numbers<M> numbers;
    for (int i = 0; i < M; ++i) {
      for (int j = 0; j < M; ++j) {
        double sum = 0;
        for (int k = 0; k < M; ++k) sum += G[i][k] * G[j][k];
        numbers.at[i * M + j] = sum * scale[i] * scale[j];
      }
      numbers.at[M * M + i] = i == 0 ? 0.3 : rng.symmetric(0.3);
      numbers.at[M * M + M + i] = (rng.symmetric(1.0) - (i == 0 ? 0.3 : 0.0)) * scale[i];
    }
    const double omega = seed % 2 == 0 ? 1.0 : 0.8;
    const LoneCone<M> cone = lone(numbers);
    if (is_uneven<M>(cone, 0)) ++uneven;
    double y[M];
    for (int k = 0; k < M; ++k) y[k] = numbers.at[M * M + M + k];
    LoneConeBar<M> to;
    local_step_vjp<kLaw>(ConeShape<ConeKind::friction, M>{}, cone, y, omega, bar, to);
    measures_vjp(cone, to);
    double norm = 0, after[M];
    const auto step = local_step<kLaw>(ConeShape<ConeKind::friction, M>{}, cone, 0, 0, y, omega);
    for (int k = 0; k < M; ++k) after[k] = cone.x[k] + step.d[k];
    for (int k = 1; k < M; ++k) norm += after[k] * after[k];
    if (after[0] > 0 && std::sqrt(norm) > 0.999 * after[0]) ++outside;
    const double here = loss<kLaw, M>(numbers, omega, bar);
    for (int direction = 0; direction < 4; ++direction) {
      Numbers<M> moved[2] = {numbers, numbers};
      double slope = 0, size = 1e-6;
      for (int i = 0; i < Numbers<M>::kCount; ++i) {
        const double change = rng.symmetric(1.0) * numbers.at[i];
        const double by = i < M * M ? to.B[i / M][i % M] : i < M * M + M ? to.x[i - M * M] : to.y[i - M * M - M];
        slope += by * change;
        size += std::abs(by * change);
        moved[0].at[i] += 1e-6 * change;
        moved[1].at[i] -= 1e-6 * change;
      }
      const double up = loss<kLaw, M>(moved[0], omega, bar) - here, down = here - loss<kLaw, M>(moved[1], omega, bar);
      if (std::abs(up - down) > 1e-10 * size) continue;
      ++used;
      EXPECT_NEAR(5e5 * (up + down), slope, 1e-6 * size) << "seed " << seed << ", own friction " << own;
    }
  }
  EXPECT_GE(used, 200);
  EXPECT_GE(outside, 12);
  if (own < 0.3 || own > 2.0) {
    EXPECT_EQ(uneven, 60);
  }
}

TEST(VjpStep, IsThatOfDifferencesWithAnyFrictionOfAnAxis) {
  for (const double own : {1e-5, 1e-3, 0.05, 0.7, 1.5, 40.0, 1e4}) {
    compare<Law::convex, 3>(own, 1);
    compare<Law::convex, 4>(own, 1);
    compare<Law::convex, 6>(own, 3);
    compare<Law::coulomb, 3>(own, 1);
    compare<Law::coulomb, 4>(own, 1);
    compare<Law::coulomb, 6>(own, 3);
  }
}

}  // namespace
