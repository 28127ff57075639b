#pragma once

#include <limits>
#include <string>

#include "tests/support/golden/forms.hpp"
#include "tests/support/oracles/jacobian_derivatives.hpp"

/// Golden rows of derivatives, by contacts, by J and M and of sweeps: both directions, numbers and records. On the CPU
/// and the emulated device, which read the arrays where they are; a GPU would need them in its own memory.
namespace stiction::test {

/// Reactions of any residual are differentiated, as an iteration's budget leaves them.
inline Derivative golden_derivative(Device device, double kappa = 0.0) {
  DerivativeOptions options;
  options.residual_limit = std::numeric_limits<double>::infinity();
  options.kappa = kappa;
  Capacity room;
  room.env_rows = 120;
  room.env_nonzeros = 120 * 120;
  room.env_dofs = 128;
  return Derivative(device, options, room);
}

inline Digest& add_records(Digest& digest, const std::vector<GradientStatus>& records) {
  for (const GradientStatus& status : records)
    digest.add(std::vector<double>{status.residual, status.forward_residual, static_cast<double>(status.flags),
                                   static_cast<double>(status.unknowns), static_cast<double>(status.degenerate)});
  return digest;
}

/// A view of arrays as a device has it.
template <class View>
View as_on(Device device, View view) {
  if (device.kind != DeviceKind::cpu) view.space = MemorySpace::cuda;
  return view;
}

template <class Real>
Gradients<Real> room_for(const ContactBatchView<Real>& view) {
  Gradients<Real> room;
  room.A.resize(static_cast<std::size_t>(view.nonzero_count));
  room.factor.resize(static_cast<std::size_t>(view.factor_count));
  room.b = room.R = room.mu = room.lo = room.hi = std::vector<Real>(static_cast<std::size_t>(view.row_count));
  room.status.resize(static_cast<std::size_t>(view.env_count));
  return room;
}

inline void add_contact_derivatives(GoldenCases& cases) {
  for (const double kappa : {0.0, 1e-2})
    add_laws(
        cases, std::string("derivative/contacts/") + (kappa > 0.0 ? "relaxed" : "exact"),
        [kappa](auto real, Law law, Device device) {
          using Real = decltype(real);
          const auto batch = assemble(golden_jacobians<Real>(kGoldenJacobians[0], law).view(), FactorUse::never, 1);
          const auto view = as_on(device, batch.view());
          const auto lambda = solve(batch, golden_options(SolverKind::npgs)).lambda;
          const auto bar = random_numbers<Real>(lambda.size(), 1), w_bar = random_numbers<Real>(lambda.size(), 2);
          const Derivative derivative = golden_derivative(device, kappa);
          Gradients<Real> back = room_for(view);
          const ReactionView<Real> at{lambda.data(), nullptr};
          derivative.vjp(view, at, SolutionCotangentView<Real>{bar.data(), w_bar.data()}, back.view(),
                         back.status.data());
          Changes<Real> changes{lambda, lambda, back.status};
          derivative.jvp(view, at,
                         BatchTangentView<Real>{back.A.data(), nullptr, bar.data(), back.R.data(), back.mu.data(),
                                                nullptr, nullptr},
                         SolutionTangentView<Real>{changes.lambda.data(), changes.w.data()}, changes.status.data());
          Digest digest;
          digest.add(back.all()).add(changes.lambda).add(changes.w);
          add_records(digest, back.status);
          return add_records(digest, changes.status).value();
        });
}

/// Under the convex law lanes pull most of these back, and the last of them part by part.
inline void add_jacobian_derivatives(GoldenCases& cases) {
  for (const GoldenJacobian& form : kGoldenJacobians)
    add_laws(cases, std::string("derivative/jacobian/") + form.name, [form](auto real, Law law, Device device) {
      using Real = decltype(real);
      JacobianBatch<Real> batch = golden_jacobians<Real>(form, law);
      if (form.mass_block == 0 && !form.sparse) {
        std::vector<JacobianEnvironment<double>> parts;
        for (std::uint64_t seed = 1; seed <= 6; ++seed) parts.push_back(random_jacobian({seed, 2, 2, 12, 0}));
        batch.add(cast<Real>(beside_one_another(parts)));
      }
      const auto view = as_on(device, batch.view());
      const auto lambda = solve(batch, golden_options(SolverKind::automatic)).contact.lambda;
      const auto bar = random_numbers<Real>(lambda.size(), 1), w_bar = random_numbers<Real>(lambda.size(), 2),
                 v_bar = random_numbers<Real>(static_cast<std::size_t>(view.dof_count), 3);
      const Derivative derivative = golden_derivative(device);
      const ReactionView<Real> at{lambda.data(), nullptr};
      JacobianGradients<Real> back(view);
      derivative.vjp(view, at, JacobianSolutionCotangentView<Real>{bar.data(), w_bar.data(), v_bar.data()}, back.view(),
                     back.status.data());
      JacobianChanges<Real> changes(view);
      derivative.jvp(view, at, back.tangents(), changes.view(), changes.status.data());
      Digest digest;
      digest.add(back.all()).add(changes.all());
      add_records(digest, back.status);
      return add_records(digest, changes.status).value();
    });
}

inline void add_sweep_derivatives(GoldenCases& cases) {
  add_laws(cases, "derivative/sweeps/pgs", [](auto real, Law law, Device device) {
    using Real = decltype(real);
    const auto batch = assemble(golden_jacobians<Real>(kGoldenJacobians[1], law).view(), FactorUse::never, 1);
    const auto view = as_on(device, batch.view());
    const auto rows = static_cast<std::size_t>(view.row_count);
    const auto start = random_numbers<Real>(rows, 1), bar = random_numbers<Real>(rows, 2);
    Gradients<Real> back = room_for(view);
    std::vector<Real> lambda(rows), by_start(rows);
    golden_derivative(device).unrolled_vjp(view, SweepsView<Real>{start.data(), 5, 1.0, lambda.data(), by_start.data()},
                                           SolutionCotangentView<Real>{bar.data(), nullptr}, back.view(),
                                           back.status.data());
    Digest digest;
    digest.add(back.all()).add(lambda).add(by_start);
    return add_records(digest, back.status).value();
  });
}

}  // namespace stiction::test
