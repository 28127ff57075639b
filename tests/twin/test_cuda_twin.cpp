#include <gtest/gtest.h>

#include <limits>
#include <memory>
#include <numeric>
#include <string>
#include <tuple>
#include <vector>

#include "tests/support/bits.hpp"
#include "tests/support/machines/cuda_device.hpp"
#include "tests/support/systems/small_systems.hpp"
#include "tests/support/systems/twin_batches.hpp"
#if defined(STICTION_HAS_CUDA)
#include "cuda/machine/contact_machine.hpp"
#include "cuda/native/cuda_api.hpp"
#endif

/// Equal bits from the CPU and from a GPU. Without a device every test here is skipped, with the reason.
namespace stiction::test {
namespace {

SolverOptions twin_options(SolverKind solver, Law law) {
  SolverOptions result = options(solver, 1e-6, 60);
  result.law = law;
  result.invalid = InvalidPolicy::isolate;
  result.threads = 0;
  return result;
}

class CudaTwin : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string reason;
    device_ = usable_cuda(reason);
    if (!device_) GTEST_SKIP() << "no GPU to compare with: " << reason;
  }
  template <class Real>
  void expect_twins(const ContactBatch<Real>& batch, const SolverOptions& options, std::span<const Real> warm = {}) {
    EXPECT_TRUE(same_bits(solve(batch, options, Device::cpu(), warm), solve(batch, options, *device_, warm)));
  }
  std::optional<Device> device_;
};

class CudaTwinOf : public CudaTwin, public ::testing::WithParamInterface<std::tuple<SolverKind, Law>> {};

TEST_P(CudaTwinOf, RaggedBatchesHaveTheSameBitsInBothPrecisions) {
  const auto [solver, law] = GetParam();
  const ContactBatch<double> batch = twin_batch();
  {
    SCOPED_TRACE("f32");
    expect_twins(convert<float>(batch), twin_options(solver, law));
  }
  {
    SCOPED_TRACE("f64");
    expect_twins(batch, twin_options(solver, law));
  }
}

TEST_P(CudaTwinOf, AWarmStartHasTheSameBits) {
  const auto [solver, law] = GetParam();
  const ContactBatch<float> batch = convert<float>(twin_batch());
  std::vector<float> warm(static_cast<std::size_t>(batch.row_count()));
  for (std::size_t i = 0; i < warm.size(); ++i) warm[i] = static_cast<float>(i % 7) * 0.125F - 0.25F;
  warm[3] = std::numeric_limits<float>::infinity();
  expect_twins(batch, twin_options(solver, law), std::span<const float>(warm));
}

TEST_P(CudaTwinOf, AThousandContactsInOneEnvironmentHaveTheSameBits) {
  const auto [solver, law] = GetParam();
  const ContactBatch<double> batch = batch_of({scenes::make("stack", 3, 0, 250).system});
  SolverOptions few = twin_options(solver, law);
  few.max_iterations = 12;
  expect_twins(convert<float>(batch), few);
  expect_twins(batch, few);
}

#if defined(STICTION_HAS_CUDA)
TEST_P(CudaTwinOf, WhoWorksOnAnEnvironmentChangesNoBit) {
  const auto [solver, law] = GetParam();
  const ContactBatch<float> batch = convert<float>(twin_batch());
  const SolverOptions options = twin_options(solver, law);
  const auto expected = env_hashes(batch, solve(batch, options));
  for (const SizeClass finest : {SizeClass::dense_large, SizeClass::dense_block, SizeClass::dense_warp,
                                 SizeClass::dense_tile, SizeClass::thread_medium}) {
    cuda::DeviceContactMachine machine(std::make_shared<cuda::CudaApi>(device_->ordinal), cuda::kPieceBytes,
                                       cuda::ClassRules::from(finest));
    Solution<float> answer = solve(batch, options);
    for (float& value : answer.lambda) value = -1.0F;
    machine.solve(SolveRequest<float>{nullptr,
                                      batch.view(),
                                      {answer.lambda.data(), answer.w.data(), answer.status.data()},
                                      nullptr,
                                      law,
                                      options,
                                      StreamRef::default_stream()});
    EXPECT_EQ(env_hashes(batch, answer), expected) << "dense environments in class " << static_cast<int>(finest);
  }
}
#endif

INSTANTIATE_TEST_SUITE_P(EverySolverAndLaw, CudaTwinOf,
                         ::testing::Combine(::testing::ValuesIn(kEverySolver), ::testing::ValuesIn(kBothLaws)),
                         [](const auto& instance) {
                           return std::string(to_string(std::get<0>(instance.param))) + "_" +
                                  to_string(std::get<1>(instance.param));
                         });

TEST_F(CudaTwin, APermutedBatchHasTheSameBitsEnvironmentByEnvironment) {
  const ContactBatch<float> batch = convert<float>(twin_batch());
  std::vector<Offset> order(static_cast<std::size_t>(batch.env_count()));
  std::iota(order.begin(), order.end(), Offset{0});
  for (std::size_t i = 0; i < order.size(); ++i) std::swap(order[i], order[(i * 7919 + 13) % order.size()]);
  const SolverOptions npgs = twin_options(SolverKind::npgs, Law::coulomb);
  const ContactBatch<float> permuted = gather(batch, std::span<const Offset>(order));
  const auto expected = env_hashes(batch, solve(batch, npgs));
  const auto actual = env_hashes(permuted, solve(permuted, npgs, *device_));
  for (std::size_t i = 0; i < order.size(); ++i) EXPECT_EQ(actual[i], expected[static_cast<std::size_t>(order[i])]);
}

TEST_F(CudaTwin, ThousandsOfSmallEnvironmentsHaveTheSameBits) {
  ContactBatch<double> batch(Law::coulomb);
  std::vector<Environment<double>> some;
  for (std::uint64_t e = 0; e < 50; ++e)
    some.push_back(scenes::make("stack", 17, e, 1 + static_cast<int>(e % 2)).system);
  for (std::size_t e = 0; e < 5000; ++e) batch.add(some[e * 31 % some.size()]);
  expect_twins(convert<float>(batch), twin_options(SolverKind::npgs, Law::coulomb));
}

TEST_F(CudaTwin, ABatchWithoutEnvironmentsIsSolved) {
  expect_twins(ContactBatch<float>{}, twin_options(SolverKind::npgs, Law::convex));
}

TEST_F(CudaTwin, ASolverGivesTheSameBitsAgainAndAgain) {
  const ContactBatch<float> batch = convert<float>(twin_batch());
  const SolverOptions npgs = twin_options(SolverKind::npgs, Law::coulomb);
  const Solution<float> expected = solve(batch, npgs);
  const Solver solver(*device_, npgs);
  const auto view = batch.view();
  for (int round = 0; round < 3; ++round) {
    const Plan plan = solver.plan(view);
    for (int again = 0; again < 2; ++again) {
      Solution<float> solution{std::vector<float>(expected.lambda.size()), std::vector<float>(expected.w.size()),
                               std::vector<EnvStatus>(expected.status.size())};
      solver.solve(plan, view, SolutionView<float>{solution.lambda.data(), solution.w.data(), solution.status.data()});
      EXPECT_TRUE(same_bits(expected, solution)) << "plan " << round << ", solve " << again;
    }
  }
}

TEST_F(CudaTwin, WMayBeLeftOut) {
  const ContactBatch<float> batch = convert<float>(twin_batch());
  const SolverOptions npgs = twin_options(SolverKind::npgs, Law::convex);
  const Solution<float> expected = solve(batch, npgs);
  const Solver solver(*device_, npgs);
  std::vector<float> lambda(expected.lambda.size());
  std::vector<EnvStatus> status(expected.status.size());
  solver.solve(solver.plan(batch.view()), batch.view(), SolutionView<float>{lambda.data(), nullptr, status.data()});
  EXPECT_TRUE(same_bits(std::span<const float>(expected.lambda), std::span<const float>(lambda)));
  EXPECT_TRUE(same_bits(std::span<const EnvStatus>(expected.status), std::span<const EnvStatus>(status)));
}

}  // namespace
}  // namespace stiction::test
