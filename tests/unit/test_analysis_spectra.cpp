// Operators too large for a hand, against Spectra's Lanczos iteration and Eigen's dense eigenvalues.
#include <gtest/gtest.h>

#if defined(STICTION_TEST_HAS_SPECTRA)
#include <Spectra/MatOp/DenseSymShiftSolve.h>
#include <Spectra/SymEigsShiftSolver.h>
#include <Spectra/SymEigsSolver.h>
#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>

#include "stiction/analysis.hpp"
#include "tests/support/random_systems.hpp"
#include "tests/support/scene_batches.hpp"
#if defined(STICTION_TEST_HAS_IO)
#include "stiction/io.hpp"
#endif

namespace {

using namespace stiction;
using namespace stiction::test;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd dense(const ContactBatchView<double>& batch, Offset env, bool with_compliance = true) {
  const Index n = batch.env_rows(env);
  MatrixXd A = MatrixXd::Zero(n, n);
  for (Index i = 0; i < n; ++i) {
    const Offset row = batch.env_row_offsets[env] + i;
    for (Offset k = batch.row_offsets[row]; k < batch.row_offsets[row + 1]; ++k) A(i, batch.column[k]) += batch.A[k];
    if (with_compliance) A(i, i) += batch.R[row];
  }
  return A;
}

/// The eigenvalue of largest size; of (A)^-1 where `inverted`, given back as one of A.
template <class Solver>
double extreme(Solver solver) {
  solver.init();
  solver.compute(Spectra::SortRule::LargestMagn, 5000, 1e-12);
  EXPECT_EQ(solver.info(), Spectra::CompInfo::Successful);
  return std::fabs(solver.eigenvalues()[0]);
}

/// |lambda| largest, by Spectra.
double spectra_largest(const MatrixXd& A) {
  Spectra::DenseSymMatProd<double> product(A);
  return extreme(
      Spectra::SymEigsSolver<Spectra::DenseSymMatProd<double>>(product, 1, std::min<Eigen::Index>(A.rows(), 40)));
}

/// |lambda| smallest, by Spectra's factorisation and shift-and-invert at zero.
double spectra_smallest(const MatrixXd& A) {
  Spectra::DenseSymShiftSolve<double> inverse(A);
  return extreme(Spectra::SymEigsShiftSolver<Spectra::DenseSymShiftSolve<double>>(
      inverse, 1, std::min<Eigen::Index>(A.rows(), 40), 0.0));
}

/// Ascending; those of any square matrix as the upper half of the eigenvalues of (0 A; A' 0).
VectorXd singular_values(const MatrixXd& A) {
  const Eigen::Index n = A.rows();
  MatrixXd both = MatrixXd::Zero(2 * n, 2 * n);
  both.topRightCorner(n, n) = A;
  both.bottomLeftCorner(n, n) = A.transpose();
  return Eigen::SelfAdjointEigenSolver<MatrixXd>(both, Eigen::EigenvaluesOnly).eigenvalues().tail(n);
}

/// Rounding of a factorisation of n rows, over the largest singular value.
double rounding(Eigen::Index n) {
  return static_cast<double>(n) * 0x1p-52;
}

/// Whether some singular value is within `error` parts of `value`.
bool has_one_near(const VectorXd& values, double value, double error, double slack) {
  return ((values.array() - value).abs() <= error * value + slack).any();
}

/// What must hold however few the steps: estimates from the right side, errors that are bounds, the size of the error.
void expect_bounds(const OperatorAnalysis& seen, const VectorXd& values) {
  const Eigen::Index n = values.size();
  const double largest = values[n - 1], smallest = values[n - seen.rank], slack = 100 * rounding(n) * largest;
  EXPECT_LE(seen.largest, largest + slack);
  EXPECT_GE(seen.smallest, smallest - slack);
  EXPECT_TRUE(has_one_near(values, seen.largest, seen.largest_error, slack));
  EXPECT_TRUE(has_one_near(values, seen.smallest, seen.smallest_error, slack));
  // Kuczynski and Wozniakowski (1992): from a random vector, k steps leave a relative error of 0.871 ln n / (k - 1) of
  // the largest eigenvalue on average; here that is one of A'A, so half of it for the singular value. Twice that
  // average.
  if (n >= 8 && seen.largest_steps > 1) {
    const double part = 0.871 * std::log(static_cast<double>(n)) / (seen.largest_steps - 1);
    EXPECT_GE(seen.largest, largest * (1 - part) - slack);
    const double inverse_part = 0.871 * std::log(static_cast<double>(n)) / std::max(seen.smallest_steps - 1, 1);
    if (inverse_part < 1) EXPECT_LE(seen.smallest * (1 - inverse_part), smallest + slack);
  }
}

/// Rank and definiteness where the spectrum leaves no doubt: nothing between a hundredth of and a hundred times what
/// counts as zero.
void expect_decisions(const OperatorAnalysis& seen, const MatrixXd& A, const VectorXd& values) {
  const double zero = seen.rank_tolerance;
  const auto is_doubtful = [&](const VectorXd& sizes) {
    return ((sizes.array().abs() > 0.01 * zero) && (sizes.array().abs() < 100 * zero)).any();
  };
  if (!is_doubtful(values)) EXPECT_EQ(seen.rank, (values.array() > zero).count());
  const VectorXd part =
      Eigen::SelfAdjointEigenSolver<MatrixXd>(MatrixXd(0.5 * (A + A.transpose())), Eigen::EigenvaluesOnly)
          .eigenvalues();
  if (is_doubtful(part)) return;
  const Definiteness expected = part[0] < -zero  ? Definiteness::indefinite
                                : part[0] > zero ? Definiteness::positive_definite
                                                 : Definiteness::positive_semidefinite;
  EXPECT_EQ(to_string(seen.definiteness), std::string(to_string(expected)));
}

/// One environment by both libraries, with few steps and with many. Symmetric, and not too large for Eigen.
void expect_like_spectra(const ContactBatchView<double>& batch, Offset env) {
  SCOPED_TRACE("environment " + std::to_string(env));
  const std::vector<Offset> only{env};
  const OperatorAnalysis quick = analyse(batch, std::span<const Offset>(only)).at(0);
  AnalysisOptions patient;
  patient.max_steps = 5000;
  const OperatorAnalysis settled = analyse(batch, std::span<const Offset>(only), patient).at(0);
  const MatrixXd A = dense(batch, env);
  const VectorXd values = singular_values(A);
  ASSERT_GT(quick.rank, 0);
  expect_bounds(quick, values);
  expect_bounds(settled, values);
  expect_decisions(quick, A, values);
  if (A.rows() < 3) return;  // Spectra wants more
  const double slack = 100 * rounding(A.rows()) * values[A.rows() - 1];
  // Rayleigh quotients: an error bound of e leaves an error of e^2 over the gap to the next value.
  if (settled.largest_error <= 1e-8) {
    const double largest = spectra_largest(A);
    EXPECT_NEAR(settled.largest, largest, 1e-8 * largest);
  }
  if (settled.smallest_error <= 1e-8 && settled.rank == settled.rows) {
    const double smallest = spectra_smallest(A);
    EXPECT_NEAR(settled.smallest, smallest, 1e-8 * smallest + slack);
  }
}

/// The scenes of the generator, at the sizes that Eigen resolves at once.
TEST(AnalysisSpectra, GeneratedScenes) {
  int compared = 0;
  for (const auto& info : scenes::list()) {
    SCOPED_TRACE(info.name);
    const auto batch = scene_batch(info.name, 3, 11);
    for (Offset env = 0; env < batch.env_count(); ++env) {
      const Index rows = batch.view().env_rows(env);
      if (rows == 0 || rows > 120 || asymmetry(batch.view())[static_cast<std::size_t>(env)] > 1e-12) continue;
      expect_like_spectra(batch.view(), env);
      ++compared;
    }
  }
  EXPECT_GT(compared, 5);
}

TEST(AnalysisSpectra, RandomContactsOfFullAndOfLowRank) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Recipe recipe;
    recipe.seed = seed;
    recipe.contacts = 2 + static_cast<int>(seed) * 2;
    recipe.rank = seed % 2 == 0 ? 0.5 : 1.5;
    recipe.compliance = seed % 3 == 0 ? 0.01 : 0.0;
    ContactBatch<double> batch(Law::convex);
    batch.add(random_contacts(recipe));
    expect_like_spectra(batch.view(), 0);
    const OperatorAnalysis seen = analyse(batch.view()).at(0);
    if (recipe.rank < 1 && recipe.compliance == 0)
      EXPECT_EQ(seen.rank, static_cast<Index>(recipe.rank * seen.rows)) << "half as many degrees of freedom as rows";
  }
}

TEST(AnalysisSpectra, MatricesWithoutSymmetryByTheirSingularValues) {
  scenes::Rng rng(5);
  for (const Index n : {3, 17, 60}) {
    for (const Index rank : {n, (n + 1) / 2}) {
      SCOPED_TRACE(std::to_string(n) + " rows, rank " + std::to_string(rank));
      MatrixXd left(n, rank), right(rank, n);
      for (double& entry : left.reshaped()) entry = rng.symmetric(1.0);
      for (double& entry : right.reshaped()) entry = rng.symmetric(1.0);
      const MatrixXd A = left * right;
      Environment<double> environment;
      environment.cones.assign(static_cast<std::size_t>(n), {ConeKind::unilateral, 1, -1});
      const MatrixXd row_major = A.transpose();
      environment.set_dense(
          std::span<const double>(row_major.data(), static_cast<std::size_t>(n) * static_cast<std::size_t>(n)), n);
      environment.b.assign(static_cast<std::size_t>(n), 1.0);
      ContactBatch<double> batch(Law::convex);
      batch.add(environment);
      for (const Index steps : {20, 5000}) {
        AnalysisOptions options;
        options.max_steps = steps;
        const OperatorAnalysis seen = analyse(batch.view(), options).at(0);
        const VectorXd values = singular_values(A);
        EXPECT_EQ(seen.rank, rank);
        EXPECT_GT(seen.asymmetry, 0.1);
        expect_bounds(seen, values);
        expect_decisions(seen, A, values);
        EXPECT_GE(seen.largest * 1.2, A.eigenvalues().cwiseAbs().maxCoeff()) << "a bound on the spectral radius";
      }
    }
  }
}

TEST(AnalysisSpectra, Recordings) {
#if defined(STICTION_TEST_HAS_IO)
  for (const char* name : {"humanoid", "quadruped_rough", "hand_cube", "pile", "trajectory"}) {
    const auto path = std::filesystem::path(STICTION_EXAMPLES_DIR) / "data" / (std::string(name) + ".h5");
    ASSERT_TRUE(std::filesystem::exists(path)) << path;
    SCOPED_TRACE(name);
    const io::Recording recording = io::read_batch(path);
    const auto view = recording.batch.view();
    int compared = 0;
    for (Offset env = 0; env < view.env_count && compared < 3; ++env) {
      if (view.env_rows(env) == 0 || view.env_rows(env) > 120) continue;
      expect_like_spectra(view, env);
      ++compared;
    }
    std::printf("%-16s %d environments compared\n", name, compared);
  }
#else
  GTEST_SKIP() << "this build reads no HDF5 files";
#endif
}

}  // namespace

#else

TEST(AnalysisSpectra, GeneratedScenes) {
  GTEST_SKIP()
      << "Spectra is not here (libspectra-dev, on libeigen3-dev): estimates are compared with hand answers only";
}

#endif
