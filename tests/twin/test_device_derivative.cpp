#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/job/cone_counts.hpp"
#include "cuda/emulated/emulated_device.hpp"
#include "cuda/machine/derivative_machine.hpp"
#include "stiction/captured_calls.hpp"
#include "stiction/error.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/error_message.hpp"
#include "tests/support/systems/derivative_cases.hpp"
#include "tests/support/systems/jacobian_systems.hpp"

/// Derivatives of a device, on the emulated device: the same numbers and records as the CPU's, to the last bit.
namespace stiction::test {
namespace {

/// A batch with its reactions, and a loss's derivatives by them in two sets.
template <class Real>
struct Problem {
  ContactBatch<Real> batch;
  std::vector<Real> lambda, bar, w_bar;

  explicit Problem(const ContactBatch<double>& doubles) : batch(convert<Real>(doubles)) {
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

/// Boxes in a row, of which neighbours alone press on each other: sparse.
Environment<double> long_chain(std::size_t rows) {
  Environment<double> env;
  env.row_offsets = {0};
  for (std::size_t i = 0; i < rows; ++i) {
    env.cones.push_back(box());
    for (std::size_t j = i > 0 ? i - 1 : 0; j < std::min(rows, i + 2); ++j) {
      env.A.push_back(i == j ? 2.0 + 0.01 * static_cast<double>(i) : -0.7);
      env.column.push_back(static_cast<Index>(j));
    }
    env.row_offsets.push_back(static_cast<Index>(env.A.size()));
  }
  env.b = random_numbers(rows, 7);
  env.R.assign(rows, 0.05);
  env.mu.assign(rows, 0.0);
  env.lo.assign(rows, -0.4);
  env.hi.assign(rows, 0.6);
  return env;
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
VjpJob<Real> job_of(const Problem<Real>& problem, Law law, Gradients<Real>& own, const DerivativeOptions& o = {}) {
  VjpJob<Real> job;
  static_cast<DerivativeJob<Real>&>(job) = {
      problem.on_device(), {problem.lambda.data(), nullptr}, law, o.residual_limit, o.tie_tolerance, o.max_unknowns, 2,
      own.status.data()};
  job.cotangents = {problem.bar.data(), problem.w_bar.data()};
  job.gradients = own.view();
  return job;
}

/// `kappa`: of the relaxed problem, whose room grows with the first call.
template <class Real>
void expect_same(const Problem<Real>& problem, Law law, int lanes, double kappa = 0.0) {
  DerivativeOptions o;
  o.kappa = kappa;
  const auto expected = vjp(problem.batch.view(), problem.lambda, problem.bar, problem.w_bar, o, nullptr, 2);
  Gradients<Real> own = blank(expected);
  cuda::EmulatedDeviceOptions options;
  options.lanes = lanes;
  cuda::DeviceDerivativeMachine machine(std::make_shared<cuda::EmulatedDevice>(options), kRoom, o, false);
  machine.vjp(job_of(problem, law, own, o), StreamRef::default_stream());
  machine.synchronize(StreamRef::default_stream());
  const auto one = expected.all(), two = own.all();
  EXPECT_TRUE(same_bits(std::span<const Real>(one), std::span<const Real>(two)));
  EXPECT_EQ(bytes_of(own.status), bytes_of(expected.status));
  EXPECT_EQ(own.status[0].flags & kGradientRefused, 0U);

  const BatchTangentView<Real> tangents{expected.A.data(), expected.factor.data(), problem.bar.data(),
                                        expected.R.data(), expected.mu.data(),     problem.bar.data(),
                                        problem.bar.data()};
  const auto changes = jvp(problem.batch.view(), problem.lambda, tangents, o);
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

TEST(DeviceDerivative, OfTheRelaxedProblemHasTheBitsOfTheCpuOnAnyLanes) {
  for (const Law law : kBothLaws)
    for (const int lanes : {1, 8}) {
      SCOPED_TRACE(std::string(to_string(law)) + ", lanes " + std::to_string(lanes));
      expect_same(Problem<float>(mixed(law)), law, lanes, 1e-2);
      expect_same(Problem<double>(mixed(law)), law, lanes, 1e-3);
      expect_same(Problem<double>(factors(law)), law, lanes, 1e-2);
    }
}

/// Sweeps in reverse, and all that they gave.
template <class Real>
struct Swept : Gradients<Real> {
  std::vector<Real> lambda, by_warm_start;

  explicit Swept(const ContactBatchView<Real>& batch) {
    const auto room = [](Offset size) { return std::vector<Real>(static_cast<std::size_t>(2 * size), Real(77)); };
    this->A = room(batch.nonzero_count);
    this->factor = room(batch.factor_count);
    this->b = this->R = this->mu = this->lo = this->hi = lambda = by_warm_start = room(batch.row_count);
    this->status.resize(static_cast<std::size_t>(batch.env_count));
  }
  [[nodiscard]] SweepsView<Real> sweeps(const std::vector<Real>& start, Index count) {
    return {start.data(), count, 0.9, lambda.data(), by_warm_start.data()};
  }
  [[nodiscard]] std::string bytes() const {
    std::string all = bytes_of(this->status);
    for (const auto* part :
         {&this->A, &this->factor, &this->b, &this->R, &this->mu, &this->lo, &this->hi, &lambda, &by_warm_start})
      all += bytes_of(*part);
    return all;
  }
};

template <class Real>
UnrolledJob<Real> sweeps_of(const Problem<Real>& problem, Law law, Swept<Real>& to, Index count) {
  UnrolledJob<Real> job{};
  static_cast<VjpJob<Real>&>(job) = job_of(problem, law, to);
  job.sweeps = to.sweeps(problem.bar, count);
  return job;
}

/// Sweeps of one number and then of a larger one, for which the tape grows, against the CPU's.
template <class Real>
void expect_same_sweeps(const Problem<Real>& problem, Law law, int lanes, const Capacity& room = kRoom) {
  const auto view = problem.batch.view();
  cuda::EmulatedDeviceOptions options;
  options.lanes = lanes;
  cuda::DeviceDerivativeMachine machine(std::make_shared<cuda::EmulatedDevice>(options), room, {}, false);
  for (const Index count : {0, 5}) {
    Swept<Real> expected(view), own(view);
    Derivative().unrolled_vjp(view, expected.sweeps(problem.bar, count),
                              SolutionCotangentView<Real>{problem.bar.data(), problem.w_bar.data()}, expected.view(),
                              expected.status.data(), 2);
    machine.unrolled_vjp(sweeps_of(problem, law, own, count), StreamRef::default_stream());
    machine.synchronize(StreamRef::default_stream());
    EXPECT_EQ(own.bytes(), expected.bytes()) << count << " sweeps";
    EXPECT_EQ(own.status[0].flags, 0U);
  }
}

TEST(DeviceDerivative, OfSweepsHasTheBitsOfTheCpuOnAnyLanes) {
  for (const Law law : kBothLaws)
    for (const int lanes : {1, 3, 8}) {
      SCOPED_TRACE(std::string(to_string(law)) + ", lanes " + std::to_string(lanes));
      expect_same_sweeps(Problem<float>(mixed(law)), law, lanes);
      expect_same_sweeps(Problem<double>(mixed(law)), law, lanes);
      expect_same_sweeps(Problem<double>(factors(law)), law, lanes);
    }
}

/// A chain of boxes so long that sweeps go by its colours, which the device finds.
TEST(DeviceDerivative, OfSweepsByColoursHasTheBitsOfTheCpu) {
  ContactBatch<double> batch(Law::convex);
  batch.add(long_chain(80));
  batch.add(random_contacts({.seed = 3}));
  const Problem<double> problem(batch);
  ASSERT_EQ(choose_path(problem.batch.view().env_rows(0), 3 * 80 - 2), EnvPath::sparse);
  Capacity room = kRoom;
  room.env_rows = 80;
  expect_same_sweeps(problem, Law::convex, 8, room);
}

TEST(DeviceDerivative, SweepsOfAnEnvironmentThatIsBrokenOrTooLargeLeaveTheOthersAlone) {
  const Problem<double> problem(mixed(Law::coulomb));
  const auto view = problem.batch.view();
  Swept<double> expected(view), own(view);
  const SolutionCotangentView<double> bars{problem.bar.data(), nullptr};
  Derivative().unrolled_vjp(view, expected.sweeps(problem.bar, 3), bars, expected.view(), expected.status.data());
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
  Derivative(Device::emulated(), {}, room)
      .unrolled_vjp(batch, own.sweeps(problem.bar, 3), bars, own.view(), own.status.data());
  EXPECT_EQ(own.status[static_cast<std::size_t>(large)].flags, kGradientOverCapacity);
  EXPECT_EQ(own.status[static_cast<std::size_t>(broken)].flags, kGradientBadStructure);
  for (Offset e = 0; e < view.env_count; ++e)
    for (Offset i = view.env_row_offsets[e]; i < view.env_row_offsets[e + 1]; ++i) {
      const auto at = static_cast<std::size_t>(i);
      EXPECT_EQ(own.b[at], e == large ? 0.0 : e == broken ? 77.0 : expected.b[at]) << "environment " << e;
      EXPECT_EQ(own.lambda[at], e == large ? 0.0 : e == broken ? 77.0 : expected.lambda[at]) << "environment " << e;
    }
}

/// Room that a graph holds does not move: calls that need more are refused, in the capture and behind it.
TEST(DeviceDerivative, RoomForSweepsAndRelaxedReactionsIsMadeBeforeACapture) {
  const Problem<double> problem(mixed(Law::coulomb));
  const auto view = problem.batch.view();
  const auto device = std::make_shared<cuda::EmulatedDevice>(cuda::EmulatedDeviceOptions{3, 2, 4});
  DerivativeOptions o;
  o.kappa = 1e-2;
  cuda::DeviceDerivativeMachine machine(device, kRoom, o, false);
  const cuda::Stream stream(*device);
  Swept<double> own(view), expected(view);
  const auto sweeps = [&](Index count) {
    machine.unrolled_vjp(sweeps_of(problem, Law::coulomb, own, count), StreamRef(stream.get()));
  };
  const auto relaxed = [&] { machine.vjp(job_of(problem, Law::coulomb, own, o), StreamRef(stream.get())); };
  device->begin_capture(stream.get());
  EXPECT_NE(error_message([&] { sweeps(3); }).find("before the capture"), std::string::npos);
  EXPECT_NE(error_message(relaxed).find("before the capture"), std::string::npos);
  device->end_capture(stream.get());
  relaxed();
  sweeps(3);
  device->synchronize(stream.get());
  device->begin_capture(stream.get());
  sweeps(3);
  const auto graph = device->end_capture(stream.get());
  EXPECT_NE(error_message([&] { sweeps(400); }).find("a graph holds"), std::string::npos);
  for (auto* part : {&own.A, &own.b, &own.lambda, &own.by_warm_start}) std::fill(part->begin(), part->end(), 77.0);
  device->launch(graph, stream.get());
  device->synchronize(stream.get());
  Derivative().unrolled_vjp(view, expected.sweeps(problem.bar, 3),
                            SolutionCotangentView<double>{problem.bar.data(), problem.w_bar.data()}, expected.view(),
                            expected.status.data(), 2);
  EXPECT_EQ(own.bytes(), expected.bytes());
}

TEST(DeviceDerivative, TheFirstCallIsCapturedAndReplayedWithOtherNumbers) {
  Problem<float> problem(mixed(Law::coulomb));
  const auto device = std::make_shared<cuda::EmulatedDevice>(cuda::EmulatedDeviceOptions{3, 2, 4});
  cuda::DeviceDerivativeMachine machine(device, kRoom, DerivativeOptions{}, false);
  const cuda::Stream stream(*device);
  Gradients<float> own = vjp(problem.batch.view(), problem.lambda, problem.bar, problem.w_bar, {}, nullptr, 2);
  const VjpJob<float> job = job_of(problem, Law::coulomb, own);
  const std::uint64_t captured = captured_calls();
  device->begin_capture(stream.get());
  machine.vjp(job, StreamRef(stream.get()));
  const auto graph = device->end_capture(stream.get());
  EXPECT_EQ(captured_calls(), captured + 1);
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
  // The widest environment does not fit, and one names a missing column.
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
