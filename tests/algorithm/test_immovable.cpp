#include <gmock/gmock.h>

#include <cmath>
#include <string>

#include "scenes/rng.hpp"
#include "stiction/error.hpp"
#include "stiction/solver.hpp"
#include "tests/support/machines/every_solver.hpp"
#include "tests/support/machines/scoped_isa.hpp"

/// Rows of A + R that are zero (docs/math/immovable.md): they cannot move, and their neighbours are solved all the
/// same.
namespace stiction::test {
namespace {

/// Contact that is put beside sound ones.
struct Held {
  std::string name;
  Cone cone;
  std::vector<double> b;
  double lo, hi;  ///< of a box
  bool is_asked;  ///< its law asks it to move
  double answer;  ///< reaction of the first row
  Law law;        ///< of the environment
};

std::vector<Held> held_cones(bool with_friction) {
  const double none = std::numeric_limits<double>::infinity();
  std::vector<Held> all;
  const auto add = [&](const std::string& name, Cone cone, std::vector<double> b, bool is_asked, double lo = 0,
                       double hi = 0, double answer = 0) {
    for (const Law law : kBothLaws) all.push_back({name, cone, b, lo, hi, is_asked, answer, law});
  };
  for (const double b : {0.5, 0.0, -0.5}) {
    const std::string text = " " + std::to_string(b);
    add("unilateral" + text, unilateral(), {b}, b < 0);
    add("free" + text, free_row(), {b}, b != 0);
    add("box" + text, box(), {b}, false, -2, 3, b > 0 ? -2 : b < 0 ? 3 : 0);
    add("box away from zero" + text, box(), {b}, false, 1, 3, b < 0 ? 3 : 1);
    add("box without bounds" + text, box(), {b}, b != 0, -none, 1e20);
    add("box with one bound" + text, box(), {b}, b < 0, -2, none, b > 0 ? -2 : 0);
    for (Index rows = 2; with_friction && rows <= 6; ++rows) {
      std::vector<double> motion(static_cast<std::size_t>(rows), 0.0);
      motion[0] = b;
      add("friction of " + std::to_string(rows) + text, friction(rows), motion, b < 0);
      motion[1] = 2;
      if (b >= 0) all.push_back({"sliding" + text, friction(rows), motion, 0, 0, false, 0, Law::coulomb});
      if (b >= 0) all.push_back({"sliding" + text, friction(rows), motion, 0, 0, true, 0, Law::convex});
    }
    for (Index rows = 2; rows <= 6; ++rows) {
      std::vector<double> motion(static_cast<std::size_t>(rows), 1.0);
      motion[0] = b;
      add("boxed friction of " + std::to_string(rows) + text, {ConeKind::box_friction, rows, -1}, motion, b < 0);
    }
  }
  return all;
}

/// A unilateral row, a box and, with friction, a contact, all coupled; `held` in front or behind. `spare`: equalities
/// of a row each, coupled to nothing, which make the environment a sparse one.
Environment<double> with_held(const Held* held, bool in_front, bool with_friction, Index spare) {
  std::vector<Cone> cones{unilateral(), box()};
  std::vector<double> b{-1, -2};
  if (with_friction) {
    cones.push_back(friction(3));
    b.insert(b.end(), {-3, 1, 0.25});
  }
  std::vector<double> lo(b.size(), 0.0), hi(b.size(), 0.0), mu(b.size(), 0.5);
  lo[1] = -0.5;
  hi[1] = 0.75;
  for (Index k = 0; k < spare; ++k) {
    cones.push_back(free_row());
    b.push_back(0.25);
    lo.push_back(0);
    hi.push_back(0);
    mu.push_back(0);
  }
  const std::size_t sound = b.size();
  std::size_t first = 0;
  std::size_t rows = 0;
  if (held != nullptr) {
    rows = held->b.size();
    first = in_front ? 0 : sound;
    const auto at = [first](auto& values) { return values.begin() + static_cast<std::ptrdiff_t>(first); };
    cones.insert(in_front ? cones.begin() : cones.end(), held->cone);
    b.insert(at(b), held->b.begin(), held->b.end());
    lo.insert(at(lo), rows, held->lo);
    hi.insert(at(hi), rows, held->hi);
    mu.insert(at(mu), rows, 0.5);
  }
  const std::size_t n = b.size();
  std::vector<double> A(n * n, 0.0);
  const std::size_t shift = held != nullptr && in_front ? rows : 0;
  const std::size_t coupled = with_friction ? 5 : 2;
  for (std::size_t i = 0; i < sound; ++i)
    for (std::size_t j = 0; j < sound; ++j)
      A[(i + shift) * n + j + shift] = i == j ? 2.0 : i < coupled && j < coupled ? 0.25 : 0.0;
  Environment<double> env = system(cones, A, b);
  env.lo = lo;
  env.hi = hi;
  env.mu = mu;
  return env;
}

SolverOptions patient(SolverKind solver, bool is_double) {
  return options(solver, is_double ? 1e-8 : 1e-4, solver == SolverKind::jacobi ? 20000 : 2000);
}

template <class Real>
void expect_neighbours_are_solved(SolverKind solver, Index spare) {
  const bool with_friction = solver != SolverKind::lemke;
  for (const Held& held : held_cones(with_friction)) {
    const bool is_boxed = held.cone.kind == ConeKind::box_friction;
    const bool takes_box = solver != SolverKind::apgd && solver != SolverKind::admm && solver != SolverKind::newton &&
                           solver != SolverKind::ipm;
    if (is_boxed && !takes_box) continue;
    const auto alone = solve(convert<Real>(batch_of({with_held(nullptr, false, with_friction, spare)}, held.law)),
                             patient(solver, sizeof(Real) == sizeof(double)));
    ASSERT_EQ(alone.status[0].code, EnvCode::solved) << to_string(solver);
    for (const bool in_front : {true, false}) {
      SCOPED_TRACE(std::string(to_string(solver)) + ", " + held.name + (in_front ? " in front" : " behind") + ", law " +
                   to_string(held.law));
      const auto env = with_held(&held, in_front, with_friction, spare);
      // Lanes have the bits of an environment of its own.
      const auto batch = convert<Real>(batch_of(std::vector(3, env), held.law));
      std::vector<Real> guess(batch.arrays().b.size(), Real(0.125));
      const auto solution =
          solve(batch, patient(solver, sizeof(Real) == sizeof(double)), Device::cpu(), std::span<const Real>(guess));
      for (const EnvStatus& status : solution.status) {
        EXPECT_EQ((status.flags & kFlagImmovable) != 0, held.is_asked);
        EXPECT_EQ(status.flags & ~kFlagImmovable, 0U);
        EXPECT_EQ(status.code, held.is_asked ? EnvCode::infeasible : EnvCode::solved);
        EXPECT_EQ(status.iterations, solution.status[0].iterations);
      }
      const std::size_t rows = held.b.size();
      const std::size_t sound = alone.lambda.size();
      const std::size_t shift = in_front ? rows : 0;
      const Real close = sizeof(Real) == sizeof(double) ? Real(1e-6) : Real(2e-3);
      for (std::size_t i = 0; i < sound; ++i) EXPECT_NEAR(solution.lambda[shift + i], alone.lambda[i], close) << i;
      for (std::size_t k = 0; k < rows; ++k) {
        const Real reaction = solution.lambda[(in_front ? 0 : sound) + k];
        // An interior point leaves a trace of a reaction on all contacts that open.
        const Real trace = solver == SolverKind::ipm ? close : Real(0);
        EXPECT_NEAR(reaction, k == 0 ? static_cast<Real>(held.answer) : Real(0), trace);
        EXPECT_EQ(solution.w[(in_front ? 0 : sound) + k], static_cast<Real>(held.b[k]));
      }
    }
  }
}

class EachSolver : public testing::TestWithParam<SolverKind> {};
INSTANTIATE_TEST_SUITE_P(Immovable, EachSolver, testing::ValuesIn(kEveryChoice),
                         [](const auto& test) { return std::string(to_string(test.param)); });

TEST_P(EachSolver, SolvesTheNeighboursOfAContactThatCannotMove) {
  expect_neighbours_are_solved<double>(GetParam(), 0);
  expect_neighbours_are_solved<float>(GetParam(), 0);
}

TEST_P(EachSolver, DoesSoOnSparseSystems) {
  expect_neighbours_are_solved<double>(GetParam(), 70);
}

TEST_P(EachSolver, TakesBoundsFrom1e20OnForNone) {
  const double none = std::numeric_limits<double>::infinity();
  for (const double bound : {1e6, 1e15, 1e20, 1e30, 1e38, none}) {
    for (const int side : {0, 1, 2}) {
      Environment<double> env =
          system({box(), box(), unilateral()}, {2, 0.5, 0, 0.5, 3, -0.5, 0, -0.5, 1}, {1, -2, -1});
      env.lo = {side == 1 ? -50 : -bound, side == 1 ? -50 : -bound, 0};
      env.hi = {side == 2 ? 50 : bound, side == 2 ? 50 : bound, 0};
      const auto expect = [&](const auto& solution, double close) {
        EXPECT_EQ(solution.status[0].code, EnvCode::solved) << to_string(GetParam()) << " " << bound << " " << side;
        // No bound is reached: nothing moves.
        double w[3] = {1, -2, -1};
        const double A[3][3] = {{2, 0.5, 0}, {0.5, 3, -0.5}, {0, -0.5, 1}};
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j < 3; ++j)
            w[i] += A[i][j] * static_cast<double>(solution.lambda[static_cast<std::size_t>(j)]);
        for (const double motion : w) EXPECT_NEAR(motion, 0, close) << bound << " " << side;
      };
      expect(solve(batch_of({env}), patient(GetParam(), true)), 1e-6);
      expect(solve(convert<float>(batch_of({env})), patient(GetParam(), false)), 1e-2);
    }
  }
}

TEST(Immovable, ACoupledRowWithoutADiagonalIsRefusedStill) {
  SolverOptions o = options(SolverKind::npgs, 1e-6, 100);
  EXPECT_THROW(solve(batch_of({system({unilateral(), unilateral()}, {0, 1, 1, 2}, {-1, -1})}), o), Error);
  o.invalid = InvalidPolicy::isolate;
  for (const double entry : {0.0, -1.0}) {
    const auto status =
        solve(batch_of({system({unilateral(), unilateral()}, {entry, 1, 1, 2}, {-1, -1})}), o).status[0];
    EXPECT_EQ(status.code, EnvCode::invalid_input);
    EXPECT_EQ(status.flags, static_cast<std::uint32_t>(kFlagBadDiagonal));
  }
}

}  // namespace
}  // namespace stiction::test
