#include "core/algorithm/jacobian/delassus.hpp"
#include "core/base/pack.hpp"

#include "tests/support/machines/stress_team.hpp"
#include "tests/support/machines/torture_cases.hpp"
#include "tests/support/systems/jacobian_systems.hpp"
#include "tests/support/systems/roomy_jacobians.hpp"

namespace stiction::test {

namespace {

constexpr Index kLanes[] = {1, 2, 3, 8, 33};

/// The factor form of one environment, solved through the public interface and on teams of every width.
template <class Real>
void torture_factor(SolverKind solver, Law law) {
  JacobianBatch<double> jacobian(law);
  jacobian.add(random_jacobian({3, 5, 4, 11, 0}));
  const ContactBatch<Real> batch = convert<Real>(assemble(jacobian.view(), FactorUse::always));
  ASSERT_EQ(make_plan(batch.view()).path[0], EnvPath::factor);
  const std::vector<Real> warm(static_cast<std::size_t>(batch.row_count()), Real(0.125));
  const SolverOptions o = options(solver, 1e-3, 5);
  const Solution<Real> expected = solve(batch, o, Device::cpu(), std::span<const Real>(warm));
  for (const Index width : kLanes)
    EXPECT_TRUE(same_bits(expected, solve_on_teams(batch, o, width, warm))) << label(solver, law) << ", " << width;
}

}  // namespace

TEST(Torture, FactorsHaveTheSameBitsOnBlocksOfEveryWidth) {
  for (const SolverKind solver :
       {SolverKind::pgs, SolverKind::npgs, SolverKind::jacobi, SolverKind::apgd, SolverKind::newton})
    for (const Law law : kBothLaws) {
      torture_factor<float>(solver, law);
      torture_factor<double>(solver, law);
    }
}

/// Arrays that one environment is assembled to, and its motion by reactions of 0.25. Teams have all widths, their
/// lanes taking a tile of rows at once.
template <class Tile>
void expect_same_form(const JacobianBatchView<double>& view) {
  const auto matrix = assemble(view), factor = assemble(view, FactorUse::always);
  const std::vector<double> lambda(static_cast<std::size_t>(view.row_count), 0.25);
  const auto velocity = velocities(view, std::span<const double>(lambda));
  const Offset rows[] = {0, view.row_count};
  for (const Index width : kLanes)
    for (const bool as_factor : {false, true}) {
      const Offset entries[] = {0, view.row_count * (as_factor ? view.dof_count : view.row_count)}, none[] = {0, 0};
      std::vector<double> result(static_cast<std::size_t>(entries[1])), b(lambda.size()), moved(velocity.size());
      std::uint32_t flags = 0;
      JacobianJob<double> job{view, rows, as_factor ? none : entries, as_factor ? entries : none};
      job.A = job.Y = result.data();
      job.b = b.data();
      job.flags = &flags;
      job.lambda = lambda.data();
      job.velocity = moved.data();
      std::vector<double> scratch(static_cast<std::size_t>(jacobian_elements<Tile>(view, 0)), __builtin_nan(""));
      run_stressed<8>(width, [&](auto& team) {
        assemble_env<Tile>(team, job, 0, scratch.data());
        team.sync();
        velocity_env<Tile>(team, job, 0, scratch.data());
      });
      const auto& expected = as_factor ? factor.arrays().factor : matrix.arrays().A;
      EXPECT_TRUE(same_bits(std::span<const double>(expected), std::span<const double>(result))) << width;
      EXPECT_TRUE(same_bits(std::span<const double>(matrix.arrays().b), std::span<const double>(b))) << width;
      EXPECT_TRUE(same_bits(std::span<const double>(velocity), std::span<const double>(moved))) << width;
    }
}

TEST(Torture, AssemblingAndVelocitiesHaveTheSameBitsOnBlocksOfEveryWidth) {
  for (const bool sparse : {false, true})
    for (const Index mass_block : {0, 6}) {
      JacobianBatch<double> jacobian(Law::convex, MassForm::matrix, mass_block);
      JacobianEnvironment<double> env = random_jacobian({5, 4, 3, 12, mass_block});
      if (sparse) thin_out(env);
      jacobian.add(env);
      expect_same_form<RowTile<double>>(jacobian.view());
      expect_same_form<RowTile<Pack<double, 2>, 4>>(jacobian.view());
      expect_same_form<RowTile<Pack<double, 2>>>(jacobian.view());
    }
}

}  // namespace stiction::test
