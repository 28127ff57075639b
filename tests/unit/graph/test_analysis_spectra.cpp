// Extreme eigenvalues against Spectra's Lanczos iteration.
#include <gtest/gtest.h>

#if defined(STICTION_TEST_HAS_SPECTRA)
#include <Spectra/SymEigsSolver.h>

#include <cmath>
#include <string>

#include "tests/support/oracles/dense_operator.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;
using Eigen::MatrixXd;

/// The size of the eigenvalue at one end of those sizes, by a Krylov space that is as large as it may be.
double extreme(const MatrixXd& A, Spectra::SortRule end) {
  Spectra::DenseSymMatProd<double> product(A);
  Spectra::SymEigsSolver<Spectra::DenseSymMatProd<double>> solver(product, 1, A.rows());
  solver.init();
  solver.compute(end, 1000, 1e-12);
  EXPECT_EQ(solver.info(), Spectra::CompInfo::Successful);
  return std::fabs(solver.eigenvalues()[0]);
}

/// Compares where both iterations converged, which as Rayleigh quotients leaves e^2 over the gap to the next value for
/// an error bound of e. Spectra rounds by 2^-52 of the largest value, a row.
void expect_like_spectra(const ContactBatchView<double>& batch, Offset env) {
  SCOPED_TRACE("environment " + std::to_string(env));
  const OperatorAnalysis seen = analyse_one(batch, env, 5000);
  const MatrixXd A = dense(batch, env);
  const double largest = extreme(A, Spectra::SortRule::LargestMagn);
  EXPECT_LE(seen.largest, largest * (1 + 1e-10));
  EXPECT_GE(seen.largest, largest * (1 - 1e-3)) << "after " << seen.largest_steps << " steps";
  if (seen.largest_error <= 1e-8) {
    EXPECT_NEAR(seen.largest, largest, 1e-8 * largest);
  }
  if (seen.rank < seen.rows) return;
  const double smallest = extreme(A, Spectra::SortRule::SmallestMagn),
               slack = 100 * static_cast<double>(A.rows()) * 0x1p-52 * largest;
  EXPECT_GE(seen.smallest, smallest * (1 - 1e-10) - slack);
  EXPECT_LE(seen.smallest, smallest * (1 + 1e-3) + slack) << "after " << seen.smallest_steps << " steps";
  if (seen.smallest_error <= 1e-8) {
    EXPECT_NEAR(seen.smallest, smallest, 1e-8 * smallest + slack);
  }
}

TEST(AnalysisSpectra, GeneratedScenes) {
  EXPECT_GT(for_each_small_scene(expect_like_spectra), 5);
}

TEST(AnalysisSpectra, Recordings) {
  std::printf("%d environments compared\n", for_each_small_recording(expect_like_spectra));
}

}  // namespace

#else

TEST(AnalysisSpectra, GeneratedScenes) {
  GTEST_SKIP() << "Spectra is not here (libspectra-dev, on libeigen3-dev): extreme values are not compared with it";
}

#endif
