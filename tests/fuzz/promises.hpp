#pragma once

#include <algorithm>
#include <cmath>
#include <span>

#include "stiction/residual.hpp"
#include "stiction/solver.hpp"
#include "tests/fuzz/require.hpp"

namespace stiction::fuzz {

/// Returns true if a system did not accept the options. A solver may do so before it writes anything; numbers may not
/// bring it about.
inline bool is_refusal(ErrorCode code) {
  return code == ErrorCode::unsupported || code == ErrorCode::invalid_argument;
}

inline void require_sound_record(const EnvStatus& status) {
  require(static_cast<int>(status.code) < kEnvCodeCount, "a status has one of the codes");
  require((status.flags >> kEnvFlagCount) == 0, "a status has known flags only");
  require(status.iterations >= 0, "a status counts iterations from 0");
  require(status.islands == 0 || status.islands > 1, "several islands are solved apart, or none is");
  for (const std::uint8_t byte : status.reserved) require(byte == 0, "what is reserved in a status is zero");
  if (status.code == EnvCode::solved) {
    require(std::isfinite(status.residual) && std::isfinite(status.residual_absolute),
            "solved needs a finite residual");
  }
}

/// Residual that one rounding hides in an environment: 2^-53 of the largest |a x| or |y| (docs/math/residual.md,
/// "Roundings"). Batches have their normals first, and A stored.
template <class Real>
double hidden_by_rounding(const ContactBatchView<Real>& batch, std::span<const Real> lambda, std::size_t env) {
  double largest = 0;
  const auto first = batch.env_row_offsets[env];
  for (Offset cone = batch.env_cone_offsets[env]; cone < batch.env_cone_offsets[env + 1]; ++cone) {
    const Offset begin = batch.cone_row_offsets[cone], end = batch.cone_row_offsets[cone + 1];
    double trace = 0, reaction = 0;
    for (Offset row = begin; row < end; ++row) {
      const auto own = static_cast<double>(lambda[row]);
      const double mu = carries_friction(batch.cone_kind[cone]) && row > begin ? static_cast<double>(batch.mu[row]) : 1;
      double w = static_cast<double>(batch.b[row]) + static_cast<double>(batch.R[row]) * own;
      trace += static_cast<double>(batch.R[row]);
      for (Offset k = batch.row_offsets[row]; k < batch.row_offsets[row + 1]; ++k) {
        const auto entry = static_cast<double>(batch.A[k]);
        w += entry * static_cast<double>(lambda[first + batch.column[k]]);
        if (first + batch.column[k] == row) trace += entry;
      }
      largest = std::max(largest, std::abs(mu * w));
      if (mu > 0) reaction = std::max(reaction, std::abs(own / mu));
    }
    const double mean = trace / static_cast<double>(end - begin);
    largest = std::max(largest, reaction * (mean > 0 ? mean : 1));
  }
  return 0x1p-53 * largest;
}

/// `solved` is checked by code that shares nothing with the solvers. The solver's own residual is rounded, and so is
/// the other one, each by parts of the numbers that enter: hence a factor of two. It is a difference, too, of numbers
/// some of whose roundings it does not see. Their hidden part is within the tolerance or reported: hence so many of
/// them. Below the smallest normal number roundings are not parts of the rounded number.
template <class Real>
void require_residuals(const ContactBatchView<Real>& batch, std::span<const Real> lambda,
                       std::span<const EnvStatus> status) {
  constexpr double kRounding = 2, kRoundings = 1e-14, kHidden = 8, kLeastNormal = 0x1p-1022;
  const std::vector<Residual> residual = verify(batch, lambda);
  for (std::size_t env = 0; env < residual.size(); ++env) {
    if (status[env].code != EnvCode::solved) continue;
    const double hidden = kHidden * hidden_by_rounding(batch, lambda, env) + kLeastNormal;
    const bool holds = residual[env].relative <= kRounding * status[env].residual + kRoundings ||
                       residual[env].absolute <= kRounding * status[env].residual_absolute + hidden;
    if (!holds) {
      std::fprintf(stderr, "environment %zu, solver %s: reported %.17g (absolute %.17g), recomputed %.17g (%.17g)\n",
                   env, to_string(status[env].solver), status[env].residual, status[env].residual_absolute,
                   residual[env].relative, residual[env].absolute);
    }
    require(holds, "the residual of a solved environment is the one that it reports");
  }
}

/// Bits of environment `env` of a batch against those of the same environment solved alone.
template <class Real>
void require_alone(const Solution<Real>& all, const Solution<Real>& alone, std::size_t begin, std::size_t env) {
  const std::size_t rows = alone.lambda.size();
  require(same_bits(std::span<const Real>(all.lambda).subspan(begin, rows), std::span<const Real>(alone.lambda)),
          "reactions do not depend on neighbours");
  require(same_bits(std::span<const Real>(all.w).subspan(begin, rows), std::span<const Real>(alone.w)),
          "motions do not depend on neighbours");
  require(same_bits(std::span<const EnvStatus>(all.status).subspan(env, 1), std::span<const EnvStatus>(alone.status)),
          "a status does not depend on neighbours");
}

}  // namespace stiction::fuzz
