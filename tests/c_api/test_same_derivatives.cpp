#include <gtest/gtest.h>

#include <vector>

#include "tests/c_api/c_views.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/derivative_cases.hpp"
#include "tests/support/systems/jacobian_systems.hpp"

// Derivatives through the C interface against the C++ one: the same bits.
namespace {

using namespace stiction;
using namespace stiction::test;

stiction_gradient_status* records(std::vector<GradientStatus>& status) {
  return reinterpret_cast<stiction_gradient_status*>(status.data());
}

/// Options that are not the defaults.
DerivativeOptions options_of() {
  DerivativeOptions options;
  options.kappa = 1e-3;
  options.tie_tolerance = 1e-5;
  options.max_unknowns = 100;
  options.threads = 2;
  return options;
}
stiction_derivative* made() {
  stiction_derivative_options options;
  EXPECT_EQ(stiction_derivative_options_init(&options, sizeof options), STICTION_OK);
  EXPECT_EQ(options.residual_limit, DerivativeOptions{}.residual_limit);
  EXPECT_EQ(options.kappa, 0.0);
  options.tie_tolerance = 1e-5;
  options.max_unknowns = 100;
  options.threads = 2;
  options.kappa = 1e-3;
  stiction_derivative* derivative = nullptr;
  EXPECT_EQ(stiction_derivative_create("cpu", &options, nullptr, &derivative), STICTION_OK) << stiction_last_error();
  return derivative;
}

template <class Real>
void same_derivatives() {
  const ContactBatch<Real> batch =
      convert<Real>(batch_of({random_contacts({.seed = 3}), random_contacts({.seed = 4})}));
  const auto solution = solve(batch, options(SolverKind::npgs, 1e-5, 2000));
  auto bar = random_numbers<Real>(2 * solution.lambda.size(), 1), w_bar = random_numbers<Real>(bar.size(), 2);
  const auto expected = vjp(batch.view(), solution.lambda, bar, w_bar, options_of(), solution.status.data(), 2);
  const stiction_batch_view view = c_view(batch.view());
  stiction_derivative* derivative = made();
  stiction_solution_numbers from;
  stiction_batch_numbers to;
  stiction_solution_numbers_init(&from, sizeof from);
  stiction_batch_numbers_init(&to, sizeof to);
  from.lambda = bar.data();
  from.w = w_bar.data();
  Gradients<Real> own = expected;
  for (auto* part : {&own.A, &own.b, &own.R, &own.mu, &own.lo, &own.hi}) part->assign(part->size(), Real(77));
  to.A = own.A.data();
  to.b = own.b.data();
  to.R = own.R.data();
  to.mu = own.mu.data();
  to.lo = own.lo.data();
  to.hi = own.hi.data();
  const auto* status = reinterpret_cast<const stiction_status*>(solution.status.data());
  STICTION_OK_OR_SAY(stiction_derivative_vjp(derivative, &view, solution.lambda.data(), status, &from, &to,
                                             records(own.status), 2, nullptr));
  EXPECT_EQ(own.all(), expected.all());
  EXPECT_EQ(own.status[1].unknowns, expected.status[1].unknowns);

  // The written arrays are now read: changes of the batch.
  const auto forward = jvp(batch.view(), solution.lambda,
                           BatchTangentView<Real>{own.A.data(), nullptr, own.b.data(), own.R.data(), own.mu.data(),
                                                  own.lo.data(), own.hi.data()},
                           options_of());
  Changes<Real> changes = forward;
  changes.lambda.assign(changes.lambda.size(), Real(77));
  stiction_solution_numbers answer;
  stiction_solution_numbers_init(&answer, sizeof answer);
  answer.lambda = changes.lambda.data();
  answer.w = changes.w.data();
  STICTION_OK_OR_SAY(stiction_derivative_jvp(derivative, &view, solution.lambda.data(), status, &to, &answer,
                                             records(changes.status), 1, nullptr));
  EXPECT_EQ(changes.lambda, forward.lambda);
  EXPECT_EQ(changes.w, forward.w);

  answer.velocity = changes.w.data();
  EXPECT_EQ(stiction_derivative_jvp(derivative, &view, solution.lambda.data(), status, &to, &answer,
                                    records(changes.status), 1, nullptr),
            STICTION_INVALID_ARGUMENT);
  STICTION_OK_OR_SAY(stiction_derivative_synchronize(derivative, nullptr));
  STICTION_OK_OR_SAY(stiction_derivative_destroy(derivative));
  EXPECT_EQ(stiction_derivative_destroy(derivative), STICTION_INVALID_ARGUMENT);
}

TEST(SameDerivatives, OfContactBatches) {
  same_derivatives<float>();
  same_derivatives<double>();
}

TEST(SameDerivatives, OfSweeps) {
  const ContactBatch<float> batch =
      convert<float>(batch_of({random_contacts({.seed = 3}), random_contacts({.seed = 4})}));
  const auto view = batch.view();
  const auto rows = static_cast<std::size_t>(view.row_count);
  const auto room = [](std::size_t count) { return std::vector<float>(count, 77.0F); };
  auto start = random_numbers<float>(rows, 1), bar = random_numbers<float>(2 * rows, 2),
       w_bar = random_numbers<float>(2 * rows, 3);
  // A, b, R, mu, lo, hi, the answer, where the sweeps began.
  std::vector<std::vector<float>> own{room(2 * static_cast<std::size_t>(view.nonzero_count))};
  for (const std::size_t sets : {2, 2, 2, 2, 2, 1, 2}) own.push_back(room(sets * rows));
  auto expected = own;
  std::vector<GradientStatus> status(2), same(2);
  Derivative(Device::cpu(), options_of())
      .unrolled_vjp(view, SweepsView<float>{start.data(), 5, 0.9, expected[6].data(), expected[7].data()},
                    SolutionCotangentView<float>{bar.data(), w_bar.data()},
                    BatchCotangentView<float>{expected[0].data(), nullptr, expected[1].data(), expected[2].data(),
                                              expected[3].data(), expected[4].data(), expected[5].data()},
                    status.data(), 2);
  stiction_derivative* derivative = made();
  const stiction_batch_view given = c_view(view);
  stiction_sweeps sweeps;
  stiction_solution_numbers from;
  stiction_batch_numbers to;
  stiction_sweeps_init(&sweeps, sizeof sweeps);
  stiction_solution_numbers_init(&from, sizeof from);
  stiction_batch_numbers_init(&to, sizeof to);
  sweeps.warm_start = start.data();
  sweeps.count = 5;
  sweeps.omega = 0.9;
  from.lambda = bar.data();
  from.w = w_bar.data();
  void** const fields[] = {&to.A, &to.b, &to.R, &to.mu, &to.lo, &to.hi, &sweeps.lambda, &sweeps.by_warm_start};
  for (std::size_t k = 0; k < own.size(); ++k) *fields[k] = own[k].data();
  STICTION_OK_OR_SAY(
      stiction_derivative_unrolled_vjp(derivative, &given, &sweeps, &from, &to, records(same), 2, nullptr));
  EXPECT_EQ(own, expected);
  EXPECT_EQ(same[1].forward_residual, status[1].forward_residual);
  STICTION_OK_OR_SAY(stiction_derivative_destroy(derivative));
}

TEST(SameDerivatives, OfJacobianBatches) {
  JacobianBatch<double> batch(Law::coulomb);
  for (std::uint64_t seed = 1; seed < 4; ++seed) batch.add(random_jacobian({seed, 2, 2, 6, 0}));
  const auto view = batch.view();
  const auto solution = solve(batch, options(SolverKind::newton, 1e-10, 100));
  auto v_bar = random_numbers(static_cast<std::size_t>(view.dof_count), 1);
  const auto room = [](Offset count) { return std::vector<double>(static_cast<std::size_t>(count), 77.0); };
  std::vector<std::vector<double>> own, expected;
  for (const Offset size : {view.entry_count, view.mass_count, view.dof_count, view.row_count, view.row_count,
                            view.row_count, view.row_count, view.row_count})
    own.push_back(room(size));
  expected = own;
  std::vector<GradientStatus> status(3), same(3);
  Derivative(Device::cpu(), options_of())
      .vjp(view, ReactionView<double>{solution.contact.lambda.data(), nullptr},
           JacobianSolutionCotangentView<double>{nullptr, nullptr, v_bar.data()},
           JacobianBatchCotangentView<double>{expected[0].data(), expected[1].data(), expected[2].data(),
                                              expected[3].data(), expected[4].data(), expected[5].data(),
                                              expected[6].data(), expected[7].data()},
           status.data());
  EXPECT_EQ(status[0].flags, 0U);
  stiction_derivative* derivative = made();
  const stiction_jacobian_view given = c_view(view);
  stiction_solution_numbers from;
  stiction_jacobian_numbers to;
  stiction_solution_numbers_init(&from, sizeof from);
  stiction_jacobian_numbers_init(&to, sizeof to);
  from.velocity = v_bar.data();
  void** const fields[] = {&to.J, &to.M, &to.v_free, &to.target, &to.R, &to.mu, &to.lo, &to.hi};
  for (std::size_t k = 0; k < own.size(); ++k) *fields[k] = own[k].data();
  STICTION_OK_OR_SAY(stiction_derivative_vjp_jacobian(derivative, &given, solution.contact.lambda.data(), nullptr,
                                                      &from, &to, records(same), 1, nullptr));
  EXPECT_EQ(own, expected);
  EXPECT_EQ(same[2].unknowns, status[2].unknowns);

  // The written arrays are now read: changes of the batch.
  std::vector<std::vector<double>> changes{room(view.row_count), room(view.row_count), room(view.dof_count)};
  auto forward = changes;
  Derivative(Device::cpu(), options_of())
      .jvp(view, ReactionView<double>{solution.contact.lambda.data(), nullptr},
           JacobianBatchTangentView<double>{own[0].data(), own[1].data(), own[2].data(), own[3].data(), own[4].data(),
                                            own[5].data(), own[6].data(), own[7].data()},
           JacobianSolutionTangentView<double>{forward[0].data(), forward[1].data(), forward[2].data()}, status.data());
  from.lambda = changes[0].data();
  from.w = changes[1].data();
  from.velocity = changes[2].data();
  STICTION_OK_OR_SAY(stiction_derivative_jvp_jacobian(derivative, &given, solution.contact.lambda.data(), nullptr, &to,
                                                      &from, records(same), 1, nullptr));
  EXPECT_EQ(changes, forward);
  EXPECT_NE(changes[2], room(view.dof_count));
  STICTION_OK_OR_SAY(stiction_derivative_destroy(derivative));
}

TEST(SameDerivatives, RefuseWhatTheyCannotDo) {
  stiction_derivative* derivative = nullptr;
  EXPECT_EQ(stiction_derivative_create("emulated", nullptr, nullptr, &derivative), STICTION_INVALID_ARGUMENT);
  stiction_derivative_options options;
  stiction_derivative_options_init(&options, sizeof options);
  options.residual_limit = -1;
  EXPECT_EQ(stiction_derivative_create("cpu", &options, nullptr, &derivative), STICTION_INVALID_ARGUMENT);
  stiction_derivative_options_init(&options, sizeof options);
  options.reserved = 1;
  EXPECT_EQ(stiction_derivative_create("cpu", &options, nullptr, &derivative), STICTION_INVALID_ARGUMENT);
  EXPECT_STREQ(stiction_gradient_flag_name(STICTION_GRADIENT_SINGULAR), "singular");
  EXPECT_STREQ(stiction_gradient_flag_name(1U << 30U), "unknown");
}

}  // namespace
