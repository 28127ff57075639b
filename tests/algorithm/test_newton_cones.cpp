#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

#include "core/algorithm/newton/cone_response.hpp"
#include "core/algorithm/solver/newton/cone_derivative.hpp"

namespace stiction::test {
namespace {

template <int M>
using Vector = std::array<double, M>;
template <int M>
using Friction = ConeShape<ConeKind::friction, M>;

template <class Shape>
CompliantPoint<Shape::kRows> reaction(Shape shape, const Vector<Shape::kRows>& u, const Vector<Shape::kRows>& R,
                                      double lo = 0.0, double hi = 0.0) {
  constexpr int M = Shape::kRows;
  double motion[M], compliance[M];
  for (std::size_t k = 0; k < M; ++k) {
    motion[k] = u[k];
    compliance[k] = R[k];
  }
  return compliant_point(shape, motion, compliance, lo, hi);
}

/// x_n of a sliding cone, found by halving in extended precision from sum (u_i / ((R_i + R_n) tau + u_n))^2 = 1.
template <int M>
long double normal_by_halving(const Vector<M>& u, const Vector<M>& R) {
  long double low = std::max(0.0L, -static_cast<long double>(u[0]) / R[0]), high = low + 1;
  const auto sum = [&](long double tau) {
    long double squares = 0;
    for (std::size_t k = 1; k < M; ++k) {
      const long double s = u[k] / ((static_cast<long double>(R[k]) + R[0]) * tau + u[0]);
      squares += s * s;
    }
    return squares;
  };
  while (sum(high) > 1) high *= 2;
  for (int step = 0; step < 200; ++step) {
    const long double middle = (low + high) / 2;
    (sum(middle) > 1 ? low : high) = middle;
  }
  return (low + high) / 2;
}

/// Compliances as far apart as torsional friction makes them.
template <int M>
void draw(std::mt19937& random, Vector<M>& u, Vector<M>& R) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> power(-6.0, 0.0);
  for (std::size_t k = 0; k < M; ++k) {
    u[k] = normal(random) * (random() % 4 == 0 ? 1e-3 : 1.0);
    R[k] = std::pow(10.0, power(random));
  }
}

template <int M>
void expect_minimisers() {
  std::mt19937 random(M);
  int slid = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    Vector<M> u, R;
    draw<M>(random, u, R);
    const auto point = reaction(Friction<M>{}, u, R);
    // The minimiser is given by its conditions: x in the cone, y = R x + u in its dual, x y = 0.
    long double x_t = 0, y_t = 0, product = 0, size = 0;
    long double y_n = 0;
    for (std::size_t k = 0; k < M; ++k) {
      const long double x = point.x[k], y = R[k] * x + u[k];
      (k == 0 ? y_n : y_t) += k == 0 ? y : y * y;
      if (k > 0) x_t += x * x;
      product += x * y;
      size += std::abs(R[k] * x * x) + std::abs(u[k] * x);
    }
    x_t = std::sqrt(x_t);
    y_t = std::sqrt(y_t);
    long double largest = 0;
    for (const double entry : u) largest = std::max(largest, static_cast<long double>(std::abs(entry)));
    EXPECT_LE(x_t, point.x[0] * (1 + 1e-15L));
    EXPECT_GE(y_n - y_t, -1e-13L * largest) << M << ", trial " << trial;
    EXPECT_LE(std::abs(product), 1e-12L * size) << M << ", trial " << trial;
    if (point.contact_state != kSliding) continue;
    ++slid;
    const long double tau = normal_by_halving<M>(u, R);
    EXPECT_NEAR(static_cast<double>(point.x[0] / tau), 1.0, 1e-10) << M << ", trial " << trial;
  }
  EXPECT_GT(slid, 500);
}
TEST(CompliantCone, ItsReactionIsTheMinimiserWhateverTheAxesCompliance) {
  expect_minimisers<2>();
  expect_minimisers<3>();
  expect_minimisers<4>();
  expect_minimisers<5>();
  expect_minimisers<6>();
}

template <class Shape>
void expect_derivative(Shape shape, double lo, double hi) {
  constexpr std::size_t M = Shape::kRows;
  std::mt19937 random(77);
  std::normal_distribution<double> normal;
  std::array<int, 3> seen{};
  for (int trial = 0; trial < 300; ++trial) {
    Vector<Shape::kRows> u, R;
    for (std::size_t k = 0; k < M; ++k) {
      u[k] = normal(random);
      R[k] = 0.5 + std::abs(normal(random));
    }
    const auto point = reaction(shape, u, R, lo, hi);
    double C[M][M], compliance[M];
    for (std::size_t k = 0; k < M; ++k) compliance[k] = R[k];
    compliance_factor(shape, point, compliance, C);
    ++seen.at(static_cast<std::size_t>(point.contact_state));
    for (std::size_t j = 0; j < M; ++j) {
      constexpr double kStepLength = 1e-6;
      Vector<Shape::kRows> ahead = u, behind = u;
      ahead[j] += kStepLength;
      behind[j] -= kStepLength;
      const auto after = reaction(shape, ahead, R, lo, hi);
      const auto before = reaction(shape, behind, R, lo, hi);
      if (after.contact_state != point.contact_state || before.contact_state != point.contact_state) continue;
      for (std::size_t i = 0; i < M; ++i) {
        double w = 0.0;
        for (std::size_t k = 0; k < M; ++k) w += C[i][k] * C[j][k];
        // A central difference has two errors: rounding 1e-16 / 1e-6, and the square of the step times a third
        // derivative. The latter grows as the inverse square of the distance from the apex.
        EXPECT_NEAR(w, (before.x[i] - after.x[i]) / (2 * kStepLength), 1e-6)
            << i << j << ", zone " << point.contact_state;
      }
    }
  }
  EXPECT_GT(seen[kSticking], 10);
  if (Shape::kKind != ConeKind::free) {
    EXPECT_GT(seen[kSeparating], 10);
  }
  if (Shape::kKind == ConeKind::friction) {
    EXPECT_GT(seen[kSliding], 10);
  }
}
TEST(CompliantCone, ItsFactorIsThatOfTheDerivative) {
  expect_derivative(ConeShape<ConeKind::free, 1>{}, 0, 0);
  expect_derivative(ConeShape<ConeKind::unilateral, 1>{}, 0, 0);
  expect_derivative(ConeShape<ConeKind::box, 1>{}, -0.5, 0.25);
  expect_derivative(Friction<2>{}, 0, 0);
  expect_derivative(Friction<3>{}, 0, 0);
  expect_derivative(Friction<4>{}, 0, 0);
}

/// Slope of a cone with one compliance along both axes.
std::array<Vector<3>, 3> slope_of(const CompliantPoint<3>& point, const Vector<3>& R) {
  const double compliance[] = {R[0], R[1], R[2]};
  double C[3][3];
  compliance_factor(Friction<3>{}, point, compliance, C);
  std::array<Vector<3>, 3> W{};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      for (std::size_t k = 0; k < 3; ++k) W[i][j] += C[i][k] * C[j][k];
  return W;
}

TEST(CompliantCone, OneComplianceForBothAxesHasAnAnswerWithoutSteps) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  std::array<int, 3> seen{};
  for (int trial = 0; trial < 500; ++trial) {
    const Vector<3> u{normal(random), normal(random), normal(random)};
    const double R_n = 0.1 + std::abs(normal(random)), R_t = 0.1 + std::abs(normal(random));
    const auto point = reaction(Friction<3>{}, u, {R_n, R_t, R_t});
    ++seen.at(static_cast<std::size_t>(point.contact_state));
    const double length = std::hypot(u[1], u[2]);
    const auto found = cone_reaction(ConeLaw<double>{1 / R_n, 1 / R_t, 1 / (R_n + R_t)}, u[0], length);
    const Vector<3> d{0, -u[1] / length, -u[2] / length};
    EXPECT_NEAR(found.x_n, point.x[0], 1e-12);
    const auto W = slope_of(point, {R_n, R_t, R_t});
    EXPECT_NEAR(found.normal, W[0][0], 1e-11);
    for (std::size_t i = 1; i < 3; ++i) {
      EXPECT_NEAR(-found.across * u[i], point.x[i], 1e-12);
      EXPECT_NEAR(found.slide * d[i], W[0][i], 1e-11);
      for (std::size_t j = 1; j < 3; ++j)
        EXPECT_NEAR((i == j ? found.across : 0) + found.bend * d[i] * d[j], W[i][j], 1e-11);
    }
  }
  for (const int count : seen) EXPECT_GT(count, 50);
}

TEST(CompliantCone, AContactsOwnUnitsMakeItTheNearestPoint) {
  std::mt19937 random(6);
  std::normal_distribution<double> normal;
  int slid = 0;
  for (const double mu : {1e-3, 0.5, 1.0, 20.0})
    for (int trial = 0; trial < 200; ++trial) {
      const double z[] = {normal(random), normal(random), normal(random)};
      const auto nearest = project_friction_cone(z, mu);
      const Vector<3> R{1, mu * mu, mu * mu};
      const auto point = reaction(Friction<3>{}, {-z[0], -mu * z[1], -mu * z[2]}, R);
      const auto W = slope_of(point, R);
      slid += point.contact_state == kSliding ? 1 : 0;
      for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_NEAR(nearest.x[i], (i == 0 ? 1 : mu) * point.x[i], 1e-12);
        for (std::size_t j = 0; j < 3; ++j)
          EXPECT_NEAR(nearest.P[i][j], (i == 0 ? 1 : mu) * (j == 0 ? 1 : mu) * W[i][j], 1e-11) << mu << i << j;
      }
    }
  EXPECT_GT(slid, 200);
  const double inside[] = {2, 1, -1}, below[] = {-2, 0.1, 0};
  EXPECT_TRUE(project_friction_cone(inside, 1).is_inside);
  EXPECT_EQ(project_friction_cone(inside, 1).x[2], -1);
  EXPECT_FALSE(project_friction_cone(inside, 0).is_inside && project_friction_cone(inside, 0).x[1] != 0);
  EXPECT_EQ(project_friction_cone(inside, 0).x[0], 2);
  EXPECT_EQ(project_friction_cone(below, 0.5).x[0], 0);
}

TEST(CompliantCone, TheApexAndAxesWithoutFrictionMakeNoNan) {
  for (const Vector<3>& u : {Vector<3>{0, 0, 0}, Vector<3>{-1, 0, 0}, Vector<3>{1, 0, 0}, Vector<3>{0, 1, 0},
                             Vector<3>{1, 1, 0}, Vector<3>{-1, 1, 0}, Vector<3>{0, 1e-300, 1e-300},
                             Vector<3>{-1e-300, 1e-300, 0}, Vector<3>{1e300, -1e300, 1e300}}) {
    const auto point = reaction(Friction<3>{}, u, {1e-3, 1, 1e-6});
    double C[3][3];
    const double R[3] = {1e-3, 1, 1e-6};
    compliance_factor(Friction<3>{}, point, R, C);
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_TRUE(std::isfinite(point.x[i])) << u[0] << " " << u[1];
      for (std::size_t j = 0; j < 3; ++j) EXPECT_TRUE(std::isfinite(C[i][j])) << u[0] << " " << u[1];
    }
  }
}

template <int M>
void expect_projection_derivative() {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 500; ++trial) {
    double z[M], P[M][M];
    for (double& entry : z) entry = normal(random);
    // Away from the kinks, where there are many derivatives.
    if (std::abs(std::abs(z[0]) - tangential_norm<M>(z)) < 1e-3) continue;
    projection_derivative(Friction<M>{}, z, 0.0, 0.0, P);
    for (int j = 0; j < M; ++j) {
      constexpr double kStepLength = 1e-6;
      double ahead[M], behind[M];
      for (int k = 0; k < M; ++k) ahead[k] = behind[k] = z[k];
      ahead[j] += kStepLength;
      behind[j] -= kStepLength;
      project_second_order_cone<M>(ahead);
      project_second_order_cone<M>(behind);
      for (int i = 0; i < M; ++i)
        EXPECT_NEAR(P[i][j], (ahead[i] - behind[i]) / (2 * kStepLength), 1e-6) << M << ": " << i << j;
    }
  }
}
TEST(ConeDerivative, IsTheDerivativeOfTheProjection) {
  expect_projection_derivative<2>();
  expect_projection_derivative<3>();
  expect_projection_derivative<6>();
}

}  // namespace
}  // namespace stiction::test
