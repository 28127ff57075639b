#include <optional>

#include "stiction/error.hpp"
#include "stiction/jacobian.hpp"
#include "tests/fuzz/checks.hpp"
#include "tests/fuzz/environments.hpp"
#include "tests/fuzz/promises.hpp"
#include "tests/fuzz/solver_options.hpp"

namespace stiction::fuzz {
namespace {

/// M is the unit matrix and some more on the diagonal; J is dense and of everyday numbers.
template <class Real>
JacobianEnvironment<Real> sound_environment(Bytes& bytes) {
  JacobianEnvironment<Real> environment;
  environment.cones = cones<Real>(bytes, 3);
  const auto rows = static_cast<std::size_t>(rows_of<Real>(environment.cones));
  const auto dofs = static_cast<std::size_t>(1 + bytes.below(6));
  for (std::size_t i = 0; i < rows * dofs; ++i) environment.J.push_back(tame<Real>(bytes));
  for (std::size_t i = 0; i < dofs; ++i) {
    for (std::size_t j = 0; j < dofs; ++j) environment.M.push_back(i == j ? Real(1) + share<Real>(bytes) : Real(0));
    environment.v_free.push_back(tame<Real>(bytes));
  }
  for (std::size_t i = 0; i < rows; ++i) {
    environment.target.push_back(tame<Real>(bytes) / 8);
    environment.R.push_back(Real(0.0625) + share<Real>(bytes));
    environment.mu.push_back(share<Real>(bytes));
    environment.lo.push_back(-share<Real>(bytes));
    environment.hi.push_back(share<Real>(bytes));
  }
  return environment;
}

template <class Real>
void spoil(JacobianEnvironment<Real>& environment, Bytes& bytes) {
  std::vector<Real>* arrays[] = {&environment.J, &environment.M,  &environment.v_free, &environment.target,
                                 &environment.R, &environment.mu, &environment.lo,     &environment.hi};
  for (int edits = bytes.below(8); edits > 0; --edits) {
    std::vector<Real>& array = *bytes.one_of(arrays);
    array[bytes.byte() % array.size()] = wild<Real>(bytes);
  }
}

struct Form {
  Law law;
  MassForm mass_form;
  FactorUse use;
};

template <class Real>
std::optional<JacobianSolution<Real>> solved(const Form& form, const std::vector<JacobianEnvironment<Real>>& all,
                                             const SolverOptions& options) {
  JacobianBatch<Real> batch(form.law, form.mass_form);
  for (const auto& environment : all) batch.add(environment);
  try {
    JacobianSolution<Real> solution = solve(batch, options, Device::cpu(), std::span<const Real>(), form.use);
    require(all_finite(std::span<const Real>(solution.contact.lambda)), "reactions are finite");
    require(all_finite(std::span<const Real>(solution.contact.w)), "motions are finite");
    for (const EnvStatus& status : solution.contact.status) require_sound_record(status);
    return solution;
  } catch (const Error& error) {
    require(is_refusal(error.code()), error.what());
    return std::nullopt;
  }
}

template <class Real>
void check(Bytes& bytes) {
  const Form form{static_cast<Law>(bytes.below(2)), static_cast<MassForm>(bytes.below(2)),
                  static_cast<FactorUse>(bytes.below(3))};
  const SolverOptions options = solver_options(bytes);
  std::vector<JacobianEnvironment<Real>> all(static_cast<std::size_t>(1 + bytes.below(3)));
  const auto spoiled = static_cast<std::size_t>(bytes.below(3));
  for (std::size_t env = 0; env < all.size(); ++env) {
    all[env] = sound_environment<Real>(bytes);
    if (env == spoiled) spoil(all[env], bytes);
  }
  const auto together = solved(form, all, options);
  std::size_t row = 0, dof = 0;
  for (std::size_t env = 0; env < all.size() && all.size() > 1; ++env) {
    const auto alone = solved(form, std::vector<JacobianEnvironment<Real>>{all[env]}, options);
    require(together.has_value() == alone.has_value(), "numbers of one environment refuse no other");
    if (together && alone) {
      require_alone(together->contact, alone->contact, row, env);
      if (all_finite(std::span<const Real>(all[env].v_free))) {  // bits of a NaN are not kept
        require(same_bits(std::span<const Real>(together->velocity).subspan(dof, alone->velocity.size()),
                          std::span<const Real>(alone->velocity)),
                "velocities do not depend on neighbours");
      }
    }
    row += all[env].R.size();
    dof += all[env].v_free.size();
  }
}

}  // namespace

void check_jacobians(Bytes& bytes) {
  if (bytes.once_in(2)) {
    check<double>(bytes);
  } else {
    check<float>(bytes);
  }
}

}  // namespace stiction::fuzz
