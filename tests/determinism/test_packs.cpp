#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "tests/support/machines/scoped_isa.hpp"
#include "tests/support/systems/random_systems.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/small_systems.hpp"

/// Contact environments in the lanes of packs against each of them in a separate call, which no pack takes.
namespace {

using namespace stiction;
using namespace stiction::test;

/// The environment with a cluster of its rows cut off from the others, so that rows are not stored in full.
Environment<double> cut(Environment<double> env) {
  const Index n = static_cast<Index>(env.b.size());
  std::vector<double> A(static_cast<std::size_t>(n) * static_cast<std::size_t>(n), 0.0);
  const auto side = [&](Index row) {
    Index first = 0;
    Index cone = 0;
    for (; first + env.cones[static_cast<std::size_t>(cone)].row_count <= row; ++cone)
      first += env.cones[static_cast<std::size_t>(cone)].row_count;
    return cone % 2;
  };
  for (Index i = 0; i < n; ++i)
    for (Offset k = env.row_offsets[static_cast<std::size_t>(i)]; k < env.row_offsets[static_cast<std::size_t>(i) + 1];
         ++k) {
      const Index j = env.column[static_cast<std::size_t>(k)];
      if (side(i) == side(j)) A[static_cast<std::size_t>(i * n + j)] = env.A[static_cast<std::size_t>(k)];
    }
  env.set_dense(A, n);
  return env;
}

/// The environment with couplings far beyond its diagonal: its iterates grow until they are no numbers.
Environment<double> blown_up(Environment<double> env) {
  const auto n = env.b.size();
  for (std::size_t i = 0; i < n; ++i)
    for (auto k = static_cast<std::size_t>(env.row_offsets[i]); k < static_cast<std::size_t>(env.row_offsets[i + 1]);
         ++k)
      if (env.column[k] != static_cast<Index>(i)) env.A[k] *= -1e6;
  return env;
}

/// The environment with the entries of its first and last row in two parts each, which add up.
Environment<double> in_parts(Environment<double> env) {
  Environment<double> parts = env;
  parts.row_offsets.assign(1, 0);
  parts.column.clear();
  parts.A.clear();
  const auto n = env.b.size();
  for (std::size_t i = 0; i < n; ++i) {
    const bool is_parted = i == 0 || i + 1 == n;
    for (int part = 0; part < (is_parted ? 2 : 1); ++part)
      for (auto k = static_cast<std::size_t>(env.row_offsets[i]); k < static_cast<std::size_t>(env.row_offsets[i + 1]);
           ++k) {
        parts.column.push_back(env.column[k]);
        parts.A.push_back(is_parted ? env.A[k] * (part == 0 ? 0.3 : 0.7) : env.A[k]);
      }
    parts.row_offsets.push_back(static_cast<Index>(parts.column.size()));
  }
  return parts;
}

/// The environment with every row's entries from the last column to the first.
Environment<double> backwards(Environment<double> env) {
  for (std::size_t i = 0; i < env.b.size(); ++i) {
    std::reverse(env.column.begin() + env.row_offsets[i], env.column.begin() + env.row_offsets[i + 1]);
    std::reverse(env.A.begin() + env.row_offsets[i], env.A.begin() + env.row_offsets[i + 1]);
  }
  return env;
}

/// The environment with an A so far from symmetric that methods that minimise refuse it.
Environment<double> lopsided(Environment<double> env) {
  for (std::size_t i = 0; i < env.b.size(); ++i)
    for (auto k = static_cast<std::size_t>(env.row_offsets[i]); k < static_cast<std::size_t>(env.row_offsets[i + 1]);
         ++k)
      if (env.column[k] > static_cast<Index>(i)) env.A[k] *= 0.5;
  return env;
}

constexpr int kShapes = 5;

/// Few shapes again and again, so that lanes are taken by one like the last and by one unlike it. Their neighbours end
/// at once, end as no numbers, or are refused.
std::vector<Environment<double>> crowd() {
  std::vector<Environment<double>> envs;
  constexpr ConeOrder kOrders[] = {ConeOrder::shuffled, ConeOrder::friction_last, ConeOrder::friction_first};
  for (std::uint64_t e = 0; e < 200; ++e) {
    Recipe recipe;
    recipe.seed = e % 3 == 0 ? e % kShapes : e;  // of one seed, the same environment
    recipe.contacts = 1 + static_cast<int>(e % kShapes);
    recipe.others = 1 + static_cast<int>(e / 2 % 2);
    recipe.friction_rows = 3;
    recipe.order = kOrders[e / 4 % 3];
    Environment<double> env = random_contacts(recipe);
    if (e % 7 == 2) env = cut(env);
    if (e % 11 == 5) env = blown_up(env);
    if (e % 21 == 8) env = in_parts(env);
    if (e % 21 == 15) env = backwards(env);
    if (e % 31 == 16) env = lopsided(env);
    if (e % 13 == 4) env.b.assign(env.b.size(), 0.0);
    if (e % 17 == 3) env.A[env.A.size() / 2] = std::numeric_limits<double>::quiet_NaN();
    if (e % 37 == 20) env.A.front() = std::numeric_limits<double>::quiet_NaN();
    if (e % 19 == 6) env.b.back() = std::numeric_limits<double>::infinity();
    if (e % 23 == 9) env.R.front() = -1;
    for (std::size_t row = 0; e % 29 == 11 && row < env.mu.size(); ++row) env.mu[row] = -env.mu[row];
    envs.push_back(env);
  }
  return envs;
}

template <class Real>
std::vector<Real> guesses(const ContactBatch<Real>& batch) {
  std::vector<Real> warm;
  for (Offset row = 0; row < batch.row_count(); ++row)
    warm.push_back(row % 101 == 7 ? std::numeric_limits<Real>::quiet_NaN() : static_cast<Real>(row % 5) * Real(0.25));
  return warm;
}

template <class Real>
void expect_packs_change_nothing(const SolverOptions& o, bool is_warm) {
  const ContactBatch<Real> batch = convert<Real>(batch_of(crowd(), *o.law));
  const std::vector<Real> warm = is_warm ? guesses(batch) : std::vector<Real>();
  const Solution<Real> together = solve(batch, o, Device::cpu(), std::span<const Real>(warm));
  const auto hashes = env_hashes(batch, together);
  // Without a plan it is known which rows are stored in full before a lane is loaded.
  Solution<Real> unplanned{std::vector<Real>(together.lambda.size()), std::vector<Real>(together.w.size()),
                           std::vector<EnvStatus>(together.status.size())};
  Solver(Device::cpu(), o)
      .solve(batch.view(), SolutionView<Real>{unplanned.lambda.data(), unplanned.w.data(), unplanned.status.data()},
             is_warm ? warm.data() : nullptr);
  EXPECT_EQ(env_hashes(batch, unplanned), hashes);
  const auto& rows = batch.arrays().env_row_offsets;
  for (Offset e = 0; e < batch.env_count(); ++e) {
    const auto i = static_cast<std::size_t>(e);
    const Offset only[] = {e};
    const auto own = warm.empty()
                         ? std::span<const Real>()
                         : std::span<const Real>(warm).subspan(static_cast<std::size_t>(rows[i]),
                                                               static_cast<std::size_t>(rows[i + 1] - rows[i]));
    EXPECT_EQ(solve_hashes(gather<Real>(batch, only), o, own).at(0), hashes[i]) << "environment " << e;
  }
  const auto ended = [&](EnvCode code) {
    return std::count_if(together.status.begin(), together.status.end(),
                         [&](const auto& one) { return one.code == code; });
  };
  EXPECT_GT(ended(EnvCode::solved), 40);
  EXPECT_GT(ended(EnvCode::invalid_input), 10);
}

template <class Real>
class Packs : public testing::Test {};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(Packs, Precisions);

TYPED_TEST(Packs, GiveEachOfACrowdTheBitsItHasAlone) {
  for (const char* name : usable_isas())
    for (const SolverKind solver : kAllSolvers)
      for (const Law law : kBothLaws)
        for (const bool is_warm : {false, true}) {
          SCOPED_TRACE(std::string(name) + ", " + label(solver, law) + (is_warm ? ", warm" : ""));
          const ScopedIsa isa(name);
          SolverOptions o = options(solver, 1e-4, 60);
          o.law = law;
          o.invalid = InvalidPolicy::isolate;
          expect_packs_change_nothing<TypeParam>(o, is_warm);
        }
}

/// Stages of the fallback chain that minimise take an asymmetric A, in lanes as alone.
TYPED_TEST(Packs, GiveEachOfACrowdTheBitsItHasAloneOnTheLadder) {
  for (const char* name : usable_isas())
    for (const Law law : kBothLaws) {
      SCOPED_TRACE(std::string(name) + ", " + label(SolverKind::automatic, law));
      const ScopedIsa isa(name);
      SolverOptions o = options(SolverKind::automatic, 1e-4, 60);
      o.law = law;
      o.invalid = InvalidPolicy::isolate;
      expect_packs_change_nothing<TypeParam>(o, false);
    }
}

/// 2^-kLeast is the smallest number above zero.
template <class Real>
constexpr int kLeast = std::numeric_limits<Real>::digits - std::numeric_limits<Real>::min_exponent;
/// A guess so small that its change times the diagonal of the first cone of faint() is zero.
template <class Real>
Real faint_guess() {
  return std::ldexp(Real(1), -kLeast<Real> / 2 - 26);
}

/// Makes that cone coupled to a row whose motion is as small, and one beside them that gives the environment its scale.
template <class Real>
Environment<double> faint() {
  const double diagonal = std::ldexp(1.0, 8 - kLeast<Real> / 2);
  const double coupling = std::ldexp(1.0, 3 - kLeast<Real> / 4);
  const auto guess = static_cast<double>(faint_guess<Real>());
  EXPECT_EQ(static_cast<Real>(diagonal) * static_cast<Real>(guess), Real(0));
  EXPECT_NE(static_cast<Real>(coupling) * static_cast<Real>(guess), Real(0));
  return system({unilateral(), unilateral(), unilateral()}, {diagonal, coupling, 0, coupling, 1, 0, 0, 0, 1},
                {1, -16 * coupling * guess, -1});
}

TYPED_TEST(Packs, PushTheFaintestChangeWhateverNeighboursDo) {
  using Real = TypeParam;
  constexpr Offset kCopies = 24;
  const ContactBatch<Real> batch =
      convert<Real>(batch_of(std::vector<Environment<double>>(kCopies, faint<Real>()), Law::convex));
  const std::vector<Real> own = {faint_guess<Real>(), Real(0), Real(0)};
  std::vector<Real> warm;
  for (Offset e = 0; e < kCopies; ++e)
    for (const Real guess : own) warm.push_back(e % 5 == 2 ? guess : guess == Real(0) ? Real(0) : Real(0.5));
  for (const SolverKind solver : {SolverKind::pgs, SolverKind::npgs, SolverKind::nsgs}) {
    SCOPED_TRACE(label(solver, Law::convex));
    SolverOptions o = options(solver, 0, 8);
    o.law = Law::convex;
    const auto hashes = env_hashes(batch, solve(batch, o, Device::cpu(), std::span<const Real>(warm)));
    const Offset only[] = {2};
    const ContactBatch<Real> one = gather<Real>(batch, only);
    const Solution<Real> alone = solve(one, o, Device::cpu(), std::span<const Real>(own));
    const Real wanted = -one.arrays().b.at(1);  // the guess's push, a sixteenth of it, is gone
    EXPECT_LT(std::abs(alone.lambda.at(1) - wanted), wanted / 64);
    for (std::size_t e = 2; e < hashes.size(); e += 5) EXPECT_EQ(hashes[e], env_hashes(one, alone).at(0));
  }
}

}  // namespace
