#pragma once

#include <span>

#include "stiction/residual.hpp"
#include "stiction/solver.hpp"
#include "tests/fuzz/require.hpp"

namespace stiction::fuzz {

/// Whether a system did not accept the options. A solver may do so before it writes anything; numbers may not bring it
/// about.
inline bool is_refusal(ErrorCode code) {
  return code == ErrorCode::unsupported || code == ErrorCode::invalid_argument;
}

inline void require_sound_record(const EnvStatus& status) {
  require(static_cast<int>(status.code) < kEnvCodeCount, "a status has one of the codes");
  require((status.flags >> kEnvFlagCount) == 0, "a status has known flags only");
  require(status.iterations >= 0, "a status counts iterations from 0");
  for (const std::uint8_t byte : status.reserved) require(byte == 0, "what is reserved in a status is zero");
  if (status.code == EnvCode::solved) {
    require(std::isfinite(status.residual) && std::isfinite(status.residual_absolute),
            "solved needs a finite residual");
  }
}

/// `solved` is checked by code that shares nothing with the solvers. The solver's own residual is rounded, and so is
/// the other one, each by parts of the numbers that enter: hence a factor of two.
template <class Real>
void require_residuals(const ContactBatchView<Real>& batch, std::span<const Real> lambda,
                       std::span<const EnvStatus> status) {
  constexpr double kRounding = 2, kRoundings = 1e-14;
  const std::vector<Residual> residual = verify(batch, lambda);
  for (std::size_t env = 0; env < residual.size(); ++env) {
    if (status[env].code != EnvCode::solved) continue;
    const bool holds = residual[env].relative <= kRounding * status[env].residual + kRoundings;
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
