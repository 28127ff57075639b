#pragma once

#include <array>
#include <optional>
#include <vector>

#include "cli/quantiles.hpp"
#include "core/plan/plan.hpp"
#include "stiction/analysis.hpp"
#include "stiction/batch.hpp"

namespace stiction::cli {

struct Range {
  double min = 0, max = 0;
};

/// Output of `stiction inspect` for a batch. Vectors have one entry per environment by default.
struct Features {
  std::vector<Offset> rows, cones, nonzeros;
  std::vector<double> density;                          ///< nonzeros / rows^2, of environments that have rows
  std::array<Offset, kMaxConeRows + 1> friction{};      ///< friction cones by rows
  std::array<Offset, kMaxConeRows + 1> box_friction{};  ///< cones of boxed friction by rows
  std::array<Offset, kMaxConeRows + 1> semidefinite{};  ///< semidefinite matrices by rows
  Offset free = 0, unilateral = 0, box = 0;
  std::array<Offset, 3> paths{};         ///< environments by EnvPath
  std::vector<Offset> vertices, colors;  ///< of environments on the sparse path
  std::vector<Offset> islands;
  std::vector<double> asymmetry;
  std::optional<Range> friction_coefficient;  ///< mu over all friction axes
  std::optional<Range> compliance;            ///< R over all rows
  std::vector<OperatorAnalysis> operators;    ///< A + diag R of environments analysed, with rows and finite numbers
};

/// The most environments whose operator is analysed, spread evenly over the batch.
inline constexpr Offset kOperatorSample = 256;

/// Steps of each iteration there: more than a solver's choice would be worth, for a person waits for few environments.
inline constexpr Index kOperatorSteps = 100;

/// Relative error bound at which an estimate counts as settled.
inline constexpr double kSettledError = 1e-3;

Features measure(const ContactBatchView<double>& batch, const PlanData& plan);

}  // namespace stiction::cli
