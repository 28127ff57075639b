#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <string>

#include "stiction/error.hpp"
#include "stiction/residual.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/machines/every_solver.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

template <class Real>
using Arrays = typename ContactBatch<Real>::Arrays;

/// One way to break the numbers of one environment, and the flag it must raise.
template <class Real>
struct Poison {
  std::string name;
  std::uint32_t flag;
  std::function<void(Arrays<Real>&, Offset env)> apply;
};

template <class Real>
Offset first_cone(const Arrays<Real>& a, Offset env, ConeKind kind) {
  for (Offset c = a.env_cone_offsets[static_cast<std::size_t>(env)];
       c < a.env_cone_offsets[static_cast<std::size_t>(env) + 1]; ++c)
    if (a.cone_kind[static_cast<std::size_t>(c)] == kind) return c;
  throw std::runtime_error("the environment lacks the kind of cone that this test poisons");
}

template <class Real>
std::size_t row_of(const Arrays<Real>& a, Offset env, ConeKind kind, Offset within) {
  return static_cast<std::size_t>(a.cone_row_offsets[static_cast<std::size_t>(first_cone<Real>(a, env, kind))] +
                                  within);
}

/// The stored diagonal entry of a row.
template <class Real>
std::size_t diagonal_of(const Arrays<Real>& a, Offset env, std::size_t row) {
  const Offset own = static_cast<Offset>(row) - a.env_row_offsets[static_cast<std::size_t>(env)];
  for (Offset k = a.row_offsets[row]; k < a.row_offsets[row + 1]; ++k)
    if (a.column[static_cast<std::size_t>(k)] == own) return static_cast<std::size_t>(k);
  throw std::runtime_error("the row stores no diagonal entry");
}

template <class Real>
std::vector<Poison<Real>> poisons() {
  std::vector<Poison<Real>> all;
  const Real infinity = std::numeric_limits<Real>::infinity();
  const Real bad[] = {std::numeric_limits<Real>::quiet_NaN(), infinity, -infinity};
  const char* names[] = {"NaN", "+infinity", "-infinity"};
  for (int k = 0; k < 3; ++k) {
    const Real value = bad[k];
    const std::string name = names[k];
    all.push_back({name + " in A", kFlagNonFiniteInput, [value](Arrays<Real>& a, Offset e) {
                     const std::size_t row = row_of<Real>(a, e, ConeKind::friction, 1);
                     a.A[static_cast<std::size_t>(a.row_offsets[row])] = value;
                   }});
    all.push_back({name + " on the diagonal", kFlagNonFiniteInput, [value](Arrays<Real>& a, Offset e) {
                     a.A[diagonal_of<Real>(a, e, row_of<Real>(a, e, ConeKind::friction, 0))] = value;
                   }});
    all.push_back({name + " in b", kFlagNonFiniteInput,
                   [value](Arrays<Real>& a, Offset e) { a.b[row_of<Real>(a, e, ConeKind::box, 0)] = value; }});
    all.push_back({name + " in R", kFlagNonFiniteInput,
                   [value](Arrays<Real>& a, Offset e) { a.R[row_of<Real>(a, e, ConeKind::unilateral, 0)] = value; }});
    all.push_back({name + " in mu", kFlagNonFiniteInput,
                   [value](Arrays<Real>& a, Offset e) { a.mu[row_of<Real>(a, e, ConeKind::friction, 2)] = value; }});
  }
  const Real nan = bad[0];
  all.push_back({"NaN as lower bound", kFlagNonFiniteInput,
                 [nan](Arrays<Real>& a, Offset e) { a.lo[row_of<Real>(a, e, ConeKind::box, 0)] = nan; }});
  all.push_back({"NaN as upper bound", kFlagNonFiniteInput,
                 [nan](Arrays<Real>& a, Offset e) { a.hi[row_of<Real>(a, e, ConeKind::box, 0)] = nan; }});
  all.push_back({"mu < 0", kFlagNegativeFriction,
                 [](Arrays<Real>& a, Offset e) { a.mu[row_of<Real>(a, e, ConeKind::friction, 1)] = Real(-0.25); }});
  all.push_back({"lo > hi", kFlagCrossedBounds, [](Arrays<Real>& a, Offset e) {
                   const std::size_t row = row_of<Real>(a, e, ConeKind::box, 0);
                   a.lo[row] = a.hi[row] + Real(1);
                 }});
  all.push_back({"R < 0", kFlagNegativeCompliance,
                 [](Arrays<Real>& a, Offset e) { a.R[row_of<Real>(a, e, ConeKind::box, 0)] = Real(-1e-9); }});
  for (const Real value : {Real(0), Real(-1)})
    all.push_back({value == Real(0) ? "zero diagonal" : "negative diagonal", kFlagBadDiagonal,
                   [value](Arrays<Real>& a, Offset e) {
                     const std::size_t row = row_of<Real>(a, e, ConeKind::friction, 0);
                     a.A[diagonal_of<Real>(a, e, row)] = value;
                     a.R[row] = 0;
                   }});
  return all;
}

template <class Real>
bool all_finite(const Solution<Real>& solution) {
  for (const auto* values : {&solution.lambda, &solution.w})
    for (const Real value : *values)
      if (!std::isfinite(value)) return false;
  return true;
}

template <class Real>
class Poisoned : public testing::Test {
 protected:
  static constexpr std::array<Offset, 3> kPoisoned = {0, 5, 22};
  // Robots have every kind of cone that can be poisoned, and lanes of a pack beside them.
  Poisoned() : batch(convert<Real>(scene_batch("walker", 23, 4))) {}
  ContactBatch<Real> batch;
};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(Poisoned, Precisions);

TYPED_TEST(Poisoned, OneEnvironmentIsFlaggedAndNoOtherChangesABit) {
  using Real = TypeParam;
  for (const SolverKind solver : kEverySolver) {
    SolverOptions o = options(solver, 1e-3, 24);
    o.invalid = InvalidPolicy::isolate;
    const auto sound = solve_hashes(this->batch, o);
    for (const Poison<Real>& poison : poisons<Real>()) {
      for (const Offset env : this->kPoisoned) {
        SCOPED_TRACE(std::string(to_string(solver)) + ", " + poison.name + " in environment " + std::to_string(env));
        Arrays<Real> arrays = this->batch.arrays();
        poison.apply(arrays, env);
        const auto broken = ContactBatch<Real>::from_arrays(this->batch.law(), arrays);
        const Solution<Real> solution = solve(broken, o);
        const auto hashes = env_hashes(broken, solution);
        for (Offset e = 0; e < broken.env_count(); ++e)
          ASSERT_TRUE(e == env || hashes[static_cast<std::size_t>(e)] == sound[static_cast<std::size_t>(e)]) << e;
        const EnvStatus& status = solution.status[static_cast<std::size_t>(env)];
        EXPECT_EQ(status.iterations, 0);
        if (solver == SolverKind::lemke && poison.flag == kFlagBadDiagonal) {
          // Pivoting takes any diagonal; it does not take friction cones.
          EXPECT_EQ(status.code, EnvCode::unsupported);
          continue;
        }
        EXPECT_EQ(status.code, EnvCode::invalid_input);
        EXPECT_NE(status.flags & poison.flag, 0U) << "flags " << status.flags;
        EXPECT_FALSE(std::isfinite(status.residual)) << "no residual was reached";
        EXPECT_TRUE(all_finite(solution));
        // The other policy refuses the batch before anything is written.
        SolverOptions strict = o;
        strict.invalid = InvalidPolicy::reject;
        EXPECT_THROW(solve(broken, strict), Error);
      }
    }
  }
}

TYPED_TEST(Poisoned, EveryEnvironmentPoisonedAtOnceIsFlaggedAndAnsweredWithZeros) {
  using Real = TypeParam;
  SolverOptions o = options(SolverKind::npgs, 1e-3, 24);
  o.invalid = InvalidPolicy::isolate;
  Arrays<Real> arrays = this->batch.arrays();
  const auto kinds = poisons<Real>();
  for (Offset e = 0; e < this->batch.env_count(); ++e)
    kinds[static_cast<std::size_t>(e) % kinds.size()].apply(arrays, e);
  const Solution<Real> solution = solve(ContactBatch<Real>::from_arrays(this->batch.law(), arrays), o);
  for (const EnvStatus& status : solution.status) EXPECT_EQ(status.code, EnvCode::invalid_input);
  for (const Real value : solution.lambda) EXPECT_EQ(value, Real(0));
  for (const Real value : solution.w) EXPECT_EQ(value, Real(0));
}

TYPED_TEST(Poisoned, AWarmStartThatIsNoneIsSetAsideForThatEnvironmentAlone) {
  using Real = TypeParam;
  for (const SolverKind solver : kAllSolvers) {
    SCOPED_TRACE(to_string(solver));
    const SolverOptions o = options(solver, 1e-3, 24);
    const auto rows = static_cast<std::size_t>(this->batch.row_count());
    std::vector<Real> warm(rows);
    for (std::size_t i = 0; i < rows; ++i) warm[i] = Real(0.01) * static_cast<Real>(i % 7);
    const auto sound = solve_hashes<Real>(this->batch, o, warm);
    const auto cold = solve(this->batch, o);
    Real none = std::numeric_limits<Real>::quiet_NaN();
    for (const Offset env : this->kPoisoned) {
      std::vector<Real> broken = warm;
      const auto first = static_cast<std::size_t>(this->batch.arrays().env_row_offsets[static_cast<std::size_t>(env)]);
      broken[first + 2] = none;
      none = std::numeric_limits<Real>::lowest();  // its square is not finite
      const Solution<Real> solution = solve<Real>(this->batch, o, Device::cpu(), broken);
      const auto hashes = env_hashes(this->batch, solution);
      for (Offset e = 0; e < this->batch.env_count(); ++e)
        ASSERT_TRUE(e == env || hashes[static_cast<std::size_t>(e)] == sound[static_cast<std::size_t>(e)]) << e;
      const EnvStatus& status = solution.status[static_cast<std::size_t>(env)];
      const EnvStatus& from_zero = cold.status[static_cast<std::size_t>(env)];
      EXPECT_EQ(status.flags, static_cast<std::uint32_t>(kFlagWarmStartRejected));
      EXPECT_EQ(status.residual, from_zero.residual) << "solved as if there had been no warm start";
      EXPECT_EQ(status.iterations, from_zero.iterations);
      EXPECT_TRUE(all_finite(solution));
    }
  }
}

/// Systems that pass validation and leave the range of numbers on the way.
std::vector<std::pair<std::string, Environment<double>>> extremes(double tiny, double huge) {
  std::vector<std::pair<std::string, Environment<double>>> all;
  all.emplace_back("an answer beyond the largest number", contact({tiny, tiny, tiny}, {-huge, huge, 0}, 0.5));
  all.emplace_back("friction so small that lambda / mu overflows", contact({1, 1, 1}, {-1, 3, 1}, tiny));
  all.emplace_back("friction so large that mu A mu overflows", contact({1, 1, 1}, {-1, 3, 1}, huge));
  all.emplace_back("an entry far larger than the diagonal",
                   system({unilateral(), unilateral()}, {1, huge, huge, 1}, {-1, -1}));
  all.emplace_back("an indefinite matrix", system({unilateral(), unilateral()}, {1, -9, -9, 1}, {-1, -1}));
  all.emplace_back("a tiny diagonal beside an ordinary one",
                   system({unilateral(), unilateral()}, {tiny, 0, 0, 1}, {-1, -1}));
  Environment<double> far = system({box(), unilateral()}, {1, 0, 0, 1}, {-1, -1});
  far.lo = {huge, 0};
  far.hi = {huge, 0};
  all.emplace_back("a box at the edge of the range", far);
  return all;
}

TYPED_TEST(Poisoned, ExtremeNumbersEndInAFiniteAnswerAndAnHonestStatus) {
  using Real = TypeParam;
  constexpr bool kSingle = std::is_same_v<Real, float>;
  for (const auto& [name, env] : extremes(kSingle ? 1e-30 : 1e-250, kSingle ? 1e30 : 1e250)) {
    const auto batch64 = batch_of({env, contact({1, 1, 1}, {-2, 3, 0}, 0.5)});
    for (const SolverKind solver : kAllSolvers)
      for (const Law law : kBothLaws)
        for (const Real start : {Real(0), Real(1), Real(kSingle ? 1e30 : 1e250)}) {
          SCOPED_TRACE(name + ", " + label(solver, law) + ", warm start " + std::to_string(start));
          auto system = convert<Real>(batch64);
          system.set_law(law);
          SolverOptions o = options(solver, 1e-3, 40);
          const std::vector<Real> warm(static_cast<std::size_t>(system.row_count()), start);
          const Solution<Real> solution = solve<Real>(system, o, Device::cpu(), warm);
          for (const Real value : solution.lambda) EXPECT_TRUE(std::isfinite(value));
          for (const Real value : solution.w) EXPECT_TRUE(std::isfinite(value));
          const auto judged = verify(system.view(), std::span<const Real>(solution.lambda));
          for (std::size_t e = 0; e < 2; ++e)
            EXPECT_TRUE(solution.status[e].code != EnvCode::solved || judged[e].relative <= 1e-3 * (1 + 1e-12)) << e;
        }
  }
}

std::vector<double> identity(std::size_t n) {
  std::vector<double> matrix(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) matrix[i * n + i] = 1.0;
  return matrix;
}

TYPED_TEST(Poisoned, WhatWasSolvedBeforeIsNotSeenWhereNumbersOverflow) {
  // A worker's scratch holds the environment before, and arithmetic that ends in NaN at once must not fall back on it.
  // All were found by fuzz_solve. The first step of admm was taken back to where no step had been. In a dictionary of
  // lemke a pair was basic twice, and its variable entered again, from a column that none has. Newton's proximal weight
  // underflowed to the mark of its other method, which had not begun. It shows where scratch holds other numbers every
  // time (STICTION_NOISY_SCRATCH, scripts/sanitize.sh address).
  using Real = TypeParam;
  constexpr bool kSingle = std::is_same_v<Real, float>;
  auto all = extremes(kSingle ? 1e-30 : 1e-250, kSingle ? 1e30 : 1e250);
  // As the fuzzer had it: an entry at the edge of the range whose mirror image is not.
  constexpr double p = 0.055, q = -0.051, r = -0.017, t = -0.056;
  const auto most = static_cast<double>(std::numeric_limits<Real>::max());
  Environment<double> edge = system({friction(2), friction(2), friction(4), free_row()},
                                    {
                                        1.48, p,    0, 0, p, p,    0, 0,    q,  //
                                        p,    1.65, p, p, p, 0,    0, q,    q,  //
                                        0,    p,    2, p, 0, 0,    p, q,    0,  //
                                        0,    p,    p, 2, p, p,    p, 0,    0,  //
                                        p,    p,    0, p, 2, p,    0, 0,    t,  //
                                        p,    0,    0, p, p, 2,    q, q,    r,  //
                                        0,    0,    p, p, 0, q,    2, q,    0,  //
                                        0,    q,    q, 0, 0, most, q, 1.04, r,  //
                                        q,    q,    0, 0, t, r,    0, r,    1.04,
                                    },
                                    {2.4375, 2.4375, 2.4375, 7.9375, 7.9375, 2.4375, 2.4375, 2.4375, 7.9375});
  edge.mu = {0.65, 0.65, 0.65, 1, 1, 0.65, 0.64, 0.65, 1};
  edge.R = {0.65, 0.07, 1, 1, 1, 0.65, 0, 1, 1};
  all.emplace_back("an entry at the edge of the range", edge);
  constexpr double u = 0.1240234375;
  const std::vector<double> matrix{-8, u, 0, 0, u, 2, u, 0, 0, most, -8, u, 0, 0, u, 2};  // 4 x 4
  Environment<double> pivots =
      system({free_row(), unilateral(), free_row(), free_row()}, matrix, {7.9375, -8, 7.9375, 7.9375});
  pivots.R = {1, 1, 1, 0.39};
  all.emplace_back("a pivot at the edge of the range", pivots);
  all.emplace_back("a diagonal at the edge of the range",
                   system({unilateral()}, {static_cast<double>(std::numeric_limits<Real>::denorm_min())}, {-3.625}));
  for (const auto& [name, env] : all)
    for (const SolverKind solver : kEveryChoice)
      for (const Law law : kBothLaws) {
        SCOPED_TRACE(name + ", " + label(solver, law));
        const auto solved = [&, extreme = env](double before, double tolerance) {
          // It has the same size, so that the same places are written.
          Environment<double> neighbour = system(extreme.cones, identity(extreme.b.size()), extreme.b);
          for (double& b : neighbour.b) b = -before * (1.0 + std::abs(b > 1e6 ? 1.0 : b));
          auto both = convert<Real>(batch_of({neighbour, extreme}));
          both.set_law(law);
          SolverOptions o = options(solver, tolerance, 12);
          o.threads = 1;
          o.omega = 1.9;
          o.stall_window = 5;
          o.invalid = InvalidPolicy::isolate;
          std::vector<Real> warm(static_cast<std::size_t>(both.row_count()), Real(2.5));
          for (std::size_t i = 5; i < warm.size(); i += 3) warm[i] = Real(8);
          const Solution<Real> solution = solve<Real>(both, o, Device::cpu(), warm);
          return env_hashes(both, solution).at(1);
        };
        for (const double tolerance : {0.5, 1e-8})
          EXPECT_EQ(solved(1.0, tolerance), solved(500.0, tolerance)) << tolerance;
      }
}

TYPED_TEST(Poisoned, ABoxWhoseBoundsAreTheSameInfinityHasNoAnswerAndSaysSo) {
  using Real = TypeParam;
  for (const double end : {-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()}) {
    Environment<double> env = system({box()}, {1}, {-1});
    env.lo = env.hi = {end};
    SolverOptions o = options(SolverKind::npgs, 1e-3, 24);
    o.invalid = InvalidPolicy::isolate;
    const Solution<Real> solution = solve(convert<Real>(batch_of({env})), o);
    EXPECT_TRUE(all_finite(solution)) << solution.lambda[0] << ", " << solution.w[0];
    EXPECT_NE(solution.status[0].code, EnvCode::solved);
  }
}

}  // namespace
