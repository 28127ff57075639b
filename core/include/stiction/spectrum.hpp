#pragma once

/// \file
/// Choice of solver by the spectrum of an environment's operator (docs/howto/spectrum.md).

#include <cstdint>
#include <limits>
#include <span>
#include <string>

#include "stiction/batch.hpp"

namespace stiction {

/// Choice of an environment's solver.
enum class SolverChoice : std::uint8_t {
  named = 0,     ///< it is SolverOptions::solver
  spectrum = 1,  ///< by condition and density of the environment's operator, then `auto` where that falls short
};
/// Name of a choice, as options have it: "named", "spectrum".
const char* to_string(SolverChoice choice) noexcept;
/// \throws Error(invalid_argument) listing the names that exist.
SolverChoice solver_choice_from_string(const std::string& name);

/// Class of an environment's spectrum, by which a solver is chosen.
enum class SpectrumClass : std::uint8_t {
  direct = 0,          ///< well conditioned, and few rows
  preconditioned = 1,  ///< not badly conditioned
  decomposed = 2,      ///< sparse: islands apart, and sweeps
  otherwise = 3,       ///< dense and badly conditioned, or not to be judged
};
/// Number of classes.
inline constexpr int kSpectrumClasses = 4;
/// Name of a class: "direct", "preconditioned", "decomposed", "otherwise".
const char* to_string(SpectrumClass found) noexcept;

/// Thresholds and solvers of SolverChoice::spectrum.
struct SpectrumRules {
  Index steps = 20;                        ///< products with A for an estimate, 2 to 1000
  double direct_condition = 100;           ///< below it and with fewer than direct_rows rows: direct [-]
  Index direct_rows = 1000;                ///< rows
  double preconditioned_condition = 1000;  ///< below it: preconditioned [-]
  double sparse_density = 0.1;             ///< stored share of A below it: decomposed [-]
  bool keep = false;  ///< whether an environment keeps its class while its structure stays: an answer then depends on
                      ///< the solver's earlier batches
  SolverKind direct = SolverKind::newton;            ///< solver of SpectrumClass::direct
  SolverKind preconditioned = SolverKind::subspace;  ///< solver of SpectrumClass::preconditioned
  SolverKind decomposed = SolverKind::npgs;          ///< solver of SpectrumClass::decomposed, islands apart
  SolverKind otherwise = SolverKind::admm;           ///< solver of SpectrumClass::otherwise

  /// The solver of a class.
  [[nodiscard]] SolverKind solver_of(SpectrumClass found) const noexcept;
  bool operator==(const SpectrumRules&) const = default;
};

/// Extremes of the spectrum of an environment's A + R, by Lanczos' method; NaN: not determined.
struct SpectrumEstimate {
  double largest = std::numeric_limits<double>::quiet_NaN();   ///< from below [w / lambda]
  double smallest = std::numeric_limits<double>::quiet_NaN();  ///< of the range of A + R, from above [w / lambda]
  double density = std::numeric_limits<double>::quiet_NaN();   ///< stored share of A; 1 where A = Y Y' [-]
  Index rows = 0;                                              ///< rows of the environment
  Index steps = 0;                                             ///< products with A that were made

  /// largest / smallest, from below; infinite where A + R is not positive on its range. [-]
  [[nodiscard]] double condition() const noexcept;
};

/// Estimates the spectrum of one environment of a host batch whose structure is sound, of a symmetric A. The first
/// vector is A + R times a fixed pseudo-random one, so that redundant contacts do not count. O(steps (nonzeros + steps
/// rows)), in f64 on one thread. The estimate depends on the environment alone (Lanczos 1950; Golub and Van Loan 2013,
/// 10.1). \throws Error(invalid_argument) for steps below 2 or an environment that is not there.
template <class Real>
SpectrumEstimate estimate_spectrum(const ContactBatchView<Real>& batch, Offset env, Index steps = 20);

/// The class that the rules give to such a spectrum.
SpectrumClass classify(const SpectrumEstimate& seen, const SpectrumRules& rules = {}) noexcept;

}  // namespace stiction
