#include <gmock/gmock.h>

#include <limits>
#include <vector>

#include "stiction/stepping.hpp"
#include "tests/support/error_message.hpp"
#include "tests/support/systems/body_systems.hpp"
#include "tests/support/systems/jacobian_systems.hpp"
#include "tests/support/systems/random_systems.hpp"

// Views of hostile callers: arrays that are not there are refused by name, whatever the InvalidPolicy of the numbers
// in them.
namespace stiction::test {
namespace {

using ::testing::StartsWith;

TEST(NullArrays, OfAContactBatchAreRefusedUnderEveryPolicy) {
  ContactBatch<double> batch(Law::coulomb);
  batch.add(random_contacts(Recipe{}));
  const auto rows = static_cast<std::size_t>(batch.row_count());
  std::vector<double> lambda(rows);
  std::vector<EnvStatus> status(1);
  for (const auto policy : {InvalidPolicy::reject, InvalidPolicy::isolate}) {
    SolverOptions options;
    options.invalid = policy;
    const Solver solver(Device::cpu(), options);
    const Plan plan = solver.plan(batch.view());
    using View = ContactBatchView<double>;
    for (const auto& [name, array] : {std::pair("A", &View::A),
                                      {"b", &View::b},
                                      {"R", &View::R},
                                      {"mu", &View::mu},
                                      {"lo", &View::lo},
                                      {"hi", &View::hi}}) {
      View view = batch.view();
      view.*array = nullptr;
      const SolutionView<double> solution{lambda.data(), nullptr, status.data()};
      EXPECT_THAT(error_message([&] { solver.solve(view, solution); }), StartsWith(std::string(name) + " is null"));
      EXPECT_THAT(error_message([&] { solver.solve(plan, view, solution); }),
                  StartsWith(std::string(name) + " is null"));
    }
  }
}

TEST(NullArrays, OfABodyBatchAreRefusedUnderEveryPolicy) {
  BodyBatch<double> batch;
  batch.add(ball_on_floor(0.1, 2.0, 0.5));
  std::vector<double> impulse(3), twist(6);
  std::vector<EnvStatus> status(1);
  for (const auto policy : {InvalidPolicy::reject, InvalidPolicy::isolate}) {
    BodySolverOptions options;
    options.invalid = policy;
    options.max_contacts_per_env = 1;
    const BodySolver solver(Device::cpu(), TimeStepping{}, options);
    const BodyPlan plan = solver.plan(batch.view());
    using View = BodyBatchView<double>;
    const auto expect_named = [&](const char* name, auto array) {
      View view = batch.view();
      view.*array = nullptr;
      const BodySolutionView<double> solution{impulse.data(), twist.data(), nullptr, status.data()};
      EXPECT_THAT(error_message([&] { solver.solve(view, solution); }), StartsWith(std::string(name) + " is null"));
      EXPECT_THAT(error_message([&] { solver.solve(plan, view, solution); }),
                  StartsWith(std::string(name) + " is null"));
    };
    expect_named("body_a", &View::body_a);
    expect_named("body_b", &View::body_b);
    for (const auto& [name, array] : {std::pair("inv_mass", &View::inv_mass),
                                      {"inv_inertia", &View::inv_inertia},
                                      {"twist", &View::twist},
                                      {"arm_a", &View::arm_a},
                                      {"arm_b", &View::arm_b},
                                      {"normal", &View::normal},
                                      {"mu", &View::mu},
                                      {"depth", &View::depth},
                                      {"restitution", &View::restitution}}) {
      expect_named(name, array);
    }
    View view = batch.view();
    view.depth = nullptr;
    EXPECT_THAT(error_message([&] { (void)solver.plan(view); }), StartsWith("depth is null"));
  }
}

TEST(NullArrays, OfStructureInDeviceMemoryAreRefused) {
  ContactBatch<double> batch(Law::coulomb);
  batch.add(random_contacts(Recipe{}));
  std::vector<double> lambda(static_cast<std::size_t>(batch.row_count()));
  EnvStatus status{};
  const Solver solver(Device::emulated(), SolverOptions{});
  ContactBatchView<double> view = batch.view();
  view.space = MemorySpace::cuda;
  view.cone_row_offsets = nullptr;
  EXPECT_THAT(error_message([&] { solver.solve(view, {lambda.data(), nullptr, &status}); }),
              StartsWith("cone_row_offsets is null"));
}

TEST(NullArrays, ColumnsOfASparseJWithoutEntriesAreNotNull) {
  JacobianEnvironment<double> env;
  env.cones = {{ConeKind::unilateral, 1, -1}};
  env.row_offsets = {0, 0};
  env.M = {1};
  env.v_free = {-1};
  JacobianBatch<double> batch;
  batch.add(env);
  EXPECT_NE(batch.view().column, nullptr) << "null says that J is dense";
  EXPECT_EQ(velocities<double>(batch.view(), std::vector<double>{0}), std::vector<double>{-1});
}

TEST(CopiesToTheHost, HaveFactorsAndASharedMu) {
  JacobianBatch<double> jacobians;
  jacobians.add(random_jacobian({.contacts = 2, .others = 0}));
  const ContactBatch<double> batch = assemble(jacobians.view(), FactorUse::always);
  ASSERT_FALSE(batch.arrays().factor.empty());
  const std::vector<double> mu{0.5, 0.25};
  const std::vector<Offset> places{0, 0, 0, 1, 1, 1};
  ContactBatchView<double> view = batch.view();
  view.mu = mu.data();
  view.mu_offsets = places.data();
  view.mu_count = 2;
  view.space = MemorySpace::cuda;
  const ContactBatch<double> copy = Solver(Device::emulated(), SolverOptions{}).to_host(view);
  EXPECT_EQ(copy.arrays().factor, batch.arrays().factor);
  EXPECT_EQ(copy.arrays().factor_offsets, batch.arrays().factor_offsets);
  EXPECT_EQ(copy.arrays().mu, (std::vector<double>{0, 0.5, 0.5, 0, 0.25, 0.25})) << "normal rows have none";
}

// Capacities of a C program: three times as many numbers must not wrap around.
TEST(HostileCapacities, OfSteppedBodiesAreRefused) {
  for (const Offset contacts : {Offset{-1}, std::numeric_limits<Offset>::min(), std::numeric_limits<Offset>::max()}) {
    EXPECT_THAT(error_message([&] {
                  BodySteppingSolver<double>(Device::cpu(), TimeStepping{}, BodySolverOptions{}, 1, contacts);
                }),
                StartsWith("contacts = " + std::to_string(contacts)));
  }
}

}  // namespace
}  // namespace stiction::test
