#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "cuda/emulated/emulated_device.hpp"
#include "cuda/machine/derivative_machine.hpp"
#include "stiction/error.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/derivative_cases.hpp"
#include "tests/support/error_message.hpp"
#include "tests/support/jacobian_systems.hpp"

/// Derivatives of a device, on the emulated device: the same numbers and records as the CPU's, to the last bit.
namespace stiction::test {
namespace {

/// A batch with its reactions, and what a loss says of them in two sets.
template <class Real>
struct Problem {
  ContactBatch<Real> batch;
  std::vector<Real> lambda, bar, w_bar;

  explicit Problem(ContactBatch<double> doubles) : batch(convert<Real>(doubles)) {
    lambda = solve(batch, options(SolverKind::npgs, 1e-5, 1000)).lambda;
    bar = random_numbers<Real>(2 * lambda.size(), 1);
    w_bar = random_numbers<Real>(2 * lambda.size(), 2);
  }
  [[nodiscard]] ContactBatchView<Real> on_device() const {
    ContactBatchView<Real> view = batch.view();
    view.space = MemorySpace::cuda;
    return view;
  }
};

ContactBatch<double> mixed(Law law) {
  ContactBatch<double> batch(law);
  for (std::uint64_t seed = 1; seed < 12; ++seed) {
    Recipe recipe;
    recipe.seed = seed;
    recipe.contacts = static_cast<int>(seed % 5);
    recipe.others = static_cast<int>(seed % 4);
    batch.add(seed == 4 ? Environment<double>{} : random_contacts(recipe));
  }
  // Rows that do not store every column.
  constexpr double kBounds[][2] = {{-1, 1}, {-0.1, 0.1}, {-1, 1}, {-0.2, 5}, {-1, 1}};
  batch.add(chain_of_boxes(kBounds, -1.5));
  return batch;
}

ContactBatch<double> factors(Law law) {
  JacobianBatch<double> batch(law);
  for (std::uint64_t seed = 1; seed < 5; ++seed) batch.add(random_jacobian({seed, 3, 2, 6, 0}));
  return assemble(batch.view(), FactorUse::always);
}

/// Room for gradients, none of which is written yet.
template <class Real>
Gradients<Real> blank(const Gradients<Real>& like) {
  Gradients<Real> to = like;
  for (auto* part : {&to.A, &to.factor, &to.b, &to.R, &to.mu, &to.lo, &to.hi}) part->assign(part->size(), Real(77));
  to.status.assign(to.status.size(), GradientStatus{});
  return to;
}

template <class T>
std::string bytes_of(const std::vector<T>& records) {
  return {reinterpret_cast<const char*>(records.data()), records.size() * sizeof(T)};
}

constexpr Capacity kRoom{
    .envs = 0, .rows = 0, .cones = 0, .nonzeros = 0, .env_rows = 40, .env_nonzeros = 0, .env_dofs = 6};

template <class Real>
VjpJob<Real> job_of(const Problem<Real>& problem, Law law, Gradients<Real>& own) {
  const DerivativeOptions o;
  VjpJob<Real> job;
  static_cast<DerivativeJob<Real>&>(job) = {
      problem.on_device(), {problem.lambda.data(), nullptr}, law, o.residual_limit, o.tie_tolerance, o.max_unknowns, 2,
      own.status.data()};
  job.cotangents = {problem.bar.data(), problem.w_bar.data()};
  job.gradients = own.view();
  return job;
}

template <class Real>
void expect_same(const Problem<Real>& problem, Law law, int lanes) {
  const DerivativeOptions o;
  const auto expected = vjp(problem.batch.view(), problem.lambda, problem.bar, problem.w_bar, o, nullptr, 2);
  Gradients<Real> own = blank(expected);
  cuda::EmulatedDeviceOptions options;
  options.lanes = lanes;
  cuda::DeviceDerivativeMachine machine(std::make_shared<cuda::EmulatedDevice>(options), kRoom, o.max_unknowns, false);
  machine.vjp(job_of(problem, law, own), StreamRef::default_stream());
  machine.synchronize(StreamRef::default_stream());
  const auto one = expected.all(), two = own.all();
  EXPECT_TRUE(same_bits(std::span<const Real>(one), std::span<const Real>(two)));
  EXPECT_EQ(bytes_of(own.status), bytes_of(expected.status));

  const BatchTangentView<Real> tangents{expected.A.data(), expected.factor.data(), problem.bar.data(),
                                        expected.R.data(), expected.mu.data(),     problem.bar.data(),
                                        problem.bar.data()};
  const auto changes = jvp(problem.batch.view(), problem.lambda, tangents);
  Changes<Real> moved = changes;
  moved.lambda.assign(moved.lambda.size(), Real(77));
  moved.w.assign(moved.w.size(), Real(77));
  Derivative(Device::emulated(), o, kRoom)
      .jvp(problem.on_device(), ReactionView<Real>{problem.lambda.data(), nullptr}, tangents,
           SolutionTangentView<Real>{moved.lambda.data(), moved.w.data()}, moved.status.data());
  EXPECT_TRUE(same_bits(std::span<const Real>(changes.lambda), std::span<const Real>(moved.lambda)));
  EXPECT_TRUE(same_bits(std::span<const Real>(changes.w), std::span<const Real>(moved.w)));
  EXPECT_EQ(bytes_of(moved.status), bytes_of(changes.status));
}

TEST(DeviceDerivative, HasTheBitsOfTheCpuOnAnyLanes) {
  for (const Law law : kBothLaws)
    for (const int lanes : {1, 3, 8}) {
      SCOPED_TRACE(std::string(to_string(law)) + ", lanes " + std::to_string(lanes));
      expect_same(Problem<float>(mixed(law)), law, lanes);
      expect_same(Problem<double>(mixed(law)), law, lanes);
      expect_same(Problem<double>(factors(law)), law, lanes);
    }
}

TEST(DeviceDerivative, TheFirstCallIsCapturedAndReplayedWithOtherNumbers) {
  Problem<float> problem(mixed(Law::coulomb));
  const auto device = std::make_shared<cuda::EmulatedDevice>(cuda::EmulatedDeviceOptions{3, 2, 4});
  cuda::DeviceDerivativeMachine machine(device, kRoom, DerivativeOptions{}.max_unknowns, false);
  const cuda::Stream stream(*device);
  Gradients<float> own = vjp(problem.batch.view(), problem.lambda, problem.bar, problem.w_bar, {}, nullptr, 2);
  const VjpJob<float> job = job_of(problem, Law::coulomb, own);
  device->begin_capture(stream.get());
  machine.vjp(job, StreamRef(stream.get()));
  const auto graph = device->end_capture(stream.get());
  for (int again = 0; again < 2; ++again) {
    for (float& number : problem.bar) number *= 1.5F;
    const auto expected = vjp(problem.batch.view(), problem.lambda, problem.bar, problem.w_bar, {}, nullptr, 2);
    device->launch(graph, stream.get());
    device->synchronize(stream.get());
    EXPECT_EQ(own.all(), expected.all());
    EXPECT_EQ(bytes_of(own.status), bytes_of(expected.status));
  }
}

TEST(DeviceDerivative, AnEnvironmentThatIsBrokenOrTooLargeLeavesTheOthersAlone) {
  const Problem<double> problem(mixed(Law::coulomb));
  const auto view = problem.batch.view();
  const auto expected = vjp(view, problem.lambda, problem.bar, {}, {}, nullptr, 1);
  // The widest environment does not fit, and one names a column that there is not.
  Index widest = 0;
  Offset large = 0;
  for (Offset e = 0; e < view.env_count; ++e)
    if (view.env_rows(e) > widest) widest = view.env_rows(large = e);
  const Offset broken = large == 6 ? 7 : 6;
  std::vector<Index> column = problem.batch.arrays().column;
  column[static_cast<std::size_t>(view.row_offsets[view.env_row_offsets[broken]])] = view.env_rows(broken);
  ContactBatchView<double> batch = problem.on_device();
  batch.column = column.data();
  Capacity room = kRoom;
  room.env_rows = widest - 1;
  Gradients<double> own = blank(expected);
  Derivative(Device::emulated(), {}, room)
      .vjp(batch, ReactionView<double>{problem.lambda.data(), nullptr},
           SolutionCotangentView<double>{problem.bar.data(), nullptr}, own.view(), own.status.data());
  EXPECT_EQ(own.status[static_cast<std::size_t>(large)].flags, kGradientOverCapacity);
  EXPECT_EQ(own.status[static_cast<std::size_t>(broken)].flags, kGradientBadStructure);
  for (Offset e = 0; e < view.env_count; ++e)
    for (Offset i = view.env_row_offsets[e]; i < view.env_row_offsets[e + 1]; ++i) {
      const auto at = static_cast<std::size_t>(i);
      EXPECT_EQ(own.b[at], e == large ? 0.0 : e == broken ? 77.0 : expected.b[at]) << "environment " << e;
    }
}

TEST(DeviceDerivative, RefusesWhatItCannotDo) {
  const Problem<double> problem(mixed(Law::coulomb));
  EXPECT_NE(error_message([] { Derivative{Device::emulated()}; }).find("capacity.env_rows"), std::string::npos);
  const Derivative there(Device::emulated(), {}, kRoom);
  GradientStatus status;
  EXPECT_NE(error_message([&] {
              there.vjp(problem.batch.view(), ReactionView<double>{problem.lambda.data(), nullptr},
                        SolutionCotangentView<double>{}, BatchCotangentView<double>{}, &status);
            }).find("batch.space"),
            std::string::npos);
}

}  // namespace
}  // namespace stiction::test
