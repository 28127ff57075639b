#pragma once

/// \file
/// Rank, definiteness and condition of an operator (docs/howto/analysis.md).

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "stiction/batch.hpp"

namespace stiction {

/// The sign of x'Ax, which the symmetric part (A + A') / 2 decides.
enum class Definiteness : std::uint8_t {
  unknown,                ///< no rows, too many of them, or a number that is not finite
  positive_definite,      ///< positive for every x by more than rounding
  positive_semidefinite,  ///< zero to within rounding for some x: redundant contacts
  indefinite,             ///< negative for some x by more than rounding
};

/// Name of a verdict, as reports print it ("positive_definite", ...).
const char* to_string(Definiteness definiteness) noexcept;

/// Options of an operator's analysis.
struct AnalysisOptions {
  bool with_compliance = true;   ///< A + diag R, the matrix that is solved; else A alone
  Index max_steps = 20;          ///< most steps of each iteration, >= 1
  double step_tolerance = 1e-8;  ///< an iteration ends early at this relative error bound, >= 0 [-]
  double rank_tolerance = 0;     ///< limit of zero, over the largest singular value; 0: rows times the distance from 1
                                 ///< to the type's next number [-]
  Index max_dense_rows = 512;    ///< environments of more rows are not factorised
};

/// Properties of one environment's operator. NaN, rank -1 and Definiteness::unknown: not determined
/// (docs/howto/analysis.md).
///
/// Sizes are singular values, which mean the same for every matrix: s_max = |A| and s_min = 1 / |A^-1| in the 2-norm.
/// For a symmetric A they are the absolute values of its eigenvalues, s_max the spectral radius; else s_max is a bound
/// on the spectral radius.
struct OperatorAnalysis {
  /// Value of a number that is not determined: NaN.
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

  Index rows = 0;                 ///< rows of the environment
  Offset nonzeros = 0;            ///< stored entries of A; where A = Y Y' is not stored, those of Y
  double density = kNone;         ///< nonzeros / rows^2 [-]
  bool is_finite = true;          ///< false: some number is not, and the fields below are not determined
  double asymmetry = kNone;       ///< max |A - A'| / max |A|, without R [-]
  double normal_spread = kNone;   ///< largest over smallest positive diagonal of the cones' first rows: mass ratios [-]
  double largest = kNone;         ///< largest singular value, from below [w / lambda]
  double largest_error = kNone;   ///< some singular value is within this part of `largest` [-]
  Index largest_steps = 0;        ///< steps taken by the power iteration
  Index rank = -1;                ///< singular values above rank_tolerance, by pivoted QR
  double rank_tolerance = kNone;  ///< singular values up to it count as zero [w / lambda]
  double smallest = kNone;        ///< the smallest of those `rank` singular values, from above [w / lambda]
  double smallest_error = kNone;  ///< some singular value is within this part of `smallest`; infinite: no bound [-]
  Index smallest_steps = 0;       ///< steps taken by the inverse iteration
  /// Sign of x'Ax over all x.
  Definiteness definiteness = Definiteness::unknown;

  /// Condition number in the 2-norm: infinite where the rank is less than the rows, NaN where it is not determined. [-]
  [[nodiscard]] double condition() const noexcept;
  /// Condition number on the range alone: largest / smallest, whatever the rank; NaN where there is none. [-]
  [[nodiscard]] double range_condition() const noexcept { return largest / smallest; }
};

/// Looks at the environments listed, in that order. Host memory, f64, one thread; an answer depends on its environment
/// and the options alone. It runs the power iteration on A'A and inverse iteration on the triangle of a QR
/// factorisation with column pivoting (Businger and Golub 1965). Both begin with a fixed pseudo-random vector.
/// Definiteness is by Cholesky's factorisation with diagonal pivoting (Higham 2002, 10.3). O(nonzeros) a step,
/// O(rows^3) to factorise.
/// \throws Error(invalid_argument) for a batch whose structure is not sound, an environment that is not there, or an
/// option out of range.
template <class Real>
std::vector<OperatorAnalysis> analyse(const ContactBatchView<Real>& batch, std::span<const Offset> environments,
                                      const AnalysisOptions& options = {});

/// Every environment of the batch.
template <class Real>
std::vector<OperatorAnalysis> analyse(const ContactBatchView<Real>& batch, const AnalysisOptions& options = {});

}  // namespace stiction
