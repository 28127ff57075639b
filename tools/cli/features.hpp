#pragma once

#include <array>
#include <optional>
#include <vector>

#include "core/schedule/plan.hpp"
#include "stiction/batch.hpp"
#include "tools/cli/quantiles.hpp"

namespace stiction::cli {

struct Range {
  double min = 0, max = 0;
};

/// What `stiction inspect` says about a batch. Vectors have one entry per environment unless they say otherwise.
struct Features {
  std::vector<Offset> rows, cones, nonzeros;
  std::vector<double> density;                      ///< nonzeros / rows^2, of environments that have rows
  std::array<Offset, kMaxConeRows + 1> friction{};  ///< friction cones by rows
  Offset free = 0, unilateral = 0, box = 0;
  std::array<Offset, 3> paths{};         ///< environments by EnvPath
  std::vector<Offset> vertices, colors;  ///< of environments on the sparse path
  std::vector<Offset> islands;
  std::vector<double> asymmetry;
  std::optional<Range> friction_coefficient;  ///< mu over all friction axes
  std::optional<Range> compliance;            ///< R over all rows
  std::vector<double> condition;              ///< of the environments that were looked at
  Offset condition_complete = 0;              ///< ... of which resolved completely
  Offset singular = 0;                        ///< ... of which singular to within rounding
  Offset indefinite = 0;                      ///< ... of which with an eigenvalue below zero by more than rounding
};

/// The most environments whose spectrum is estimated, spread evenly over the batch.
inline constexpr Offset kSpectrumSample = 256;

Features measure(const ContactBatchView<double>& batch, const PlanData& plan);

}  // namespace stiction::cli
