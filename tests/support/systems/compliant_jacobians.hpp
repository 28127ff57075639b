#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/machine/jacobian_machine.hpp"
#include "cpu_fallback/machine/jacobian_pack_parts.hpp"
#include "tests/support/oracles/jacobian_derivatives.hpp"

/// Compliant environments of J and M, which lanes differentiate side by side, and who answers them.
namespace stiction::test {

/// Cones of every kind and size that lanes take, some tangential axes without friction, no two rows of like compliance.
inline JacobianEnvironment<double> draw(std::uint64_t seed, MassForm form = MassForm::matrix) {
  scenes::Rng rng(seed);
  const std::size_t dofs = 1 + seed * 7 % 29;
  JacobianEnvironment<double> env;
  const auto add = [&](const auto& cone) {
    env.cones.push_back(cone);
    for (Index k = 0; k < cone.row_count; ++k) {
      const bool has_friction = cone.kind == ConeKind::friction && k > 0 && rng.uniform(0.0, 1.0) > 0.15;
      env.mu.push_back(has_friction ? rng.uniform(0.1, 1.2) : 0.0);
      env.R.push_back(rng.uniform(0.005, 0.05));
      env.target.push_back(rng.symmetric(0.1));
      const double lo = rng.symmetric(0.3);
      env.lo.push_back(lo);
      env.hi.push_back(lo + rng.uniform(0.0, 0.5));
    }
  };
  for (std::uint64_t c = 0; c < 1 + seed % 6; ++c) {
    add(friction(static_cast<Index>(2 + (seed + c) % 5)));
    if (c % 2 == 0) add(unilateral());
    if (c % 3 == 0) add(box());
    if (c == 1) add(free_row());
  }
  for (std::size_t i = 0; i < env.mu.size() * dofs; ++i)
    env.J.push_back(rng.uniform(0.0, 1.0) < 0.3 ? 0.0 : rng.symmetric(1.0));
  for (std::size_t k = 0; k < dofs; ++k) env.v_free.push_back(rng.symmetric(1.0));
  std::vector<double> root(dofs * dofs);
  for (double& entry : root) entry = rng.symmetric(0.5);
  for (std::size_t i = 0; i < dofs; ++i)
    for (std::size_t j = 0; j < dofs; ++j) {
      double sum = i == j ? 0.5 : 0.0;
      for (std::size_t k = 0; k < dofs; ++k) sum += root[i * dofs + k] * root[j * dofs + k];
      env.M.push_back(sum);
    }
  if (form == MassForm::factor) env.M = cholesky(env.M, dofs);
  return env;
}

inline JacobianBatch<double> batch_of(const std::vector<JacobianEnvironment<double>>& envs,
                                      MassForm form = MassForm::matrix) {
  JacobianBatch<double> batch(Law::convex, form);
  for (const auto& env : envs) batch.add(env);
  return batch;
}
inline std::vector<JacobianEnvironment<double>> draw_all(std::uint64_t count, MassForm form = MassForm::matrix) {
  std::vector<JacobianEnvironment<double>> envs;
  for (std::uint64_t seed = 1; seed <= count; ++seed) envs.push_back(draw(seed, form));
  return envs;
}
inline std::vector<double> solved(const JacobianBatch<double>& batch) {
  return solve(batch, options(SolverKind::newton, 1e-12, 200)).contact.lambda;
}

/// Which environments lanes answer in a job of either direction, asked of the kernels themselves.
template <class Job, class Kernel>
std::vector<std::uint8_t> answered_by(Kernel kernel, Job& job, const JacobianBatchView<double>& view,
                                      const std::vector<double>& lambda, const DerivativeOptions& o) {
  const auto machine = make_cpu_jacobian_machine<double>(FactorUse::by_size, 1);
  std::vector<GradientStatus> status(static_cast<std::size_t>(view.env_count));
  static_cast<DerivativeJob<double>&>(job.contact) = {
      {}, {lambda.data(), nullptr}, view.law, o.residual_limit, o.tie_tolerance, o.max_unknowns, 1, status.data()};
  std::vector<double> in(lambda.size()), out(lambda.size());
  std::vector<std::uint8_t> found(static_cast<std::size_t>(view.env_count));
  job.connect(machine->lay_out(view, StreamRef::default_stream()), in.data(), out.data());
  cpu::JacobianPackParts<double, Job> parts(job);
  cpu::VelocityScratch scratch;
  kernel(job, parts.all().data(), parts.results(), static_cast<Offset>(parts.all().size()), scratch);
  parts.finish(found.data());
  return found;
}
/// M itself, where a factor of it was given.
inline std::vector<double> full_mass_of(const JacobianEnvironment<double>& env, MassForm form) {
  if (form == MassForm::matrix) return env.M;
  const std::size_t dofs = env.v_free.size();
  std::vector<double> M(env.M.size());
  for (std::size_t i = 0; i < dofs; ++i)
    for (std::size_t j = 0; j < dofs; ++j)
      for (std::size_t k = 0; k < dofs; ++k) M[i * dofs + j] += env.M[i * dofs + k] * env.M[j * dofs + k];
  return M;
}

/// Compares records of lanes with those of the contact batch that is assembled. Residuals may differ by
/// `most`: in a part they are roundings of the whole's max|b|, over the scale of an island that is smaller.
inline void expect_records_near(const std::vector<GradientStatus>& own, const std::vector<GradientStatus>& expected,
                                double most = 1e-14) {
  for (std::size_t e = 0; e < own.size(); ++e) {
    EXPECT_EQ(own[e].flags, expected[e].flags) << e;
    EXPECT_EQ(own[e].unknowns, expected[e].unknowns) << e;
    EXPECT_NEAR(own[e].forward_residual, expected[e].forward_residual, most) << e;
    EXPECT_LT(own[e].residual, 1e-11) << e;
  }
}

inline double largest(const std::vector<double>& numbers) {
  double most = 0.0;
  for (const double number : numbers) most = std::max(most, std::abs(number));
  return most;
}

}  // namespace stiction::test
