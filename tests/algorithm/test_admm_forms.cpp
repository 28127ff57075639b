#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "core/algorithm/solver/admm/admm.hpp"
#include "scenes/scenes.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/machines/matrixless.hpp"
#include "tests/support/machines/solve_alone.hpp"
#include "tests/support/machines/solve_on_lanes.hpp"
#include "tests/support/oracles/certificate.hpp"
#include "tests/support/systems/factor_systems.hpp"
#include "tests/support/systems/random_systems.hpp"

/// Alternating directions without the matrix of the rows: through the velocities, and by conjugate gradients.
namespace {

using namespace stiction;
using namespace stiction::test;

using Extended = long double;

/// K v = q by elimination with the largest pivots.
std::vector<Extended> eliminated(std::vector<Extended> K, std::vector<Extended> q) {
  const std::size_t n = q.size();
  for (std::size_t j = 0; j < n; ++j) {
    std::size_t best = j;
    for (std::size_t i = j; i < n; ++i)
      if (std::abs(K[i * n + j]) > std::abs(K[best * n + j])) best = i;
    for (std::size_t k = 0; k < n; ++k) std::swap(K[j * n + k], K[best * n + k]);
    std::swap(q[j], q[best]);
    for (std::size_t i = j + 1; i < n; ++i) {
      const Extended factor = K[i * n + j] / K[j * n + j];
      for (std::size_t k = j; k < n; ++k) K[i * n + k] -= factor * K[j * n + k];
      q[i] -= factor * q[j];
    }
  }
  for (std::size_t j = n; j-- > 0;) {
    for (std::size_t k = j + 1; k < n; ++k) q[j] -= K[j * n + k] * q[k];
    q[j] /= K[j * n + j];
  }
  return q;
}

/// Ten contacts and four rows that are kept at rest, on so many degrees of freedom.
JacobianEnvironment<double> some_contacts(Index dofs, double compliance = 0.01) {
  JacobianRecipe recipe;
  recipe.seed = 7;
  recipe.contacts = 10;
  recipe.others = 4;
  recipe.dofs = dofs;
  recipe.compliance = compliance;
  return random_jacobian(recipe);
}

/// A loaded system of one environment, on one lane.
template <class Real, template <class> class SystemOf>
struct Loaded {
  explicit Loaded(const ContactBatch<double>& batch, const Workspace& workspace = Admm::workspace())
      : batch_(convert<Real>(batch)),
        plan_(make_plan(batch_.view())),
        lambda_(static_cast<std::size_t>(batch_.row_count())),
        w_(lambda_),
        env_(slice(batch_.view(), view_of(plan_), batch_.law(), static_cast<const Real*>(nullptr), lambda_.data(),
                   w_.data(), &status_, Offset{0})),
        memory_(static_cast<std::size_t>(elements_of<SystemOf<Real>>(env_, workspace)),
                static_cast<Real>(__builtin_nan(""))),
        system(env_, workspace, memory_.data()) {
    EXPECT_TRUE(is_solvable(load_system(team, env_, system, load_rules<Admm>(batch_.law(), system))));
  }

 private:
  ContactBatch<Real> batch_;
  PlanData plan_;
  std::vector<Real> lambda_, w_;
  EnvStatus status_{};
  EnvView<Real> env_;
  std::vector<Real> memory_;

 public:
  SerialTeam team;
  SystemOf<Real> system;
};

TEST(AdmmForms, TheVelocitiesAreChosenByTwoIntegers) {
  // 34 rows.
  for (const Index dofs : {1, 7, 16, 17, 18, 40}) {
    Loaded<double, FactorSystem> loaded(as_factor(some_contacts(dofs), Law::convex));
    EXPECT_EQ(AdmmState::of(loaded.system).form, dofs < 17 ? AdmmForm::velocity : AdmmForm::matrix) << dofs;
  }
  // Without room for a matrix there is room for one of 19 degrees of freedom: 11 vectors of 34.
  const Workspace none = Admm::workspace().up_to(0);
  for (const Index dofs : {16, 17, 40}) {
    Loaded<double, FactorSystem> loaded(as_factor(some_contacts(dofs), Law::convex), none);
    EXPECT_EQ(AdmmState::of(loaded.system).form, dofs < 17 ? AdmmForm::velocity : AdmmForm::gradients) << dofs;
  }
  Loaded<double, SparseSystem> sparse(batch_of({scenes::make("stack", 5, 0, 16).system}), none);
  EXPECT_EQ(AdmmState::of(sparse.system).form, AdmmForm::gradients);
}

/// Solves with K + rho, in the form that the system has, against elimination of K + rho as it is defined.
template <class Real, template <class> class SystemOf>
void expect_solves(const ContactBatch<double>& batch, const Environment<double>& env, const Workspace& workspace,
                   double bound) {
  Loaded<Real, SystemOf> loaded(batch, workspace);
  auto& s = loaded.system;
  SerialTeam& team = loaded.team;
  const AdmmState a = AdmmState::of(s);
  const auto n = static_cast<std::size_t>(s.n);
  std::vector<Index> cone_of;
  for (std::size_t c = 0; c < env.cones.size(); ++c)
    for (Index k = 0; k < env.cones[c].row_count; ++k) cone_of.push_back(static_cast<Index>(c));
  for (std::size_t i = 0; i < n; ++i) a.scale[i] = 1.0 / (1.0 + 0.25 * static_cast<double>(cone_of[i] % 3));
  // The solver's coordinates: rows times mu, A times a power of two. Symmetric, so one column is one product.
  std::vector<Extended> K(n * n);
  const auto scale_a = static_cast<Extended>(s.scalar[kScaleA]);
  const auto mu = [&](std::size_t i) {
    const bool is_tangent = i > 0 && cone_of[i] == cone_of[i - 1];
    return is_tangent ? static_cast<Extended>(env.mu[i]) : Extended(1);
  };
  for (std::size_t i = 0; i < n; ++i) {
    for (auto k = static_cast<std::size_t>(env.row_offsets[i]); k < static_cast<std::size_t>(env.row_offsets[i + 1]);
         ++k) {
      const auto j = static_cast<std::size_t>(env.column[k]);
      K[i * n + j] += static_cast<Extended>(env.A[k]) * scale_a * mu(i) * mu(j) * a.scale[i] * a.scale[j];
    }
    if (!env.R.empty())
      K[i * n + i] += static_cast<Extended>(env.R[i]) * scale_a * mu(i) * mu(i) * a.scale[i] * a.scale[i];
  }
  for (const double rho : {1.0, 0.1, 0.003}) {
    SCOPED_TRACE(rho);
    std::vector<Extended> penalized = K;
    std::vector<Extended> q;
    for (std::size_t i = 0; i < n; ++i) {
      const bool is_free = env.cones[static_cast<std::size_t>(cone_of[i])].kind == ConeKind::free;
      penalized[i * n + i] += is_free ? static_cast<Extended>(1e-4 * rho) : static_cast<Extended>(rho);
      q.push_back(std::sin(static_cast<double>(3 * i + 1)));
      a.v[i] = static_cast<double>(q.back());
    }
    const std::vector<Extended> expected = eliminated(penalized, q);
    if (a.form == AdmmForm::gradients)
      for (std::size_t i = 0; i < n; ++i) a.answer[i] = 0.0;
    fill_scaled(team, s, a);
    factor_penalized(team, s, a, rho);
    // Conjugate gradients come nearer with every call.
    const int calls = a.form == AdmmForm::gradients ? 14 : 1;
    for (int call = 0; call < calls; ++call) {
      for (std::size_t i = 0; i < n; ++i) a.v[i] = static_cast<double>(q[i]);
      solve_penalized(team, s, a, rho);
    }
    Extended largest = 0, worst = 0;
    for (std::size_t i = 0; i < n; ++i) {
      largest = std::max(largest, std::abs(expected[i]));
      worst = std::max(worst, std::abs(expected[i] - static_cast<Extended>(a.v[i])));
    }
    EXPECT_LE(worst, bound * largest);
  }
}

TEST(AdmmForms, SolvesWithThePenalizedMatrixAreThoseOfElimination) {
  JacobianEnvironment<double> contacts = some_contacts(12);
  for (auto& cone : contacts.cones)
    if (cone.kind == ConeKind::unilateral) cone = free_row();
  const ContactBatch<double> factor = as_factor(contacts, Law::convex);
  const Environment<double> env = as_matrix(contacts);
  // rho of free rows is 3e-7 of the largest eigenvalue, which is of the order of ten. Elimination itself loses eight
  // digits there, and the assembled factor differs from the elimination's A in the last two.
  const double by_matrix = 1e-7;
  expect_solves<double, FactorSystem>(factor, env, Admm::workspace(), by_matrix);
  // The factor is rounded to single precision, and with it everything by 6e-8 of its size.
  expect_solves<float, FactorSystem>(as_factor(some_contacts(12), Law::convex), as_matrix(some_contacts(12)),
                                     Admm::workspace(), 1e-3);
  // Fourteen times a tenth, in the preconditioner's norm.
  const Environment<double> stack = scenes::make("stack", 5, 0, 4).system;
  expect_solves<double, SparseSystem>(batch_of({stack}), stack, Admm::workspace().up_to(0), 1e-9);
}

TEST(AdmmForms, FactorsHaveTheAnswersOfTheirMatrices) {
  for (const Index dofs : {3, 12, 16, 30})
    for (const Law law : kBothLaws) {
      SCOPED_TRACE(std::to_string(dofs) + " " + to_string(law));
      const JacobianEnvironment<double> contacts = some_contacts(dofs);
      const Environment<double> env = as_matrix(contacts);
      const SolverOptions o = options(SolverKind::admm, 1e-9, 4000);
      const Solution<double> factor = solve(as_factor(contacts, law), o);
      EXPECT_EQ(factor.status[0].code, EnvCode::solved) << factor.status[0].residual;
      EXPECT_LE(certify(env, law, factor.lambda).worst(), 1e-7L);
      if (law != Law::convex) continue;
      // R >= 0.01 makes the convex law's answer unique: off by the residual of both, 1e-9 of b, over R.
      const Solution<double> matrix = solve(batch_of({env}, law), o);
      double size = 0;
      for (const double x : matrix.lambda) size = std::max(size, std::abs(x));
      for (std::size_t i = 0; i < env.b.size(); ++i)
        EXPECT_NEAR(factor.lambda[i], matrix.lambda[i], 1e-6 * size) << "row " << i;
    }
}

TEST(AdmmForms, RigidContactsOnFewVelocitiesAreThoseOfTheSingularMatrix) {
  // At rest nothing moves inward, so that there is an answer, with a motion that is unique under the convex law.
  JacobianEnvironment<double> contacts = some_contacts(6, 0.0);
  contacts.target.assign(contacts.target.size(), 0.0);
  const Environment<double> env = as_matrix(contacts);
  const SolverOptions o = options(SolverKind::admm, 1e-9, 4000);
  const Solution<double> factor = solve(as_factor(contacts, Law::convex), o);
  const Solution<double> matrix = solve(batch_of({env}, Law::convex), o);
  EXPECT_EQ(factor.status[0].code, EnvCode::solved) << factor.status[0].residual;
  EXPECT_LE(certify(env, Law::convex, factor.lambda).worst(), 1e-7L);
  for (std::size_t i = 0; i < factor.w.size(); ++i) EXPECT_NEAR(factor.w[i], matrix.w[i], 1e-6) << i;
}

TEST(AdmmForms, SinglePrecision) {
  const Solution<float> narrow =
      solve(convert<float>(as_factor(some_contacts(12), Law::convex)), options(SolverKind::admm, 1e-4, 2000));
  EXPECT_EQ(narrow.status[0].code, EnvCode::solved) << narrow.status[0].residual;
}

TEST(AdmmForms, GradientsGoWhereTheFactorisationGoes) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Recipe recipe;
    recipe.seed = seed;
    recipe.contacts = static_cast<int>(1 + seed % 4);
    recipe.others = 3;
    const Environment<double> env = random_contacts(recipe);
    const auto by_matrix = solve(batch_of({env}), options(SolverKind::admm, 1e-9, 2000));
    const auto found = solved_alone(env, options(SolverKind::admm, 1e-9, 2000), Law::convex, kSparseWithoutMatrices);
    EXPECT_EQ(found.status[0].code, EnvCode::solved) << found.status[0].residual;
    EXPECT_LE(found.status[0].iterations, 2 * by_matrix.status[0].iterations + 40);
    EXPECT_LE(certify(env, Law::convex, found.lambda).worst(), 1e-7L);
  }
}

TEST(AdmmForms, MoreRowsThanAMatrixMayHaveAreSolvedUnderBothLaws) {
  Environment<double> env = scenes::make("stack", 5, 0, 90).system;
  ASSERT_GT(env.b.size(), static_cast<std::size_t>(kDirectRows));
  env.R.assign(env.b.size(), 1e-2);
  for (const Law law : kBothLaws) {
    const Solution<double> solution = solve(batch_of({env}, law), options(SolverKind::admm, 1e-4, 2000));
    EXPECT_EQ(solution.status[0].code, EnvCode::solved) << to_string(law) << " " << solution.status[0].residual;
    EXPECT_EQ(solution.status[0].flags, 0U);
    EXPECT_LE(certify(env, law, solution.lambda).worst(), 1e-2L);
  }
}

template <class Method, Law kLaw, class System>
void expect_same_on_teams(const ContactBatch<double>& wide, EnvPath path, const AloneRules& rules) {
  using Real = typename System::Real;
  const ContactBatch<Real> batch = convert<Real>(wide);
  ASSERT_EQ(make_plan(batch.view()).path[0], path);
  const SolverOptions o = options(SolverKind::admm, 1e-12, 14);  // the penalty may change once
  const Solution<Real> alone = solve_alone(batch, o, 0, rules);
  for (const Index width : {2, 3, 8, 33})
    EXPECT_TRUE(same_bits(alone, solve_on_lanes<Method, kLaw, System>(batch, o, width, width == 3 ? 42 : 0)))
        << "width " << width;
}

TEST(Torture, AdmmThroughVelocitiesAndByGradientsHasTheSameBitsOnBlocksOfEveryWidth) {
  // One law and precision each: every further one is ten seconds of compiling for the same phases.
  const ContactBatch<double> coulomb = as_factor(some_contacts(12), Law::coulomb);
  expect_same_on_teams<Admm, Law::coulomb, FactorSystem<double>>(coulomb, EnvPath::factor, {});
  const Environment<double> stack = scenes::make("stack", 5, 0, 13).system;
  expect_same_on_teams<Matrixless<Admm>, Law::convex, SparseSystem<float>>(batch_of({stack}), EnvPath::sparse,
                                                                           kWithoutMatrices);
}

}  // namespace
