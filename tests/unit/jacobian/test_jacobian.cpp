#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "stiction/error.hpp"
#include "stiction/residual.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/jacobian_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

JacobianBatch<double> batch_of(const std::vector<JacobianEnvironment<double>>& envs, Index mass_block = 0,
                               MassForm form = MassForm::matrix) {
  JacobianBatch<double> batch(Law::convex, form, mass_block);
  for (const auto& env : envs) batch.add(env);
  return batch;
}

std::vector<JacobianEnvironment<double>> several(Index mass_block = 0) {
  std::vector<JacobianEnvironment<double>> envs;
  for (std::uint64_t seed = 1; seed <= 5; ++seed)
    envs.push_back(
        random_jacobian({seed, static_cast<int>(seed), 3, mass_block == 6 ? 12 : Index(5 + seed), mass_block}));
  return envs;
}

/// CSR of the same J, in which ordered rows come backwards and every third entry in two halves.
JacobianEnvironment<double> as_csr(JacobianEnvironment<double> env) {
  const std::size_t dofs = env.v_free.size(), n = env.mu.size();
  std::vector<double> values;
  env.row_offsets = {0};
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = dofs; k-- > 0;) {
      const double value = env.J[i * dofs + k];
      for (int part = 0; part < (k % 3 == 0 ? 2 : 1); ++part) {
        env.column.push_back(static_cast<Index>(k));
        values.push_back(k % 3 == 0 ? 0.5 * value : value);
      }
    }
    env.row_offsets.push_back(static_cast<Index>(values.size()));
  }
  env.J = values;
  return env;
}

TEST(Jacobian, AHandSystemIsAssembledExactly) {
  // One body of mass 4 on a plane, pushed down and sideways; one rod end of inertia 16 with lever 2.
  JacobianEnvironment<double> env;
  env.cones = {friction(3)};
  env.J = {0, 0, 1, 2, 1, 0, 0, 0, 0, 1, 0, 0};
  env.M = {4, 4, 4, 16};
  env.v_free = {1, -2, -3, 0.5};
  env.target = {0.25, 0, 0};
  const auto contact = assemble(batch_of({env}, 1).view());
  EXPECT_EQ(contact.arrays().A, (std::vector<double>{0.5, 0, 0, 0, 0.25, 0, 0, 0, 0.25}));
  EXPECT_EQ(contact.arrays().b, (std::vector<double>{-2.25, 1, -2}));
  const std::vector<double> lambda{4, 0, 8};
  EXPECT_EQ(velocities(batch_of({env}, 1).view(), std::span<const double>(lambda)), (std::vector<double>{1, 0, -2, 1}));
}

TEST(Jacobian, AssemblyAndVelocitiesAreWhatEliminationGives) {
  for (const Index block : {0, 1, 6}) {
    const auto envs = several(block);
    const auto batch = batch_of(envs, block);
    const auto contact = assemble(batch.view());
    EXPECT_TRUE(validate(contact.view()).empty());
    std::vector<double> lambda;
    for (Offset i = 0; i < contact.row_count(); ++i) lambda.push_back(std::sin(static_cast<double>(i)));
    const auto velocity = velocities(batch.view(), std::span<const double>(lambda));
    std::size_t row = 0, entry = 0, dof = 0;
    for (const auto& env : envs) {
      const std::size_t n = env.mu.size(), dofs = env.v_free.size();
      const JacobianOracle oracle(env, block);
      const std::span<const double> A(contact.arrays().A), b(contact.arrays().b), v(velocity);
      EXPECT_LT(largest_difference(A.subspan(entry, n * n), oracle.A), 1e-11) << "block " << block;
      EXPECT_LT(largest_difference(b.subspan(row, n), oracle.b), 1e-13);
      for (std::size_t i = 0; i < n * n; ++i) EXPECT_EQ(A[entry + i], A[entry + i % n * n + i / n]);
      for (std::size_t k = 0; k < dofs; ++k) {
        double expected = env.v_free[k];
        for (std::size_t i = 0; i < n; ++i) expected += oracle.response[k * n + i] * lambda[row + i];
        EXPECT_NEAR(v[dof + k], expected, 1e-11);
      }
      row += n;
      entry += n * n;
      dof += dofs;
    }
  }
}

TEST(Jacobian, AFactorAndAMassMatrixAreTheSameThing) {
  auto envs = several();
  const auto expected = assemble(batch_of(envs).view());
  for (auto& env : envs) {
    // Cholesky by the textbook's inner products; entries above the diagonal must not be read.
    const std::size_t n = env.v_free.size();
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = 0; j <= i; ++j) {
        double sum = env.M[i * n + j];
        for (std::size_t k = 0; k < j; ++k) sum -= env.M[i * n + k] * env.M[j * n + k];
        env.M[i * n + j] = i == j ? std::sqrt(sum) : sum / env.M[j * n + j];
        if (i != j) env.M[j * n + i] = std::numeric_limits<double>::quiet_NaN();
      }
  }
  const auto actual = assemble(batch_of(envs, 0, MassForm::factor).view());
  EXPECT_LT(largest_difference(actual.arrays().A, expected.arrays().A), 1e-12);
  EXPECT_EQ(actual.arrays().b, expected.arrays().b);
}

TEST(Jacobian, BlocksOnTheDiagonalHaveTheBitsOfOneDenseMatrix) {
  auto envs = several(6);
  const auto blocks = assemble(batch_of(envs, 6).view());
  for (auto& env : envs) env.M = full_mass(env, 6);
  const auto dense = assemble(batch_of(envs).view());
  EXPECT_TRUE(same_bits(std::span<const double>(dense.arrays().A), std::span<const double>(blocks.arrays().A)));
}

/// The two as one environment that nothing couples, its M dense.
JacobianEnvironment<double> side_by_side(const JacobianEnvironment<double>& one,
                                         const JacobianEnvironment<double>& two) {
  JacobianEnvironment<double> both = one;
  const std::size_t n = one.mu.size(), m = two.mu.size(), dofs = one.v_free.size(), more = two.v_free.size();
  const auto append = [](std::vector<double>& to, const std::vector<double>& from) {
    to.insert(to.end(), from.begin(), from.end());
  };
  const auto diagonal = [&](const std::vector<double>& a, const std::vector<double>& b, std::size_t rows,
                            std::size_t others) {
    std::vector<double> result((rows + others) * (dofs + more));
    for (std::size_t i = 0; i < rows; ++i)
      for (std::size_t k = 0; k < dofs; ++k) result[i * (dofs + more) + k] = a[i * dofs + k];
    for (std::size_t i = 0; i < others; ++i)
      for (std::size_t k = 0; k < more; ++k) result[(rows + i) * (dofs + more) + dofs + k] = b[i * more + k];
    return result;
  };
  both.cones.insert(both.cones.end(), two.cones.begin(), two.cones.end());
  both.J = diagonal(one.J, two.J, n, m);
  both.M = diagonal(one.M, two.M, dofs, more);
  append(both.v_free, two.v_free);
  append(both.target, two.target);
  append(both.R, two.R);
  append(both.mu, two.mu);
  append(both.lo, two.lo);
  append(both.hi, two.hi);
  return both;
}

TEST(Jacobian, RobotsThatDoNotTouchHaveTheBitsOfEachAlone) {
  // Their zeros are skipped in ways that depend on their places in a vector and in words of 64 columns.
  for (const Index dofs : {5, 8, 27, 59, 64, 66}) {
    const auto one = random_jacobian({static_cast<std::uint64_t>(dofs), 4, 2, dofs, 0});
    const auto two = random_jacobian({static_cast<std::uint64_t>(100 + dofs), 6, 3, 13, 0});
    const auto alone = assemble(batch_of({one, two}).view(), FactorUse::never);
    const auto together = assemble(batch_of({side_by_side(one, two)}).view(), FactorUse::never);
    const std::size_t n = one.mu.size(), m = two.mu.size();
    const std::vector<double>& A = together.arrays().A;
    for (std::size_t i = 0; i < n + m; ++i)
      for (std::size_t j = 0; j < n + m; ++j) {
        double expected = 0;
        if (i < n && j < n) expected = alone.arrays().A[i * n + j];
        if (i >= n && j >= n) expected = alone.arrays().A[n * n + (i - n) * m + j - n];
        EXPECT_TRUE(same_bits(std::span<const double>(&expected, 1), std::span(&A[i * (n + m) + j], 1)))
            << dofs << ", " << i << ", " << j;
      }
    EXPECT_TRUE(same_bits(std::span<const double>(alone.arrays().b), std::span<const double>(together.arrays().b)));
    const std::vector<double> lambda(n + m, 0.5);
    const auto moved = velocities(batch_of({one, two}).view(), std::span<const double>(lambda));
    const auto moved_together = velocities(batch_of({side_by_side(one, two)}).view(), std::span<const double>(lambda));
    EXPECT_TRUE(same_bits(std::span<const double>(moved), std::span<const double>(moved_together)));
  }
}

TEST(Jacobian, NoZeroOfAHasASign) {
  // The product of the rows is below the smallest number, and negative.
  JacobianEnvironment<double> env;
  env.cones = {unilateral(), unilateral()};
  env.J = {1e-200, -1e-200};
  env.M = {1};
  env.v_free = {1};
  const auto contact = assemble(batch_of({env}).view());
  const std::vector<double> zeros(4, 0.0);
  EXPECT_TRUE(same_bits(std::span<const double>(zeros), std::span<const double>(contact.arrays().A)));
}

TEST(Jacobian, AFactorThatIsNotFiniteIsNoFactor) {
  for (const double broken : {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()})
    for (const std::size_t at : {2, 0, 3}) {
      JacobianEnvironment<double> env;
      env.cones = {unilateral()};
      env.J = {0, 1};
      env.M = {1, 0, 0.5, 1};
      env.M[at] = broken;
      env.v_free = {1, 1};
      const auto contact = assemble(batch_of({env}, 0, MassForm::factor).view());
      EXPECT_EQ(contact.arrays().env_flags, std::vector<std::uint32_t>{kFlagBadMass}) << broken << " at " << at;
      EXPECT_EQ(contact.arrays().A, std::vector<double>{0});
    }
}

TEST(Jacobian, RowsMayBeSparseAndMixedWithDenseOnes) {
  auto envs = several();
  const auto expected = assemble(batch_of(envs).view());
  for (std::size_t e = 1; e < envs.size(); e += 2) envs[e] = as_csr(envs[e]);
  const auto batch = batch_of(envs);
  const auto actual = assemble(batch.view());
  EXPECT_TRUE(same_bits(std::span<const double>(expected.arrays().A), std::span<const double>(actual.arrays().A)));
  EXPECT_LT(largest_difference(expected.arrays().b, actual.arrays().b), 1e-14);
}

TEST(Jacobian, ThreadsReachNoBit) {
  const auto batch = batch_of(several());
  const auto one = assemble(batch.view(), FactorUse::never, 1);
  const auto three = assemble(batch.view(), FactorUse::never, 3);
  EXPECT_TRUE(same_bits(std::span<const double>(one.arrays().A), std::span<const double>(three.arrays().A)));
  SolverOptions o = options(SolverKind::npgs, 1e-9, 500);
  const auto first = solve(batch, o);
  o.threads = 3;
  const auto second = solve(batch, o);
  EXPECT_TRUE(same_bits(first.contact, second.contact));
  EXPECT_TRUE(same_bits(std::span<const double>(first.velocity), std::span<const double>(second.velocity)));
}

TEST(Jacobian, TheSolutionMovesAsItsReactionsSay) {
  const auto envs = several();
  const auto batch = batch_of(envs);
  const auto solution = solve(batch, options(SolverKind::apgd, 1e-10, 5000));
  for (const auto& residual : verify(assemble(batch.view()).view(), std::span<const double>(solution.contact.lambda)))
    EXPECT_LE(residual.relative, 1e-10);
  // w = J v+ - target + R lambda: the motion of the rows is that of the velocities.
  std::size_t row = 0, dof = 0;
  for (const auto& env : envs) {
    for (std::size_t i = 0; i < env.mu.size(); ++i) {
      double motion = env.R[i] * solution.contact.lambda[row + i] - env.target[i];
      for (std::size_t k = 0; k < env.v_free.size(); ++k)
        motion += env.J[i * env.v_free.size() + k] * solution.velocity[dof + k];
      EXPECT_NEAR(motion, solution.contact.w[row + i], 1e-11);
    }
    row += env.mu.size();
    dof += env.v_free.size();
  }
}

TEST(Jacobian, WhatIsBadStaysInItsEnvironment) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto clean = solve(batch_of(several()), options(SolverKind::pgs, 1e-6, 300));
  for (int fault = 0; fault < 4; ++fault) {
    auto envs = several();
    if (fault == 0) envs[2].M[0] = -1;
    if (fault == 1) envs[2].M[9] = nan;
    if (fault == 2) envs[2].J[3] = nan;
    if (fault == 3) envs[2].v_free[1] = std::numeric_limits<double>::infinity();
    const auto batch = batch_of(envs);
    SolverOptions o = options(SolverKind::pgs, 1e-6, 300);
    EXPECT_THROW((void)solve(batch, o), Error);
    o.invalid = InvalidPolicy::isolate;
    const auto solution = solve(batch, o);
    EXPECT_EQ(solution.contact.status[2].code, EnvCode::invalid_input);
    EXPECT_NE(
        solution.contact.status[2].flags & static_cast<std::uint32_t>(fault < 2 ? kFlagBadMass : kFlagNonFiniteInput),
        0U);
    std::size_t row = 0, dof = 0;
    for (std::size_t e = 0; e < envs.size(); ++e) {
      const std::size_t n = envs[e].mu.size(), dofs = envs[e].v_free.size();
      const std::span<const double> ours(solution.contact.lambda), theirs(clean.contact.lambda);
      const std::span<const double> moves(solution.velocity), moved(clean.velocity);
      if (e == 2) {
        for (std::size_t i = 0; i < n; ++i) EXPECT_EQ(ours[row + i], 0.0);
        EXPECT_TRUE(same_bits(std::span<const double>(envs[e].v_free), moves.subspan(dof, dofs)));
      } else {
        EXPECT_TRUE(same_bits(theirs.subspan(row, n), ours.subspan(row, n)));
        EXPECT_TRUE(same_bits(moved.subspan(dof, dofs), moves.subspan(dof, dofs)));
      }
      row += n;
      dof += dofs;
    }
  }
}

TEST(Jacobian, PaddedArraysAreReadWhereTheyLie) {
  const auto envs = several();
  const auto expected = assemble(batch_of(envs).view());
  // MuJoCo Warp's way: arrays (environments, room, dofs) with counts. All environments have 10 degrees of freedom.
  constexpr Index kDofs = 10, kRoom = 40;
  std::vector<Offset> env_rows{0}, env_cones{0}, env_dofs{0}, env_mass{0}, cone_rows{0}, rows{0};
  std::vector<Index> row_counts, cone_counts;
  std::vector<ConeKind> kinds;
  std::vector<double> J, M, v, target, R, mu;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const auto& env : envs) {
    const Offset first = env_rows.back();
    Offset row = first;
    for (const Cone& cone : env.cones) {
      cone_rows.back() = row;
      row += cone.row_count;
      cone_rows.push_back(row);
      kinds.push_back(cone.kind);
    }
    kinds.push_back(ConeKind::free);
    cone_rows.push_back(first + kRoom);
    env_cones.push_back(static_cast<Offset>(kinds.size()));
    cone_counts.push_back(static_cast<Index>(env.cones.size()));
    row_counts.push_back(static_cast<Index>(row - first));
    env_rows.push_back(first + kRoom);
    const std::size_t n = env.mu.size(), dofs = env.v_free.size();
    for (std::size_t i = 0; i < kRoom; ++i) {
      for (std::size_t k = 0; k < kDofs; ++k) J.push_back(i < n ? (k < dofs ? env.J[i * dofs + k] : 0.0) : nan);
      rows.push_back(rows.back() + kDofs);
      target.push_back(i < n ? env.target[i] : nan);
      R.push_back(i < n ? env.R[i] : nan);
      mu.push_back(i < n ? env.mu[i] : nan);
    }
    for (std::size_t i = 0; i < kDofs; ++i) {
      for (std::size_t j = 0; j < kDofs; ++j)
        M.push_back(i < dofs && j < dofs ? env.M[i * dofs + j] : (i == j ? 1.0 : 0.0));
      v.push_back(i < dofs ? env.v_free[i] : 3.0);
    }
    env_dofs.push_back(static_cast<Offset>(v.size()));
    env_mass.push_back(static_cast<Offset>(M.size()));
  }
  JacobianBatchView<double> view;
  view.env_count = static_cast<Offset>(envs.size());
  view.cone_count = static_cast<Offset>(kinds.size());
  view.row_count = env_rows.back();
  view.dof_count = env_dofs.back();
  view.entry_count = rows.back();
  view.mass_count = env_mass.back();
  view.env_row_offsets = env_rows.data();
  view.env_cone_offsets = env_cones.data();
  view.env_dof_offsets = env_dofs.data();
  view.env_mass_offsets = env_mass.data();
  view.env_row_counts = row_counts.data();
  view.env_cone_counts = cone_counts.data();
  view.cone_kind = kinds.data();
  view.cone_row_offsets = cone_rows.data();
  view.row_offsets = rows.data();
  view.J = J.data();
  view.M = M.data();
  view.v_free = v.data();
  view.target = target.data();
  view.R = view.lo = view.hi = R.data();
  view.mu = mu.data();
  const auto actual = assemble(view);
  EXPECT_TRUE(same_bits(std::span<const double>(expected.arrays().A), std::span<const double>(actual.arrays().A)));
  EXPECT_TRUE(same_bits(std::span<const double>(expected.arrays().b), std::span<const double>(actual.arrays().b)));
  EXPECT_EQ(expected.arrays().cone_row_offsets, actual.arrays().cone_row_offsets);
  row_counts[1] = kRoom + 1;
  EXPECT_THROW((void)assemble(view), Error);
}

TEST(Jacobian, WrongShapesAreRefusedAndNothingIsAppended) {
  JacobianBatch<double> batch(Law::convex, MassForm::matrix, 6);
  const auto good = several(6).front();
  const auto refused = [&](auto&& spoil) {
    auto env = good;
    spoil(env);
    EXPECT_THROW(batch.add(env), Error);
    EXPECT_EQ(batch.env_count(), 0);
  };
  refused([](auto& env) { env.J.pop_back(); });
  refused([](auto& env) { env.M.pop_back(); });
  refused([](auto& env) { env.v_free.pop_back(); });
  refused([](auto& env) { env.mu.pop_back(); });
  refused([](auto& env) { env.cones[0].row_count = 0; });
  refused([](auto& env) {
    env = as_csr(env);
    env.column[3] = 12;
  });
  refused([](auto& env) {
    env = as_csr(env);
    std::swap(env.row_offsets[1], env.row_offsets[2]);
  });
  EXPECT_THROW(JacobianBatch<double>(Law::convex, MassForm::matrix, -1), Error);
  batch.add(good);
  auto view = batch.view();
  view.M = nullptr;
  EXPECT_THROW((void)assemble(view), Error);
  EXPECT_THROW((void)assemble(batch.view(), FactorUse::never, -1), Error);
  EXPECT_THROW((void)velocities(batch.view(), std::span<const double>()), Error);
}

TEST(Jacobian, EnvironmentsWithoutRowsOrDegreesOfFreedomAreFine) {
  JacobianEnvironment<double> empty, still;
  still.v_free = {1, 2};
  still.M = {1, 0, 0, 1};
  const auto solution = solve(batch_of({empty, still}));
  EXPECT_EQ(solution.velocity, (std::vector<double>{1, 2}));
  EXPECT_EQ(solution.contact.status[1].code, EnvCode::solved);
}

}  // namespace
