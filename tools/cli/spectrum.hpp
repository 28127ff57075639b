#pragma once

#include "stiction/batch.hpp"

namespace stiction::cli {

/// Extreme eigenvalues of the symmetric part of A + diag R of one environment.
struct Spectrum {
  double smallest = 0, largest = 0;
  bool complete = false;  ///< as many Lanczos steps as rows: exact but for rounding. Otherwise estimates from inside:
                          ///< the largest from below, the smallest from above, the condition number from below.
  bool usable = false;    ///< false: no rows, or an entry that is not finite

  /// largest / smallest; infinite when the smallest is zero or negative to within rounding over `rows` rows.
  [[nodiscard]] double condition(Offset rows) const;
};

/// The most Lanczos steps taken: systems of up to that many rows are resolved completely.
inline constexpr Index kLanczosSteps = 96;

/// Lanczos (1950) with full reorthogonalisation from a fixed pseudo-random vector, in f64.
Spectrum estimate_spectrum(const ContactBatchView<double>& batch, Offset env);

}  // namespace stiction::cli
