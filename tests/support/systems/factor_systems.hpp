#pragma once

#include <vector>

#include "tests/support/systems/jacobian_systems.hpp"

/// One contact problem in the two forms that it can have: as a factor, and as the matrix that the definitions make.
namespace stiction::test {

inline ContactBatch<double> as_factor(const JacobianEnvironment<double>& env, Law law) {
  JacobianBatch<double> jacobian(law);
  jacobian.add(env);
  return assemble(jacobian.view(), FactorUse::always);
}

/// J M^-1 J' and b worked out by elimination, without a factor.
inline Environment<double> as_matrix(const JacobianEnvironment<double>& env) {
  const JacobianOracle oracle(env, 0);
  Environment<double> result = system(env.cones, oracle.A, oracle.b);
  result.R = env.R;
  result.mu = env.mu;
  return result;
}

}  // namespace stiction::test
