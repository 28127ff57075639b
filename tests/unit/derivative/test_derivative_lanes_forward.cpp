// Changes of compliant environments of J and M, which lanes push forward side by side. They are compared with those of
// the contact batch that is assembled of them, which takes another linear system, and with the reverse pass.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "cpu_fallback/tables/isa.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/compliant_jacobians.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

std::vector<std::uint8_t> answered_forward(const JacobianBatchView<double>& view, const std::vector<double>& lambda,
                                           const JacobianBatchTangentView<double>& tangents = {},
                                           const DerivativeOptions& o = {}) {
  JacobianChanges<double> to(view);
  JacobianJvpJob<double> job{};
  job.tangents = tangents;
  job.changes = to.view();
  return answered_by(cpu::best_isa().derivative().f64.packs.jacobian_jvp, job, view, lambda, o);
}

JacobianChanges<double> jvp(const JacobianBatchView<double>& view, const std::vector<double>& lambda,
                            const JacobianBatchTangentView<double>& tangents, const DerivativeOptions& o = {}) {
  JacobianChanges<double> to(view);
  Derivative(Device::cpu(), o)
      .jvp(view, ReactionView<double>{lambda.data(), nullptr}, tangents, to.view(), to.status.data());
  return to;
}
/// Random changes of everything.
JacobianGradients<double> random_changes(const JacobianBatchView<double>& view, std::uint64_t seed) {
  JacobianGradients<double> to(view);
  for (auto* part : to.parts()) *part = random_numbers(part->size(), seed++);
  return to;
}

/// Expects changes of rows and of v_free as through another linear system, which velocities follow.
void expect_as_assembled(const std::vector<JacobianEnvironment<double>>& envs, MassForm form,
                         double residuals = 1e-14) {
  const auto batch = batch_of(envs, form);
  const auto view = batch.view();
  const auto lambda = solved(batch);
  auto along = random_changes(view, 3);
  along.J.assign(along.J.size(), 0.0);
  along.M.assign(along.M.size(), 0.0);
  EXPECT_EQ(answered_forward(view, lambda, along.tangents()), std::vector<std::uint8_t>(envs.size(), 1));
  const auto own = jvp(view, lambda, along.tangents());
  std::vector<double> b(lambda.size());
  for (std::size_t e = 0, row = 0, dof = 0; e < envs.size(); dof += envs[e++].v_free.size())
    for (std::size_t i = 0; i < envs[e].mu.size(); ++i, ++row) {
      b[row] = -along.target[row];
      for (std::size_t k = 0; k < envs[e].v_free.size(); ++k)
        b[row] += envs[e].J[i * envs[e].v_free.size() + k] * along.v_free[dof + k];
    }
  const auto expected = test::jvp(assemble(view, FactorUse::never).view(), lambda,
                                  BatchTangentView<double>{nullptr, nullptr, b.data(), along.R.data(), along.mu.data(),
                                                           along.lo.data(), along.hi.data()});
  std::vector<double> velocity = along.v_free;
  for (std::size_t e = 0, row = 0, dof = 0; e < envs.size(); row += envs[e].mu.size(), dof += envs[e++].v_free.size()) {
    const std::size_t dofs = envs[e].v_free.size();
    std::vector<double> pushed(dofs);
    for (std::size_t i = 0; i < envs[e].mu.size(); ++i)
      for (std::size_t k = 0; k < dofs; ++k) pushed[k] += envs[e].J[i * dofs + k] * expected.lambda[row + i];
    const auto moved = solve_columns(full_mass_of(envs[e], form), pushed, dofs);
    for (std::size_t k = 0; k < dofs; ++k) velocity[dof + k] += moved[k];
  }
  const auto compare = [&](const char* name, const std::vector<double>& one, const std::vector<double>& other) {
    for (std::size_t i = 0; i < one.size(); ++i)
      EXPECT_NEAR(one[i], other[i], 1e-9 * largest(other)) << name << ' ' << i;
  };
  compare("lambda", own.lambda, expected.lambda);
  compare("w", own.w, expected.w);
  compare("velocity", own.velocity, velocity);
  expect_records_near(own.status, expected.status, residuals);
}

/// Expects changes of everything as the transpose of the reverse pass.
void expect_transpose(const JacobianBatchView<double>& view, const std::vector<double>& lambda,
                      const JacobianGradients<double>& along) {
  const auto own = jvp(view, lambda, along.tangents());
  const auto bar = random_numbers(lambda.size(), 21), w_bar = random_numbers(lambda.size(), 22),
             v_bar = random_numbers(own.velocity.size(), 23);
  const auto back = test::vjp(view, lambda, bar, w_bar, v_bar);
  const auto changes = along.all(), gradients = back.all();
  const double pulled = dot(changes, gradients), size = dot_of_sizes(changes, gradients);
  const double pushed = dot(own.lambda, bar) + dot(own.w, w_bar) + dot(own.velocity, v_bar);
  EXPECT_NEAR(pushed, pulled, 1e-12 * size);
}

TEST(ForwardDerivativeInLanes, IsThatOfTheAssembledBatch) {
  for (const MassForm form : {MassForm::matrix, MassForm::factor}) expect_as_assembled(draw_all(60, form), form);
}

/// Also of stored entries of J that are zero.
TEST(ForwardDerivativeInLanes, IsTheTransposeOfReverse) {
  for (const MassForm form : {MassForm::matrix, MassForm::factor}) {
    const auto batch = batch_of(draw_all(60, form), form);
    const auto view = batch.view();
    expect_transpose(view, solved(batch), random_changes(view, 5));
    EXPECT_GT(std::ranges::count(std::vector<double>(view.J, view.J + view.entry_count), 0.0), 100);
  }
}

/// Robots beside one another, and how they change without being coupled.
struct Robots {
  std::vector<JacobianEnvironment<double>> parts;
  JacobianEnvironment<double> whole;
  JacobianBatch<double> batch;

  explicit Robots(MassForm form) {
    for (const std::uint64_t seed : {3, 4, 5, 6, 7, 8}) parts.push_back(draw(seed, form));
    whole = beside_one_another(parts);
    batch = batch_of({whole}, form);
  }
  [[nodiscard]] JacobianGradients<double> changes() const {
    std::vector<JacobianEnvironment<double>> moved = parts;
    for (std::size_t p = 0; p < moved.size(); ++p) {
      moved[p].J = random_numbers(parts[p].J.size(), 31 + p);
      moved[p].M = random_numbers(parts[p].M.size(), 41 + p);
    }
    auto along = random_changes(batch.view(), 5);
    const JacobianEnvironment<double> all = beside_one_another(moved);
    along.J = all.J;
    along.M = all.M;
    return along;
  }
};

/// Robots beside one another, and one robot: more degrees of freedom than lanes take side by side.
TEST(ForwardDerivativeInLanes, TakesLargeEnvironmentsPartByPart) {
  for (const MassForm form : {MassForm::matrix, MassForm::factor}) {
    const Robots robots(form);
    JacobianEnvironment<double> large = random_jacobian({9, 9, 4, 81, 0, 0.02});
    if (form == MassForm::factor) large.M = cholesky(large.M, 81);
    ASSERT_GT(robots.whole.v_free.size(), 64U);
    expect_as_assembled({draw(2, form), robots.whole, large, draw(5, form)}, form, 1e-13);
    for (const bool is_one : {false, true}) {
      const auto batch = batch_of({is_one ? large : robots.whole}, form);
      const auto view = batch.view();
      const auto lambda = solved(batch);
      const auto along = is_one ? random_changes(view, 5) : robots.changes();
      EXPECT_EQ(answered_forward(view, lambda, along.tangents()), (std::vector<std::uint8_t>{1}));
      expect_transpose(view, lambda, along);
    }
  }
}

TEST(ForwardDerivativeInLanes, LeavesPartsWhoseFreeVelocityIsNoNumberToTheOthers) {
  for (const MassForm form : {MassForm::matrix, MassForm::factor}) {
    JacobianEnvironment<double> flying;
    flying.M = draw(4, form).M;
    flying.v_free = draw(4, form).v_free;
    const auto batch = batch_of({beside_one_another({flying, flying, flying})}, form);
    const auto view = batch.view();
    ASSERT_GT(view.dof_count, 64);
    JacobianGradients<double> along(view);
    for (auto* part : along.parts()) std::ranges::fill(*part, 0.0);
    EXPECT_EQ(answered_forward(view, {}, along.tangents()), (std::vector<std::uint8_t>{1}));
    along.v_free.back() = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(answered_forward(view, {}, along.tangents()), (std::vector<std::uint8_t>{0}));
    EXPECT_EQ(jvp(view, {}, along.tangents()).status[0].flags, std::uint32_t{kGradientNonFinite});
  }
}

/// A change that couples two robots is one of both. Only the lower triangle of a factor counts.
TEST(ForwardDerivativeInLanes, LeavesChangesThatCouplePartsToTheOthers) {
  for (const MassForm form : {MassForm::matrix, MassForm::factor}) {
    const Robots robots(form);
    const auto view = robots.batch.view();
    const auto lambda = solved(robots.batch);
    const std::size_t dofs = robots.whole.v_free.size(), last = dofs - 1;
    for (const auto& [member, entry] :
         {std::pair(&JacobianGradients<double>::J, last), std::pair(&JacobianGradients<double>::M, last * dofs),
          std::pair(&JacobianGradients<double>::M, last)}) {
      auto along = robots.changes();
      ASSERT_EQ((along.*member)[entry], 0.0);
      (along.*member)[entry] = 0.5;
      const bool counts = form == MassForm::matrix || member == &JacobianGradients<double>::J || entry != last;
      EXPECT_EQ(answered_forward(view, lambda, along.tangents())[0] != 0, !counts);
      expect_transpose(view, lambda, along);
    }
  }
}

/// Lanes take no row without compliance, no unsolved answer, no factor that is too large, and no change that is no
/// number.
TEST(ForwardDerivativeInLanes, LeavesTheRestToTheOthers) {
  std::vector<JacobianEnvironment<double>> envs = draw_all(12);
  envs[2].R[0] = 0.0;
  envs[6] = random_jacobian({5, 4, 3, 190, 0, 0.01});
  const auto batch = batch_of(envs);
  const auto view = batch.view();
  auto lambda = solved(batch);
  lambda[static_cast<std::size_t>(view.env_row_offsets[4])] += 1.0;
  const auto sound = random_changes(view, 7);
  const auto expected = jvp(view, lambda, sound.tangents());
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  for (int part = 0; part < 3; ++part) {
    auto along = sound;
    if (part == 0) along.v_free[static_cast<std::size_t>(view.env_dof_offsets[8])] = kNan;
    if (part == 1) along.M[static_cast<std::size_t>(view.env_mass_offsets[8])] = kNan;
    if (part == 2) along.R[static_cast<std::size_t>(view.env_row_offsets[8])] = kNan;
    EXPECT_EQ(answered_forward(view, lambda, along.tangents()),
              (std::vector<std::uint8_t>{1, 1, 0, 1, 0, 1, 0, 1, 0, 1, 1, 1}))
        << part;
    const auto own = jvp(view, lambda, along.tangents());
    for (Offset e = 0; e < view.env_count; ++e) {
      const auto at = static_cast<std::size_t>(e);
      EXPECT_EQ(own.status[at].flags, e == 4   ? std::uint32_t{kGradientUnconverged}
                                      : e == 8 ? std::uint32_t{kGradientNonFinite}
                                               : 0U)
          << part << ' ' << e;
      for (auto i = static_cast<std::size_t>(view.env_row_offsets[e]);
           i < static_cast<std::size_t>(view.env_row_offsets[e + 1]); ++i)
        EXPECT_EQ(own.lambda[i], e == 4 || e == 8 ? 0.0 : expected.lambda[i]) << part << ' ' << e;
    }
  }
  for (std::size_t e = 0; e < envs.size(); ++e) {
    const auto alone = batch_of({envs[e]});
    const auto at = static_cast<Offset>(e);
    const auto part = [&](const std::vector<double>& numbers, const Offset* begin) {
      return std::vector<double>(numbers.begin() + begin[at], numbers.begin() + begin[at + 1]);
    };
    JacobianGradients<double> along(alone.view());
    along.J.assign(sound.J.begin() + view.row_offsets[view.env_row_offsets[at]],
                   sound.J.begin() + view.row_offsets[view.env_row_offsets[at + 1]]);
    along.M = part(sound.M, view.env_mass_offsets);
    along.v_free = part(sound.v_free, view.env_dof_offsets);
    for (const auto member :
         {&JacobianGradients<double>::target, &JacobianGradients<double>::R, &JacobianGradients<double>::mu,
          &JacobianGradients<double>::lo, &JacobianGradients<double>::hi})
      along.*member = part(sound.*member, view.env_row_offsets);
    const auto own = jvp(alone.view(), part(lambda, view.env_row_offsets), along.tangents());
    const auto velocity = part(expected.velocity, view.env_dof_offsets);
    EXPECT_TRUE(same_bits(std::span<const double>(own.velocity), std::span<const double>(velocity))) << e;
  }
}

}  // namespace
