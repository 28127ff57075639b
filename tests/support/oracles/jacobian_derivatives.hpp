#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "tests/support/systems/derivative_cases.hpp"
#include "tests/support/systems/jacobian_cotangents.hpp"
#include "tests/support/systems/jacobian_systems.hpp"
#include "tests/support/systems/roomy_jacobians.hpp"

/// Derivatives by J and M on the host, with memory of their own.
namespace stiction::test {

/// Environments with dense J and M as one, in which nothing couples them.
inline JacobianEnvironment<double> beside_one_another(const std::vector<JacobianEnvironment<double>>& parts) {
  std::size_t dofs = 0, first = 0;
  for (const auto& part : parts) dofs += part.v_free.size();
  JacobianEnvironment<double> whole;
  whole.M.assign(dofs * dofs, 0.0);
  for (const auto& part : parts) {
    const std::size_t own = part.v_free.size(), rows = whole.mu.size();
    for (const auto member :
         {&JacobianEnvironment<double>::v_free, &JacobianEnvironment<double>::target, &JacobianEnvironment<double>::R,
          &JacobianEnvironment<double>::mu, &JacobianEnvironment<double>::lo, &JacobianEnvironment<double>::hi})
      (whole.*member).insert((whole.*member).end(), (part.*member).begin(), (part.*member).end());
    whole.cones.insert(whole.cones.end(), part.cones.begin(), part.cones.end());
    whole.J.resize(whole.mu.size() * dofs, 0.0);
    for (std::size_t i = 0; i < part.mu.size(); ++i)
      for (std::size_t k = 0; k < own; ++k) whole.J[(rows + i) * dofs + first + k] = part.J[i * own + k];
    for (std::size_t i = 0; i < own; ++i)
      for (std::size_t j = 0; j < own; ++j) whole.M[(first + i) * dofs + first + j] = part.M[i * own + j];
    first += own;
  }
  return whole;
}

/// Form of J and M.
struct Form {
  Index mass_block;
  MassForm mass_form;
  bool csr;
};
inline constexpr Form kForms[] = {{0, MassForm::matrix, false},
                                  {3, MassForm::matrix, true},
                                  {1, MassForm::matrix, false},
                                  {0, MassForm::factor, true},
                                  {3, MassForm::factor, false}};

/// L of M = L L', block by block.
inline std::vector<double> cholesky(const std::vector<double>& M, std::size_t block) {
  std::vector<double> L(M.size(), 0.0);
  for (std::size_t first = 0; first < M.size(); first += block * block)
    for (std::size_t i = 0; i < block; ++i)
      for (std::size_t j = 0; j <= i; ++j) {
        double sum = M[first + i * block + j];
        for (std::size_t k = 0; k < j; ++k) sum -= L[first + i * block + k] * L[first + j * block + k];
        L[first + i * block + j] = i == j ? std::sqrt(sum) : sum / L[first + j * block + j];
      }
  return L;
}

inline JacobianEnvironment<double> environment_of(const Form& form, std::uint64_t seed) {
  JacobianEnvironment<double> env = random_jacobian({seed, 3, 2, 9, form.mass_block, 0.02});
  const std::size_t rows = env.mu.size();
  if (form.csr) {
    // Every third entry is left out.
    std::vector<double> J;
    env.row_offsets = {0};
    for (std::size_t i = 0; i < rows; ++i) {
      for (std::size_t k = 0; k < 9; ++k)
        if ((i + k) % 3 != 0) {
          J.push_back(env.J[i * 9 + k]);
          env.column.push_back(static_cast<Index>(k));
        }
      env.row_offsets.push_back(static_cast<Index>(J.size()));
    }
    env.J = J;
  }
  if (form.mass_form == MassForm::factor)
    env.M = cholesky(env.M, form.mass_block == 0 ? 9 : static_cast<std::size_t>(form.mass_block));
  return env;
}

inline JacobianBatch<double> batch_of(const JacobianEnvironment<double>& env, const Form& form, Law law) {
  JacobianBatch<double> batch(law, form.mass_form, form.mass_block);
  batch.add(env);
  return batch;
}

inline JacobianGradients<double> vjp(const JacobianBatchView<double>& view, const std::vector<double>& lambda,
                                     const std::vector<double>& lambda_bar, const std::vector<double>& w_bar,
                                     const std::vector<double>& v_bar, const DerivativeOptions& options = {}) {
  const auto data = [](const std::vector<double>& numbers) { return numbers.empty() ? nullptr : numbers.data(); };
  JacobianGradients<double> to(view);
  Derivative(Device::cpu(), options)
      .vjp(view, ReactionView<double>{lambda.data(), nullptr},
           JacobianSolutionCotangentView<double>{data(lambda_bar), data(w_bar), data(v_bar)}, to.view(),
           to.status.data());
  return to;
}

inline JacobianSolution<double> solved(const JacobianEnvironment<double>& env, const Form& form, Law law,
                                       double tolerance) {
  return solve(batch_of(env, form, law), options(SolverKind::newton, tolerance, 100));
}

/// A change of M is symmetric, that of a factor lower triangular.
inline void restrict_mass(const Form& form, std::vector<double>& direction) {
  const std::size_t block = form.mass_block == 0 ? 9 : static_cast<std::size_t>(form.mass_block);
  for (std::size_t first = 0; first < direction.size(); first += block * block)
    for (std::size_t i = 0; i < block; ++i)
      for (std::size_t j = i + 1; j < block; ++j)
        direction[first + i * block + j] = form.mass_form == MassForm::factor ? 0.0 : direction[first + j * block + i];
}

}  // namespace stiction::test
