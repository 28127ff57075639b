#include <optional>

#include "stiction/error.hpp"
#include "tests/fuzz/checks.hpp"
#include "tests/fuzz/environments.hpp"
#include "tests/fuzz/promises.hpp"
#include "tests/fuzz/solver_options.hpp"

namespace stiction::fuzz {
namespace {

template <class Real>
std::optional<Solution<Real>> solved(Law law, const std::vector<Case<Real>>& cases, const SolverOptions& options,
                                     bool warm) {
  const ContactBatch<Real> batch = batch_of(law, cases);
  const std::vector<Real> start = warm_starts_of(cases);
  try {
    Solution<Real> solution =
        solve(batch, options, Device::cpu(), warm ? std::span<const Real>(start) : std::span<const Real>());
    require(all_finite(std::span<const Real>(solution.lambda)), "reactions are finite");
    require(all_finite(std::span<const Real>(solution.w)), "motions are finite");
    for (const EnvStatus& status : solution.status) require_sound_record(status);
    require_residuals(batch.view(), std::span<const Real>(solution.lambda),
                      std::span<const EnvStatus>(solution.status));
    return solution;
  } catch (const Error& error) {
    require(is_refusal(error.code()), error.what());
    return std::nullopt;
  }
}

template <class Real>
void check(Bytes& bytes) {
  const Law law = static_cast<Law>(bytes.below(2));
  const SolverOptions options = solver_options(bytes);
  const bool warm = bytes.once_in(2);
  std::vector<Case<Real>> cases(static_cast<std::size_t>(1 + bytes.below(3)));
  const auto spoiled = static_cast<std::size_t>(bytes.below(3));
  for (std::size_t env = 0; env < cases.size(); ++env) {
    cases[env] = sound_case<Real>(bytes);
    if (env == spoiled) spoil(cases[env], bytes);
  }
  const auto together = solved(law, cases, options, warm);
  std::size_t begin = 0;
  for (std::size_t env = 0; env < cases.size(); ++env) {
    if (cases.size() > 1) {
      const auto alone = solved(law, std::vector<Case<Real>>{cases[env]}, options, warm);
      require(together.has_value() == alone.has_value(), "numbers of one environment refuse no other");
      if (together && alone) require_alone(*together, *alone, begin, env);
    }
    begin += cases[env].warm_start.size();
  }
}

}  // namespace

void check_contacts(Bytes& bytes) {
  if (bytes.once_in(2)) {
    check<double>(bytes);
  } else {
    check<float>(bytes);
  }
}

}  // namespace stiction::fuzz
