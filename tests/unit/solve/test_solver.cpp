#include "stiction/solver.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "stiction/error.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

struct Complaint {
  ErrorCode code;
  std::string text;
};

Complaint complaint(const std::function<void()>& act) {
  try {
    act();
  } catch (const Error& error) {
    return {error.code(), error.what()};
  }
  return {ErrorCode::io, "no error"};
}

class SolverUse : public testing::Test {
 protected:
  ContactBatch<double> batch = batch_of({contact({1, 1, 1}, {-2, 3, 0}, 0.5), system({unilateral()}, {2}, {-3})});
  Solver solver{Device::cpu(), options(SolverKind::npgs, 1e-9, 500)};
  std::vector<double> lambda = std::vector<double>(4, 77), w = std::vector<double>(4, 77);
  std::vector<EnvStatus> status = std::vector<EnvStatus>(2);
  SolutionView<double> out{lambda.data(), w.data(), status.data()};
};

TEST_F(SolverUse, PlansOnceAndSolvesAsOftenAsTheNumbersChange) {
  const Plan plan = solver.plan(batch.view());
  solver.solve(plan, batch.view(), out);
  EXPECT_NEAR(lambda[3], 1.5, 1e-9);
  auto arrays = batch.arrays();
  arrays.b[3] = -5;
  const auto changed = ContactBatch<double>::from_arrays(batch.law(), arrays);
  solver.solve(plan, changed.view(), out);
  EXPECT_NEAR(lambda[3], 2.5, 1e-9);
  EXPECT_EQ(status[1].code, EnvCode::solved);
}

TEST_F(SolverUse, MotionIsOptional) {
  out.w = nullptr;
  solver.solve(solver.plan(batch.view()), batch.view(), out);
  EXPECT_NEAR(lambda[3], 1.5, 1e-9);
  EXPECT_EQ(w[0], 77) << "it was not written";
}

TEST_F(SolverUse, TheLawOfTheOptionsOverridesTheBatchs) {
  auto o = options(SolverKind::npgs, 1e-12, 2000);
  o.law = Law::coulomb;
  EXPECT_NEAR(solve(batch, o).lambda[0], 2.0, 1e-9);
  o.law.reset();
  EXPECT_NEAR(solve(batch, o).lambda[0], 2.8, 1e-9);
}

TEST_F(SolverUse, APlanOfAnotherStructureIsRefused) {
  const auto other = batch_of({system({unilateral()}, {2}, {-3})});
  const auto said = complaint([&] { solver.solve(solver.plan(other.view()), batch.view(), out); });
  EXPECT_EQ(said.code, ErrorCode::invalid_argument);
  EXPECT_EQ(
      said.text,
      "plan was made for 1 environments, 1 rows and 1 entries, the batch has 2, 4 and 4: make a new plan when the "
      "structure changes");
  EXPECT_EQ(lambda[0], 77) << "nothing was written";
}

TEST_F(SolverUse, NullPointersAreNamed) {
  const Plan plan = solver.plan(batch.view());
  SolutionView<double> without = out;
  without.lambda = nullptr;
  auto said = complaint([&] { solver.solve(plan, batch.view(), without); });
  EXPECT_EQ(said.code, ErrorCode::invalid_argument);
  EXPECT_EQ(said.text, "solution.lambda is null: give it room for one number per row (4)");
  without = out;
  without.status = nullptr;
  said = complaint([&] { solver.solve(plan, batch.view(), without); });
  EXPECT_EQ(said.text, "solution.status is null: give it room for one EnvStatus per environment (2)");
}

TEST_F(SolverUse, AWarmStartOfTheWrongLengthIsRefused) {
  const std::vector<double> three(3);
  const auto said = complaint([&] { solve<double>(batch, {}, Device::cpu(), three); });
  EXPECT_EQ(said.code, ErrorCode::invalid_argument);
  EXPECT_EQ(said.text, "warm_start has 3 numbers, the batch has 4 rows: give one number per row, or none");
}

TEST_F(SolverUse, ABrokenStructureCannotBePlannedWhateverThePolicy) {
  auto arrays = batch.arrays();
  arrays.column[0] = 12;
  const auto broken = ContactBatch<double>::from_arrays(batch.law(), arrays);
  for (const InvalidPolicy policy : {InvalidPolicy::reject, InvalidPolicy::isolate}) {
    SolverOptions o;
    o.invalid = policy;
    const auto said = complaint([&] { (void)Solver(Device::cpu(), o).plan(broken.view()); });
    EXPECT_EQ(said.code, ErrorCode::invalid_argument);
    EXPECT_NE(said.text.find("column[env 0, row 0] = 12"), std::string::npos) << said.text;
  }
}

TEST_F(SolverUse, ABrokenNumberIsRejectedByNameBeforeAnythingIsWritten) {
  auto arrays = batch.arrays();
  arrays.mu[1] = -0.5;
  const auto broken = ContactBatch<double>::from_arrays(batch.law(), arrays);
  const auto said = complaint([&] { solver.solve(solver.plan(broken.view()), broken.view(), out); });
  EXPECT_EQ(said.code, ErrorCode::invalid_argument);
  EXPECT_NE(said.text.find("mu[env 0, cone 0, row 1] = -0.5"), std::string::npos) << said.text;
  EXPECT_EQ(lambda[0], 77);
  EXPECT_EQ(lambda[3], 77);
}

TEST_F(SolverUse, ABatchInDeviceMemoryIsNoBatchForTheCpu) {
  auto view = batch.view();
  view.space = MemorySpace::cuda;
  const Plan plan = solver.plan(batch.view());
  for (const auto& said :
       {complaint([&] { solver.solve(plan, view, out); }), complaint([&] { (void)solver.plan(view); })}) {
    EXPECT_EQ(said.code, ErrorCode::invalid_argument);
    EXPECT_NE(said.text.find("copy the batch to the host or solve on the GPU"), std::string::npos) << said.text;
  }
}

TEST(SolverMisuse, AnOptionOutOfRangeIsRefusedAtConstruction) {
  SolverOptions o;
  o.omega = 2;
  EXPECT_THROW(Solver(Device::cpu(), o), Error);
  EXPECT_THROW(solve(ContactBatch<float>(), o), Error);
}

TEST(SolverMisuse, ADeviceThatIsNotThereIsRefusedWithTheReason) {
  const auto said = complaint([] { Solver(Device::cuda(99), {}); });
  EXPECT_TRUE(said.code == ErrorCode::no_device || said.code == ErrorCode::unsupported) << said.text;
  EXPECT_FALSE(said.text.empty());
}

TEST(SolverMisuse, DevicesListsTheCpuFirstAndSaysWhyOthersAreMissing) {
  const auto all = devices();
  ASSERT_FALSE(all.empty());
  EXPECT_EQ(all[0].device.kind, DeviceKind::cpu);
  EXPECT_TRUE(all[0].usable);
  for (const auto& report : all) EXPECT_EQ(report.usable, report.reason.empty()) << report.name;
}

TEST(SolverMove, AMovedSolverStillSolves) {
  Solver first(Device::cpu(), options(SolverKind::pgs, 1e-9, 50));
  Solver second = std::move(first);
  const auto batch = batch_of({system({unilateral()}, {2}, {-3})});
  std::vector<double> lambda(1);
  std::vector<EnvStatus> status(1);
  second.solve(second.plan(batch.view()), batch.view(), SolutionView<double>{lambda.data(), nullptr, status.data()});
  EXPECT_EQ(lambda[0], 1.5);
}

}  // namespace
