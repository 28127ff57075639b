#include "stiction/pyramid.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "stiction/error.hpp"
#include "tests/support/machines/solve_alone.hpp"
#include "tests/support/oracles/oracle.hpp"
#include "tests/support/systems/random_systems.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace stiction::test {
namespace {

using Matrix = std::vector<std::vector<double>>;

const double kPi = std::acos(-1.0);

/// Rows of E' for one environment, from the definition.
Matrix edges_by_definition(const Environment<double>& env, int sides) {
  const std::size_t n = env.b.size();
  Matrix edges;
  std::size_t row = 0;
  for (const Cone& cone : env.cones) {
    const auto m = static_cast<std::size_t>(cone.row_count);
    std::vector<double> normal(n, 0.0);
    normal[row] = 1.0;
    std::size_t axes = 0;
    for (std::size_t k = 1; k < m; ++k) axes += env.mu[row + k] > 0 ? 1U : 0U;
    if (axes == 0) edges.push_back(normal);
    if (m == 3 && axes == 2) {
      for (int i = 0; i < sides; ++i) {
        edges.push_back(normal);
        edges.back()[row + 1] = env.mu[row + 1] * std::cos(2 * kPi * i / sides);
        edges.back()[row + 2] = env.mu[row + 2] * std::sin(2 * kPi * i / sides);
      }
    } else {
      for (std::size_t k = 1; k < m; ++k)
        for (const double sign : {1.0, -1.0}) {
          if (env.mu[row + k] == 0) continue;
          edges.push_back(normal);
          edges.back()[row + k] = sign * env.mu[row + k];
        }
    }
    row += m;
  }
  return edges;
}

TEST(Pyramid, TheMatrixIsTheOneOfTheEdges) {
  for (std::uint64_t seed = 1; seed < 12; ++seed) {
    Recipe recipe;
    recipe.seed = seed;
    recipe.contacts = 4;
    recipe.others = 3;
    Environment<double> env = random_contacts(recipe);
    const int sides = seed % 3 == 0 ? 4 : seed % 3 == 1 ? 8 : 16;
    const Matrix edges = edges_by_definition(env, sides);
    const auto pyramids = linearise(batch_of({env, env}), sides);
    ASSERT_EQ(pyramids.batch.row_count(), 2 * static_cast<Offset>(edges.size()));
    EXPECT_TRUE(validate(pyramids.batch.view()).empty()) << validate(pyramids.batch.view()).front().message;
    // The second environment, so that offsets matter.
    const auto view = pyramids.batch.view();
    const Offset first = view.env_row_offsets[1];
    const auto a = oracle::detail::dense_matrix(env);
    const std::size_t n = env.b.size();
    for (std::size_t e = 0; e < edges.size(); ++e) {
      const Offset row = first + static_cast<Offset>(e);
      double b = 0.0;
      for (std::size_t i = 0; i < n; ++i) b += edges[e][i] * env.b[i];
      EXPECT_NEAR(view.b[row], b, 1e-14);
      std::vector<double> stored(edges.size(), 0.0);
      stored[e] = view.R[row];
      for (Offset k = view.row_offsets[row]; k < view.row_offsets[row + 1]; ++k)
        stored[static_cast<std::size_t>(view.column[k])] += view.A[k];
      for (std::size_t f = 0; f < edges.size(); ++f) {
        double expected = 0.0;
        for (std::size_t i = 0; i < n; ++i)
          for (std::size_t j = 0; j < n; ++j) expected += edges[e][i] * static_cast<double>(a[i * n + j]) * edges[f][j];
        EXPECT_NEAR(stored[f], expected, 1e-12) << "seed " << seed << ", edges " << e << " and " << f;
      }
    }
  }
}

TEST(Pyramid, RowsWithoutFrictionPassThrough) {
  Environment<double> env =
      system({free_row(), friction(2), box(), unilateral()}, diagonal({1, 2, 3, 4, 5}), {-1, -2, -3, -4, -5});
  env.mu = {0, 0, 0.5, 0, 0};
  env.R = {0.1, 0.2, 0.3, 0.4, 0.5};
  env.lo = {0, 0, 0, -1, 0};
  env.hi = {0, 0, 0, std::numeric_limits<double>::infinity(), 0};
  const auto pyramids = linearise(batch_of({env}, Law::coulomb), 4);
  const auto& arrays = pyramids.batch.arrays();
  EXPECT_EQ(pyramids.batch.law(), Law::convex);
  EXPECT_EQ(arrays.cone_kind, (std::vector<ConeKind>{ConeKind::free, ConeKind::unilateral, ConeKind::unilateral,
                                                     ConeKind::box, ConeKind::unilateral}));
  EXPECT_EQ(arrays.R, (std::vector<double>{0.1, 0, 0, 0.4, 0.5}));
  EXPECT_EQ(arrays.lo, (std::vector<double>{0, 0, 0, -1, 0}));
  EXPECT_EQ(arrays.hi, env.hi);
  EXPECT_EQ(pyramids.first_edge, (std::vector<Offset>{0, 1, 3, 4, 5}));
  // b' = b_n +- mu b_t.
  EXPECT_EQ(arrays.b, (std::vector<double>{-1, -3.5, -0.5, -4, -5}));
}

TEST(Pyramid, AnAxisWithoutFrictionHasNoEdges) {
  const auto edges = [](const std::vector<double>& mu) {
    Environment<double> env = system({friction(static_cast<Index>(mu.size()))},
                                     diagonal(std::vector<double>(mu.size(), 1.0)), std::vector<double>(mu.size(), 1));
    env.mu = mu;
    return linearise(batch_of({env}), 8).batch.row_count();
  };
  EXPECT_EQ(edges({0, 0.5, 0.5}), 8);
  EXPECT_EQ(edges({0, 0.5, 0}), 2) << "the edges between lie within the two";
  EXPECT_EQ(edges({0, 0, 0}), 1);
  EXPECT_EQ(edges({0, 0}), 1);
  EXPECT_EQ(edges({0, 0.5, 0.5, 0.1}), 6);
  EXPECT_EQ(edges({0, 0.5, 0.5, 0, 0.1, 0.1}), 8);
}

TEST(Pyramid, ContactsThatShareNoEntryShareNone) {
  Environment<double> env = system({friction(), friction()}, diagonal({1, 1, 1, 1, 1, 1}), {-1, 0, 0, -1, 0, 0});
  env.mu = {0, 0.5, 0.5, 0, 0.5, 0.5};
  const auto pyramids = linearise(batch_of({env}), 16);
  EXPECT_EQ(pyramids.batch.view().nonzero_count, 2 * 16 * 16);
}

/// The convex law's block of hand_answers.hpp: unit mass, pressed with 2 and sliding with 3, mu = 1/2.
struct Slide {
  double normal, friction;
};

Slide slide_on_pyramid(int sides, double angle) {
  const Environment<double> env = contact({1, 1, 1}, {-2, 3 * std::cos(angle), 3 * std::sin(angle)}, 0.5);
  const auto batch = batch_of({env});
  const auto pyramids = linearise(batch, sides);
  const auto solution = solve_alone(pyramids.batch, options(SolverKind::lemke, 1e-12, 1000));
  EXPECT_EQ(solution.status[0].code, EnvCode::solved);
  const auto back = reactions(pyramids, batch, std::span<const double>(solution.lambda));
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(back.w[i], back.lambda[i] + env.b[i], 1e-15);
  return {back.lambda[0], std::hypot(back.lambda[1], back.lambda[2])};
}

TEST(Pyramid, ASlidingBlockHasTheAnswerOfThePyramidsFace) {
  // Towards the middle of a face the pyramid is a cone of mu cos(pi / K): n - 2 = mu' (3 - mu' n).
  for (const int sides : {4, 8, 16}) {
    const double mu = 0.5 * std::cos(kPi / sides);
    const double normal = (2 + 3 * mu) / (1 + mu * mu);
    const Slide slide = slide_on_pyramid(sides, kPi / sides);
    EXPECT_NEAR(slide.normal, normal, 1e-13) << sides;
    EXPECT_NEAR(slide.friction, mu * normal, 1e-13) << sides;
  }
}

TEST(Pyramid, AlongAnEdgeItIsTheCone) {
  for (const int sides : {4, 8, 16}) {
    const Slide slide = slide_on_pyramid(sides, kPi / 2);
    EXPECT_NEAR(slide.normal, 2.8, 1e-13) << sides;
    EXPECT_NEAR(slide.friction, 1.4, 1e-13) << sides;
  }
}

TEST(Pyramid, TheErrorAgainstTheCircularConeFallsWithTheSquareOfTheSides) {
  // The cone's answer is n = 2.8, friction 1.4, in any direction.
  double before = 0.0;
  for (const int sides : {4, 8, 16}) {
    const double error = std::abs(slide_on_pyramid(sides, kPi / sides).friction - 1.4);
    if (before > 0.0) {
      EXPECT_NEAR(before / error, 4.0, 0.5) << sides;
    }
    before = error;
  }
}

TEST(Pyramid, ManySidesComeCloseToTheConesOptimum) {
  Recipe recipe;
  recipe.contacts = 3;
  recipe.others = 3;
  int compared = 0;
  for (std::uint64_t seed = 20; seed < 120; ++seed) {
    recipe.seed = seed;
    Environment<double> env = random_contacts(recipe);
    if (std::any_of(env.cones.begin(), env.cones.end(), [](const Cone& c) { return c.row_count > 3; })) continue;
    const auto objective = [&](const std::vector<double>& lambda) {
      const auto a = oracle::detail::dense_matrix(env);
      const std::size_t n = lambda.size();
      double sum = 0.0;
      for (std::size_t i = 0; i < n; ++i) {
        sum += env.b[i] * lambda[i];
        for (std::size_t j = 0; j < n; ++j) sum += 0.5 * lambda[i] * static_cast<double>(a[i * n + j]) * lambda[j];
      }
      return sum;
    };
    const auto batch = batch_of({env});
    const double optimum = objective(oracle::solve_convex(env).lambda);
    double before = std::numeric_limits<double>::infinity();
    for (const int sides : {4, 8, 16}) {
      const auto pyramids = linearise(batch, sides);
      const auto solution = solve_alone(pyramids.batch, options(SolverKind::lemke, 1e-10, 10000));
      ASSERT_EQ(solution.status[0].code, EnvCode::solved) << seed;
      const double reached = objective(reactions(pyramids, batch, std::span<const double>(solution.lambda)).lambda);
      // Pyramids of 4, 8 and 16 sides contain one another, and the cone contains them all.
      EXPECT_GE(reached, optimum - 1e-9 * std::abs(optimum)) << seed;
      EXPECT_LE(reached, before + 1e-9 * std::abs(optimum)) << seed;
      before = reached;
    }
    // A cone of 0.98 mu fits into the pyramid, so that at most some 4 % of the optimum is lost.
    EXPECT_LE(before, optimum + 0.05 * std::abs(optimum)) << seed;
    ++compared;
  }
  EXPECT_GE(compared, 3) << "environments whose contacts all have two or three rows";
}

TEST(Pyramid, WhatCannotBeLinearisedIsRefusedByName) {
  const auto refusal = [](const ContactBatch<double>& batch, int sides) -> std::string {
    try {
      (void)linearise(batch, sides);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  const auto batch = batch_of({contact({1, 1, 1}, {-2, 3, 0}, 0.5)});
  EXPECT_NE(refusal(batch, 6).find("sides = 6"), std::string::npos);
  EXPECT_NE(refusal(batch_of({contact({1, 1, 1}, {-2, 3, 0}, -0.5)}), 4).find("mu[cone 0, row 1]"), std::string::npos);
  const auto pyramids = linearise(batch, 4);
  const std::vector<double> three(3, 0.0);
  EXPECT_THROW((void)reactions(pyramids, batch, std::span<const double>(three)), Error);
  auto arrays = batch.arrays();
  arrays.factor_offsets = {0, 3};
  arrays.factor = {1, 1, 1};
  arrays.row_offsets = {0, 0, 0, 0};
  arrays.column.clear();
  arrays.A.clear();
  EXPECT_NE(refusal(ContactBatch<double>::from_arrays(Law::convex, arrays), 4).find("factor"), std::string::npos);
}

}  // namespace
}  // namespace stiction::test
