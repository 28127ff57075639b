#include "core/algorithm/jacobian/delassus.hpp"
#include "core/algorithm/solver/apgd.hpp"
#include "core/algorithm/solver/jacobi.hpp"
#include "core/algorithm/solver/newton/newton.hpp"
#include "core/algorithm/solver/npgs.hpp"
#include "core/base/pack.hpp"

#include "tests/support/jacobian_systems.hpp"
#include "tests/support/roomy_jacobians.hpp"
#include "tests/support/torture_cases.hpp"

namespace stiction::test {

namespace {

constexpr Index kLanes[] = {1, 2, 3, 8, 33};

/// The factor form of one environment, solved through the public interface and by bodies on teams of every width.
template <class Method, Law kLaw, class Real>
void torture_factor() {
  JacobianBatch<double> jacobian(kLaw);
  jacobian.add(random_jacobian({3, 5, 4, 11, 0}));
  const ContactBatch<Real> batch = convert<Real>(assemble(jacobian.view(), FactorUse::always));
  const PlanData plan = make_plan(batch.view());
  ASSERT_EQ(plan.path[0], EnvPath::factor);
  const auto rows = static_cast<std::size_t>(batch.row_count());
  std::vector<Real> warm(rows, Real(0.125));
  SolverOptions o = options(Method::kKind, 1e-3, 5);
  const auto expected = solve(batch, o, Device::cpu(), std::span<const Real>(warm));

  for (const Index width : kLanes) {
    Solution<Real> solution{std::vector<Real>(rows), std::vector<Real>(rows), std::vector<EnvStatus>(1)};
    const EnvView<Real> env = slice(batch.view(), view_of(plan), kLaw, static_cast<const Real*>(warm.data()),
                                    solution.lambda.data(), solution.w.data(), solution.status.data(), Offset{0});
    std::vector<Real> memory(
        static_cast<std::size_t>(FactorSystem<Real>::elements(env.n, env.cone_count, env.dofs, Method::workspace())),
        static_cast<Real>(__builtin_nan("")));
    run_stressed(width, kTorture<1>, [&](auto& team) {
      FactorSystem<Real> system(env, Method::workspace(), memory.data());
      solve_environment<Method, kLaw>(team, env, system, MethodParams<Real>{Real(o.omega)},
                                      StopRule{o.tolerance, o.max_iterations, o.stall_window});
    });
    EXPECT_TRUE(same_bits(expected, solution)) << to_string(Method::kKind) << ", width " << width;
  }
}

template <class Method>
void torture_both_laws() {
  torture_factor<Method, Law::convex, float>();
  torture_factor<Method, Law::coulomb, double>();
}

}  // namespace

TEST(Torture, FactorsHaveTheSameBitsOnBlocksOfEveryWidth) {
  torture_both_laws<Pgs>();
  torture_both_laws<Npgs>();
  torture_both_laws<Jacobi>();
  torture_both_laws<Apgd>();
  torture_both_laws<Newton>();
}

/// What one environment is assembled to, and where reactions of 0.25 take it. Teams have all widths, their lanes
/// taking a tile of rows at once.
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
      run_stressed(width, kTorture<8>, [&](auto& team) {
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
