#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "stiction/error.hpp"
#include "tests/support/machines/preconditioner_room.hpp"
#include "tests/support/machines/stress_team.hpp"

namespace stiction::test {
namespace {

std::vector<BoxScene> piles() {
  return {box_tower(50), box_wall(10, 10), box_pyramid(7)};
}

std::vector<BoxScene> degenerate() {
  BoxScene two = box_tower(2);
  return {box_tower(1), random_touching(1, 6, 0.0), two, random_touching(4, 20, 1.0), random_touching(5, 40, 0.05)};
}

TEST(Preconditioners, AreSymmetricAndPositiveDefinite) {
  for (const auto& scenes : {piles(), degenerate()})
    for (const BoxScene& scene : scenes)
      for (const Preconditioning kind : kAllPreconditionings) {
        SCOPED_TRACE(name_of(kind));
        PreconditionerWorkspace workspace(box_matrix(scene, 1e-3, 20), kind);
        for (unsigned seed = 0; seed < 10; ++seed) {
          const std::vector<double> x = random_vector(workspace.n(), 2 * seed),
                                    y = random_vector(workspace.n(), 2 * seed + 1);
          const std::vector<double> Mx = workspace.apply(x), My = workspace.apply(y);
          EXPECT_GT(dot(Mx, x), 0.0);
          // |<Mx, y>| is at most the mean of the energies; 1e7 is the largest condition of these matrices.
          EXPECT_NEAR(dot(Mx, y), dot(x, My), 1e-9 * (dot(Mx, x) + dot(My, y)));
        }
      }
}

TEST(Preconditioners, EachNeedsNoMoreIterationsThanTheScalarDiagonal) {
  for (const double compliance : {1e-3, 1e-5})
    for (const unsigned sliding : {0U, 20U})
      for (const BoxScene& scene : piles()) {
        Index plain = 0;
        for (const Preconditioning kind : kAllPreconditionings) {
          PreconditionerWorkspace workspace(box_matrix(scene, compliance, sliding), kind);
          std::vector<double> x;
          const GradientOutcome outcome = workspace.solve(random_vector(workspace.n(), 3), x, 1e-6, 20000);
          EXPECT_TRUE(outcome.is_met) << name_of(kind);
          if (kind == Preconditioning::scalar_diagonal) plain = outcome.iterations;
          EXPECT_LE(outcome.iterations, plain) << name_of(kind);
        }
      }
}

TEST(Preconditioners, SolveWhatHasNoCouplingsAtOnce) {
  for (const BoxScene& scene : {box_tower(1), random_touching(1, 6, 0.0)})
    for (const Preconditioning kind : kAllPreconditionings) {
      if (kind == Preconditioning::scalar_diagonal) continue;
      PreconditionerWorkspace workspace(box_matrix(scene, 1e-3), kind);
      std::vector<double> x;
      EXPECT_EQ(workspace.solve(random_vector(workspace.n(), 3), x, 1e-10, 5).iterations, 1) << name_of(kind);
    }
}

TEST(Preconditioners, LanesChangeNoBit) {
  for (const auto& scenes : {piles(), degenerate()})
    for (const BoxScene& scene : scenes)
      for (const Preconditioning kind : kAllPreconditionings) {
        PreconditionerWorkspace workspace(box_matrix(scene, 1e-3, 20), kind);
        const std::vector<double> r = random_vector(workspace.n(), 4), z = workspace.apply(r),
                                  prepared = workspace.memory;
        for (const Index lanes : {3, 32}) {
          std::fill(workspace.memory.begin(), workspace.memory.end(), -77.0);
          std::vector<double> there(r.size());
          run_stressed(
              lanes,
              [&](auto& team) {
                workspace.use(team,
                              [&](const auto& preconditioner) { preconditioner.apply(team, r.data(), there.data()); });
              },
              9);
          EXPECT_EQ(there, z) << name_of(kind) << " on " << lanes;
          EXPECT_EQ(workspace.memory, prepared) << name_of(kind) << " on " << lanes;
        }
      }
}

TEST(ScalarDiagonal, DividesByWhatIsOnTheDiagonal) {
  PreconditionerWorkspace workspace(box_matrix(box_wall(3, 3), 1e-3), Preconditioning::scalar_diagonal);
  const std::vector<double> H = dense_of(workspace.system.matrix()), r = random_vector(workspace.n(), 5),
                            z = workspace.apply(r);
  for (std::size_t i = 0; i < r.size(); ++i) EXPECT_DOUBLE_EQ(z[i] * H[i * (r.size() + 1)], r[i]);
}

/// H with every number k of a small matrix made the block k I.
BlockSystem spread(const std::vector<std::vector<double>>& small) {
  const auto rows = static_cast<Index>(small.size());
  BlockSystem system;
  system.stream = {rows, rows, 0};
  std::vector<Index> columns;
  for (const auto& row : small) {
    for (std::size_t j = 0; j < row.size(); ++j) {
      if (row[j] == 0.0) continue;
      columns.push_back(static_cast<Index>(j));
      for (Index k = 0; k < kBlockEntries; ++k) system.values.push_back(k % 7 == 0 ? row[j] : 0.0);
    }
    system.stream.push_back(static_cast<Index>(columns.size()));
  }
  system.stream.insert(system.stream.end(), columns.begin(), columns.end());
  return system;
}

double shift_of(PreconditionerWorkspace& workspace) {
  SerialTeam team;
  return IncompleteCholesky{workspace.factor(), workspace.memory.data()}.prepare(team, workspace.system.matrix());
}

TEST(IncompleteCholesky, IsTheFactorisationItselfWhereThatHasNoFill) {
  PreconditionerWorkspace incomplete(box_matrix(box_tower(50), 1e-5), Preconditioning::incomplete_cholesky);
  PreconditionerWorkspace complete(box_matrix(box_tower(50), 1e-5), Preconditioning::block_ldl);
  const std::vector<double> r = random_vector(incomplete.n(), 8);
  EXPECT_EQ(incomplete.apply(r), complete.apply(r));
  EXPECT_EQ(shift_of(incomplete), 0.0);
}

TEST(IncompleteCholesky, AgreesWithTheMatrixOnItsPattern) {
  PreconditionerWorkspace workspace(box_matrix(box_wall(6, 6), 1e-3), Preconditioning::incomplete_cholesky);
  ASSERT_EQ(shift_of(workspace), 0.0);
  const BlockFactorView plan = workspace.factor();
  const BlockMatrix L{plan.lower, workspace.memory.data()};
  const auto entry = [&](Index row, Index column, Index i, Index j) {
    for (Index k = plan.lower.offsets[row]; k < plan.lower.offsets[row + 1]; ++k)
      if (plan.lower.columns[k] == column) return column == row && j > i ? 0.0 : L.block(k)[i * 6 + j];
    return 0.0;
  };
  bool has_dropped = false;
  for (Index p = 0; p < plan.rows; ++p)
    for (Index q = 0; q <= p; ++q) {
      Index source = -1;
      for (Index k = plan.lower.offsets[p]; k < plan.lower.offsets[p + 1]; ++k)
        if (plan.lower.columns[k] == q) source = plan.sources[k];
      double worst = 0.0;
      for (Index i = 0; i < 6; ++i)
        for (Index j = 0; j < 6; ++j) {
          double sum = 0.0;
          for (Index m = 0; m <= q; ++m)
            for (Index k = 0; k < 6; ++k) sum += entry(p, m, i, k) * entry(q, m, j, k);
          if (source >= 0) sum -= workspace.system.matrix().block(source)[i * 6 + j];
          worst = std::max(worst, std::abs(sum));
        }
      if (source >= 0) {
        EXPECT_LT(worst, 1e-9) << p << ", " << q;
      } else {
        has_dropped = has_dropped || worst > 1.0;
      }
    }
  EXPECT_TRUE(has_dropped) << "a matrix without fill would show nothing";
}

TEST(IncompleteCholesky, BeginsAgainWithALargerDiagonalWhereAPivotIsLost) {
  // Kershaw (1978): positive definite, and the last pivot of IC(0) is -5.
  PreconditionerWorkspace workspace(spread({{3, -2, 0, 2}, {-2, 3, -2, 0}, {0, -2, 3, -2}, {2, 0, -2, 3}}),
                                    Preconditioning::incomplete_cholesky, Ordering::natural);
  const double shift = shift_of(workspace);
  EXPECT_GT(shift, 0.0);
  EXPECT_LT(shift, 1.0);
  for (unsigned seed = 0; seed < 20; ++seed) {
    const std::vector<double> x = random_vector(workspace.n(), seed);
    EXPECT_GT(dot(workspace.apply(x), x), 0.0);
  }
  std::vector<double> solution;
  EXPECT_TRUE(workspace.solve(random_vector(workspace.n(), 1), solution, 1e-10, 24).is_met);
}

TEST(IncompleteCholesky, EndsWithAMatrixThatNothingMends) {
  PreconditionerWorkspace workspace(spread({{1, 1000}, {1000, 1}}), Preconditioning::incomplete_cholesky,
                                    Ordering::natural);
  EXPECT_EQ(shift_of(workspace), 64.0);
  for (const double z : workspace.apply(random_vector(workspace.n(), 1))) EXPECT_TRUE(std::isfinite(z));
}

TEST(SparseInverse, IsTheInverseWhereItsRowsAreFull) {
  for (const BoxScene& scene : {box_tower(1), box_tower(2), random_touching(6, 9, 1.0)}) {
    PreconditionerWorkspace inverse(box_matrix(scene, 1e-3), Preconditioning::sparse_inverse);
    PreconditionerWorkspace factor(box_matrix(scene, 1e-3), Preconditioning::block_ldl);
    const std::vector<double> r = random_vector(inverse.n(), 3), z = inverse.apply(r), expected = factor.apply(r);
    double largest = 0.0;
    for (const double v : expected) largest = std::max(largest, std::abs(v));
    for (std::size_t i = 0; i < r.size(); ++i) EXPECT_NEAR(z[i], expected[i], 1e-9 * largest);
  }
}

TEST(SparseInverse, RowsAreShortHoweverManyTouchABody) {
  PreconditionerWorkspace workspace(box_matrix(random_touching(7, 30, 1.0), 1e-3), Preconditioning::sparse_inverse);
  const SparseInverseView plan = workspace.inverse();
  Index longest = 0;
  for (Index row = 0; row < 30; ++row)
    longest = std::max(longest, plan.lower.offsets[row + 1] - plan.lower.offsets[row]);
  EXPECT_EQ(longest, kInverseRowBlocks);
  EXPECT_EQ(plan.lower.columns[plan.lower.offsets[29]], 30 - kInverseRowBlocks) << "the nearest stay";
}

/// G minimises | S_i E_i' - G_i L |_F over the blocks of each row i, whatever the scale S_i. The remainder is
/// orthogonal to the rows of L that the pattern lets in. With H = L L' this means that G H has no block on the pattern
/// but the diagonal ones. The scale makes the diagonal blocks of G H G' the identity.
TEST(SparseInverse, MinimisesTheDistanceOfGLFromTheIdentityUpToTheScaleOfItsRows) {
  for (const BoxScene& scene : {box_wall(4, 4), box_pyramid(4), random_touching(8, 25, 0.2)}) {
    PreconditionerWorkspace workspace(box_matrix(scene, 1e-2), Preconditioning::sparse_inverse);
    workspace.apply(random_vector(workspace.n(), 1));
    const BlockMatrix G{workspace.inverse().lower, workspace.memory.data()};
    const auto n = static_cast<std::size_t>(workspace.n());
    const std::vector<double> H = dense_of(workspace.system.matrix()), rows = dense_of(G);
    std::vector<double> image(n * n, 0.0);  // G H
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t k = 0; k < n; ++k)
        for (std::size_t j = 0; j < n; ++j) image[i * n + j] += rows[i * n + k] * H[k * n + j];
    for (Index row = 0; row < G.pattern.rows; ++row)
      for (Index i = 6 * row; i < 6 * row + 6; ++i) {
        const double* const line = image.data() + static_cast<std::size_t>(i) * n;
        // Entries of H are at most some 1e4, those of G some 1e0: 1e-9 is well above the roundings of their products.
        for (Index k = G.pattern.offsets[row]; k + 1 < G.pattern.offsets[row + 1]; ++k)
          for (Index j = 0; j < 6; ++j) EXPECT_NEAR(line[6 * G.pattern.columns[k] + j], 0.0, 1e-9) << row;
        for (Index j = 6 * row; j < 6 * row + 6; ++j) {
          double entry = 0.0;
          for (std::size_t k = 0; k < n; ++k) entry += line[k] * rows[static_cast<std::size_t>(j) * n + k];
          EXPECT_NEAR(entry, i == j ? 1.0 : 0.0, 1e-9) << row;
        }
      }
  }
}

}  // namespace
}  // namespace stiction::test
