// Changes of J, M and v_free pushed forward: against finite differences of solves, and against the pullback.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "tests/support/bits.hpp"
#include "tests/support/oracles/jacobian_derivatives.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

constexpr double kTightest = 1e-13;

JacobianChanges<double> jvp(const JacobianBatchView<double>& view, const std::vector<double>& lambda,
                            const JacobianBatchTangentView<double>& tangents, Offset count = 1, int threads = 1) {
  JacobianChanges<double> to(view, count);
  DerivativeOptions options;
  options.threads = threads;
  Derivative(Device::cpu(), options)
      .jvp(view, ReactionView<double>{lambda.data(), nullptr}, tangents, to.view(), to.status.data(), count);
  return to;
}

/// A random change of everything; bounds change too where there are any.
JacobianGradients<double> random_changes(const JacobianBatchView<double>& view, const Form& form, std::uint64_t seed) {
  JacobianGradients<double> to(view);
  for (auto* part : to.parts()) *part = random_numbers(part->size(), ++seed * 97);
  for (std::size_t i = 0; i < to.R.size(); ++i) {
    to.R[i] *= view.R[i];
    to.mu[i] *= view.mu[i];
  }
  restrict_mass(form, to.M);
  return to;
}

void move(std::vector<double>& numbers, const std::vector<double>& along, double step) {
  for (std::size_t i = 0; i < numbers.size(); ++i)
    if (std::isfinite(numbers[i])) numbers[i] += step * along[i];
}

JacobianEnvironment<double> moved(JacobianEnvironment<double> env, const JacobianGradients<double>& along,
                                  double step) {
  if (env.target.empty()) env.target.assign(env.mu.size(), 0.0);
  move(env.J, along.J, step);
  move(env.M, along.M, step);
  move(env.v_free, along.v_free, step);
  move(env.target, along.target, step);
  move(env.R, along.R, step);
  move(env.mu, along.mu, step);
  move(env.lo, along.lo, step);
  move(env.hi, along.hi, step);
  return env;
}

double largest(const std::vector<double>& numbers) {
  double size = 0.0;
  for (const double number : numbers) size = std::max(size, std::abs(number));
  return size;
}

/// One problem away from changes of mode, with its solution.
struct Case {
  Form form;
  Law law;
  JacobianEnvironment<double> env;
  JacobianBatch<double> batch;
  JacobianSolution<double> solution;
  bool is_smooth = false;

  Case(const Form& given, Law of, std::uint64_t seed) : Case(given, of, environment_of(given, seed)) {}
  Case(const Form& given, Law of, JacobianEnvironment<double> one)
      : form(given),
        law(of),
        env(std::move(one)),
        batch(batch_of(env, form, law)),
        solution(solved(env, form, law, kTightest)) {
    DerivativeOptions careful;
    careful.tie_tolerance = 1e-3;
    is_smooth = solution.contact.status[0].code == EnvCode::solved &&
                vjp(batch.view(), solution.contact.lambda, {}, {}, {}, careful).status[0].flags == 0;
  }
};

/// Errors of changes over the largest change, noise of differences taken off, of as many problems.
struct Errors {
  double lambda = 0.0, w = 0.0, velocity = 0.0, raw = 0.0;
  int used = 0;

  void take(const Case& problem, const JacobianGradients<double>& along) {
    ++used;
    const auto own = jvp(problem.batch.view(), problem.solution.contact.lambda, along.tangents());
    constexpr double kStep = 3e-6;
    const auto at = [&](double step) {
      return solved(moved(problem.env, along, step), problem.form, problem.law, kTightest);
    };
    const auto up = at(kStep), down = at(-kStep);
    const auto compare = [&](const std::vector<double>& plus, const std::vector<double>& minus,
                             const std::vector<double>& derivative, double& of) {
      // A solve to r leaves an error of about r, and the difference one of r over the step.
      const double noise = 30.0 * kTightest / kStep;
      const double size = std::max(largest(derivative), 1e-3);
      for (std::size_t i = 0; i < derivative.size(); ++i) {
        const double error = std::abs((plus[i] - minus[i]) / (2 * kStep) - derivative[i]) / size;
        raw = std::max(raw, error);
        of = std::max(of, error - noise);
      }
    };
    compare(up.contact.lambda, down.contact.lambda, own.lambda, lambda);
    compare(up.contact.w, down.contact.w, own.w, w);
    compare(up.velocity, down.velocity, own.velocity, velocity);
  }
  void expect_small() const {
    std::printf("%d problems; largest, with noise: %.2e\n", used, raw);
    for (const double error : {lambda, w, velocity}) EXPECT_LT(error, 1e-5);
  }
};

TEST(ForwardDerivativeOfJacobians, IsThatOfFiniteDifferences) {
  Errors errors;
  for (const Law law : kBothLaws)
    for (const Form& form : kForms)
      for (std::uint64_t seed = 1; seed <= 12; ++seed) {
        const Case problem(form, law, seed);
        if (problem.is_smooth) errors.take(problem, random_changes(problem.batch.view(), form, seed));
      }
  errors.expect_small();
  EXPECT_GE(errors.used, 60);
}

/// More degrees of freedom than lanes take side by side: one robot, and robots beside one another, which change
/// without being coupled.
TEST(ForwardDerivativeOfJacobians, IsThatOfFiniteDifferencesOfLargeEnvironments) {
  Errors errors;
  constexpr Form kWhole{72, MassForm::matrix, false};
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const Case one(kWhole, Law::convex, random_jacobian({seed, 4, 3, 72, 72, 0.02}));
    if (one.is_smooth) errors.take(one, random_changes(one.batch.view(), kWhole, seed));
    std::vector<JacobianEnvironment<double>> parts, changes;
    for (std::uint64_t part = 1; part <= 8; ++part) {
      parts.push_back(environment_of(kForms[0], 8 * seed + part));
      changes.push_back(parts.back());
      changes.back().J = random_numbers(parts.back().J.size(), part);
      changes.back().M = random_numbers(parts.back().M.size(), part + seed);
      restrict_mass(kForms[0], changes.back().M);
    }
    const Case robots(kWhole, Law::convex, beside_one_another(parts));
    auto along = random_changes(robots.batch.view(), kWhole, seed);
    along.J = beside_one_another(changes).J;
    along.M = beside_one_another(changes).M;
    if (robots.is_smooth) errors.take(robots, along);
  }
  errors.expect_small();
  EXPECT_GE(errors.used, 5);
}

/// <bar, d(solution)> pushed forward is <gradient, d(problem)> pulled back.
TEST(ForwardDerivativeOfJacobians, IsTheTransposeOfTheReverse) {
  double worst = 0.0;
  int used = 0;
  for (const Law law : kBothLaws)
    for (const Form& form : kForms)
      for (std::uint64_t seed = 1; seed <= 12; ++seed) {
        const Case problem(form, law, seed);
        const auto view = problem.batch.view();
        const auto& lambda = problem.solution.contact.lambda;
        JacobianGradients<double> along(view);
        std::uint64_t draw = seed * 31;
        // M's change is anything: its symmetric part counts, or its lower triangle.
        for (auto* part : along.parts()) *part = random_numbers(part->size(), ++draw);
        const auto forward = jvp(view, lambda, along.tangents());
        const auto lambda_bar = random_numbers(lambda.size(), ++draw), w_bar = random_numbers(lambda.size(), ++draw),
                   v_bar = random_numbers(forward.velocity.size(), ++draw);
        const auto back = vjp(view, lambda, lambda_bar, w_bar, v_bar);
        ASSERT_EQ(back.status[0].flags, forward.status[0].flags);
        if ((back.status[0].flags & kGradientRefused) != 0) continue;
        ++used;
        const auto changes = along.all(), gradients = back.all();
        const double pulled = dot(changes, gradients), size = dot_of_sizes(changes, gradients);
        const double pushed = dot(forward.lambda, lambda_bar) + dot(forward.w, w_bar) + dot(forward.velocity, v_bar);
        worst = std::max(worst, std::abs(pushed - pulled) / size);
      }
  std::printf("%d problems; largest difference %.2e of the terms\n", used, worst);
  EXPECT_LT(worst, 1e-12);
  EXPECT_GE(used, 100);
}

/// Lanes push environments under the convex law forward, others go one by one.
class ForwardDerivativeByLaw : public testing::TestWithParam<Law> {};
INSTANTIATE_TEST_SUITE_P(BothLaws, ForwardDerivativeByLaw, testing::ValuesIn(kBothLaws),
                         [](const auto& one) { return one.param == Law::convex ? "convex" : "coulomb"; });

TEST_P(ForwardDerivativeByLaw, SeveralSetsAreThoseOfCallsOfTheirOwn) {
  JacobianBatch<double> batch(GetParam());
  for (std::uint64_t seed = 1; seed <= 20; ++seed) batch.add(random_jacobian({seed, 3, 2, 9, 0, 0.02}));
  const auto view = batch.view();
  const auto lambda = solve(batch, options(SolverKind::newton, 1e-12, 100)).contact.lambda;
  JacobianGradients<double> both(view, 2);
  std::uint64_t draw = 0;
  for (auto* part : both.parts()) *part = random_numbers(part->size(), ++draw);
  const auto together = jvp(view, lambda, both.tangents(), 2, 2);
  JacobianChanges<double> apart(view, 2);
  for (std::size_t set = 0; set < 2; ++set) {
    JacobianGradients<double> own(view);
    const auto from = both.parts(), to = own.parts();
    for (std::size_t p = 0; p < to.size(); ++p)
      std::copy_n(from[p]->begin() + static_cast<std::ptrdiff_t>(set * to[p]->size()), to[p]->size(), to[p]->begin());
    const auto changes = jvp(view, lambda, own.tangents());
    const auto put = [&](const std::vector<double>& part, std::vector<double>& all) {
      std::copy(part.begin(), part.end(), all.begin() + static_cast<std::ptrdiff_t>(set * part.size()));
    };
    put(changes.lambda, apart.lambda);
    put(changes.w, apart.w);
    put(changes.velocity, apart.velocity);
  }
  EXPECT_EQ(together.all(), apart.all());
}

TEST(ForwardDerivativeOfJacobians, WithoutContactsVelocitiesFollowTheFreeOnes) {
  const JacobianEnvironment<double> env = random_jacobian({1, 0, 0, 4, 0, 0.0});
  const auto batch = batch_of(env, kForms[0], Law::convex);
  const std::vector<double> change{1, -2, 3, 4};
  JacobianBatchTangentView<double> tangents;
  tangents.v_free = change.data();
  const auto own = jvp(batch.view(), {}, tangents);
  EXPECT_EQ(own.status[0].flags, 0U);
  EXPECT_EQ(own.velocity, change);
  std::vector<double> broken = change;
  broken[1] = std::numeric_limits<double>::quiet_NaN();
  tangents.v_free = broken.data();
  const auto refused = jvp(batch.view(), {}, tangents);
  EXPECT_EQ(refused.status[0].flags, kGradientNonFinite);
  EXPECT_EQ(refused.velocity, std::vector<double>(4, 0.0));
}

TEST_P(ForwardDerivativeByLaw, ABrokenEnvironmentGetsZerosAndLeavesOthersAlone) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  JacobianBatch<double> sound(GetParam()), broken(GetParam());
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    JacobianEnvironment<double> env = random_jacobian({seed, 2, 2, 6, 0, 0.01});
    sound.add(env);
    if (seed == 2) env.M[0] = -1;
    broken.add(env);
  }
  const auto view = sound.view();
  auto lambda = solve(sound, options(SolverKind::newton, 1e-12, 100)).contact.lambda;
  JacobianGradients<double> along(view);
  std::uint64_t draw = 0;
  for (auto* part : along.parts()) *part = random_numbers(part->size(), ++draw);
  const auto expected = jvp(view, lambda, along.tangents());
  const auto check = [&](const JacobianChanges<double>& own, std::uint32_t flag) {
    EXPECT_NE(own.status[1].flags & flag, 0U);
    const auto part = [&](const std::vector<double>& one, const std::vector<double>& other, const Offset* begin) {
      for (Offset e = 0; e < 3; ++e)
        for (auto i = static_cast<std::size_t>(begin[e]); i < static_cast<std::size_t>(begin[e + 1]); ++i)
          EXPECT_EQ(one[i], e == 1 ? 0.0 : other[i]);
    };
    part(own.lambda, expected.lambda, view.env_row_offsets);
    part(own.w, expected.w, view.env_row_offsets);
    part(own.velocity, expected.velocity, view.env_dof_offsets);
  };
  check(jvp(broken.view(), lambda, along.tangents()), kGradientInvalidInput);
  for (std::vector<double>* const part : {&along.v_free, &along.J, &along.M}) {
    const std::size_t middle = part->size() / 2;
    const double was = (*part)[middle];
    (*part)[middle] = kNan;
    check(jvp(view, lambda, along.tangents()), kGradientNonFinite);
    (*part)[middle] = was;
  }
  lambda[static_cast<std::size_t>(view.env_row_offsets[1])] = kNan;
  check(jvp(view, lambda, along.tangents()), kGradientNonFinite);
}

}  // namespace
