#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "cuda/emulated/emulated_device.hpp"
#include "cuda/machine/derivative_machine.hpp"
#include "stiction/error.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/error_message.hpp"
#include "tests/support/oracles/jacobian_derivatives.hpp"

/// Derivatives by J and M of a device, on the emulated device: the same numbers and records as the CPU's, to the last
/// bit.
namespace stiction::test {
namespace {

constexpr Capacity kRoom{
    .envs = 0, .rows = 0, .cones = 0, .nonzeros = 0, .env_rows = 40, .env_nonzeros = 0, .env_dofs = 9};

/// A batch with its reactions, and two sets to pull back and to push forward.
template <class Real>
struct Problem {
  JacobianBatch<Real> batch;
  std::vector<Real> lambda;
  JacobianChanges<Real> bars;
  JacobianGradients<Real> along;

  Problem(const Form& form, Law law) : batch(made(form, law, true)), bars(batch.view(), 2), along(batch.view(), 2) {
    const double tolerance = sizeof(Real) == sizeof(float) ? 1e-5 : 1e-10;
    lambda = solve(made(form, law, false), options(SolverKind::newton, tolerance, 100)).contact.lambda;
    std::uint64_t draw = 0;
    for (auto* part : {&bars.lambda, &bars.w, &bars.velocity}) *part = random_numbers<Real>(part->size(), ++draw);
    for (auto* part : along.parts()) *part = random_numbers<Real>(part->size(), ++draw);
  }
  [[nodiscard]] JacobianBatchView<Real> on_device() const {
    JacobianBatchView<Real> view = batch.view();
    view.space = MemorySpace::cuda;
    return view;
  }

 private:
  /// `is_broken`: the third environment's M is not definite.
  static JacobianBatch<Real> made(const Form& form, Law law, bool is_broken) {
    JacobianBatch<Real> batch(law, form.mass_form, form.mass_block);
    for (std::uint64_t seed = 1; seed < 8; ++seed) {
      JacobianEnvironment<double> env = environment_of(form, seed);
      if (seed == 3 && is_broken) env.M[0] = -1;
      batch.add(cast<Real>(env));
    }
    return batch;
  }
};

template <class Real>
std::string bytes_of(const std::vector<Real>& records) {
  return {reinterpret_cast<const char*>(records.data()), records.size() * sizeof(Real)};
}

template <class Real>
void pull(const Derivative& by, const JacobianBatchView<Real>& view, const Problem<Real>& problem,
          JacobianGradients<Real>& to) {
  by.vjp(view, ReactionView<Real>{problem.lambda.data(), nullptr}, problem.bars.cotangents(), to.view(),
         to.status.data(), 2);
}
template <class Real>
void push(const Derivative& by, const JacobianBatchView<Real>& view, const Problem<Real>& problem,
          JacobianChanges<Real>& to) {
  by.jvp(view, ReactionView<Real>{problem.lambda.data(), nullptr}, problem.along.tangents(), to.view(),
         to.status.data(), 2);
}

template <class Real>
void expect_same(const Problem<Real>& problem, double kappa) {
  DerivativeOptions o;
  o.kappa = kappa;
  const auto view = problem.batch.view();
  JacobianGradients<Real> expected(view, 2), own(view, 2);
  const Derivative here(Device::cpu(), o), there(Device::emulated(), o, kRoom);
  pull(here, view, problem, expected);
  pull(there, problem.on_device(), problem, own);
  const auto one = expected.all(), two = own.all();
  EXPECT_TRUE(same_bits(std::span<const Real>(one), std::span<const Real>(two)));
  EXPECT_EQ(bytes_of(own.status), bytes_of(expected.status));
  EXPECT_EQ(own.status[2].flags & kGradientInvalidInput, kGradientInvalidInput);
  EXPECT_EQ(own.status[0].flags & kGradientRefused, 0U);

  JacobianChanges<Real> forward(view, 2), moved(view, 2);
  push(here, view, problem, forward);
  push(there, problem.on_device(), problem, moved);
  const auto three = forward.all(), four = moved.all();
  EXPECT_TRUE(same_bits(std::span<const Real>(three), std::span<const Real>(four)));
  EXPECT_EQ(bytes_of(moved.status), bytes_of(forward.status));
}

TEST(DeviceJacobianDerivative, HasTheBitsOfTheCpu) {
  for (const Law law : kBothLaws)
    for (const Form& form : kForms) {
      expect_same(Problem<float>(form, law), 0.0);
      expect_same(Problem<double>(form, law), 0.0);
      expect_same(Problem<float>(form, law), 1e-2);
    }
}

/// Robots beside one another, which a lane takes one after the other, and a robot that is large.
TEST(DeviceJacobianDerivative, OfLargeEnvironmentsIsFoundPartByPart) {
  for (const MassForm form : {MassForm::matrix, MassForm::factor}) {
    JacobianBatch<double> batch(Law::convex, form);
    std::vector<JacobianEnvironment<double>> parts;
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
      parts.push_back(random_jacobian({seed, 2, 1, 9, 0, 0.02}));
      if (form == MassForm::factor) parts.back().M = cholesky(parts.back().M, 9);
    }
    batch.add(parts[0]);
    batch.add(beside_one_another(parts));
    JacobianEnvironment<double> large = random_jacobian({9, 4, 3, 69, 0, 0.02});
    if (form == MassForm::factor) large.M = cholesky(large.M, 69);
    batch.add(large);
    const auto lambda = solve(batch, options(SolverKind::newton, 1e-10, 100)).contact.lambda;
    auto view = batch.view();
    JacobianChanges<double> bars(view);
    std::uint64_t draw = 0;
    for (auto* part : {&bars.lambda, &bars.w, &bars.velocity}) *part = random_numbers(part->size(), ++draw);
    JacobianGradients<double> expected(view), own(view);
    const ReactionView<double> at{lambda.data(), nullptr};
    Derivative(Device::cpu()).vjp(view, at, bars.cotangents(), expected.view(), expected.status.data());
    Capacity room = kRoom;
    room.env_rows = 60;
    room.env_dofs = 72;
    const Derivative there(Device::emulated(), {}, room);
    view.space = MemorySpace::cuda;
    there.vjp(view, at, bars.cotangents(), own.view(), own.status.data());
    const auto one = expected.all(), two = own.all();
    EXPECT_TRUE(same_bits(std::span<const double>(one), std::span<const double>(two)));
    EXPECT_EQ(bytes_of(own.status), bytes_of(expected.status));
    EXPECT_EQ(own.status[1].flags, 0U);
    EXPECT_EQ(own.status[2].flags, 0U);

    // Robots change without being coupled.
    JacobianGradients<double> along(view);
    for (auto* part : along.parts()) *part = random_numbers(part->size(), ++draw);
    for (auto& part : parts) part.J = random_numbers(part.J.size(), ++draw);
    const JacobianEnvironment<double> changed = beside_one_another(parts);
    std::ranges::copy(changed.J, along.J.begin() + view.row_offsets[view.env_row_offsets[1]]);
    std::ranges::copy(changed.M, along.M.begin() + view.env_mass_offsets[1]);
    JacobianChanges<double> forward(view), moved(view);
    Derivative(Device::cpu()).jvp(batch.view(), at, along.tangents(), forward.view(), forward.status.data());
    there.jvp(view, at, along.tangents(), moved.view(), moved.status.data());
    const auto three = forward.all(), four = moved.all();
    EXPECT_TRUE(same_bits(std::span<const double>(three), std::span<const double>(four)));
    EXPECT_EQ(bytes_of(moved.status), bytes_of(forward.status));
  }
}

TEST(DeviceJacobianDerivative, HasTheBitsOfTheCpuOnAnyLanes) {
  const Problem<float> problem(kForms[3], Law::coulomb);
  const auto view = problem.batch.view();
  JacobianGradients<float> expected(view, 2);
  pull(Derivative(), view, problem, expected);
  for (const int lanes : {1, 3, 8}) {
    cuda::EmulatedDeviceOptions options;
    options.lanes = lanes;
    const DerivativeOptions o;
    cuda::DeviceDerivativeMachine machine(std::make_shared<cuda::EmulatedDevice>(options), kRoom, o, true);
    JacobianGradients<float> own(view, 2);
    JacobianVjpJob<float> job{};
    job.contact.at = {problem.lambda.data(), nullptr};
    job.contact.law = Law::coulomb;
    job.contact.residual_limit = o.residual_limit;
    job.contact.tie_tolerance = o.tie_tolerance;
    job.contact.max_unknowns = o.max_unknowns;
    job.contact.count = 2;
    job.contact.status = own.status.data();
    job.contact.cotangents.w = problem.bars.w.data();
    job.assembly.batch = problem.on_device();
    job.cotangents = problem.bars.cotangents();
    job.gradients = own.view();
    job.contact.gradients = {nullptr, nullptr, nullptr, own.R.data(), own.mu.data(), own.lo.data(), own.hi.data()};
    machine.vjp(job, StreamRef::default_stream());
    EXPECT_EQ(own.all(), expected.all()) << lanes << " lanes";
  }
}

/// Many rows and few degrees of freedom: A is kept as a factor.
TEST(DeviceJacobianDerivative, OfEnvironmentsThatAreKeptAsFactors) {
  JacobianBatch<double> batch(Law::convex);
  for (std::uint64_t seed = 1; seed < 3; ++seed) batch.add(random_jacobian({seed, 26, 2, 6, 0, 0.05}));
  const auto view = batch.view();
  ASSERT_TRUE(prefers_factor(view.env_rows(0), 6));
  const auto lambda = solve(batch, options(SolverKind::newton, 1e-10, 100)).contact.lambda;
  const auto v_bar = random_numbers(12, 1);
  const auto expected = vjp(view, lambda, {}, {}, v_bar);
  Capacity room = kRoom;
  room.env_rows = view.env_rows(0);
  JacobianGradients<double> own(view);
  JacobianBatchView<double> there = view;
  there.space = MemorySpace::cuda;
  Derivative(Device::emulated(), {}, room)
      .vjp(there, ReactionView<double>{lambda.data(), nullptr},
           JacobianSolutionCotangentView<double>{nullptr, nullptr, v_bar.data()}, own.view(), own.status.data());
  EXPECT_EQ(own.all(), expected.all());
  EXPECT_EQ(own.status[0].flags, 0U);
}

TEST(DeviceJacobianDerivative, AnEnvironmentThatIsBrokenOrTooLargeLeavesTheOthersAlone) {
  const Problem<double> problem(kForms[1], Law::coulomb);
  const auto view = problem.batch.view();
  JacobianGradients<double> expected(view, 2);
  pull(Derivative(), view, problem, expected);
  Index widest = 0;
  Offset large = 0;
  for (Offset e = 0; e < view.env_count; ++e)
    if (view.env_rows(e) > widest) widest = view.env_rows(large = e);
  const Offset broken = large == 5 ? 4 : 5;
  std::vector<Index> column(view.column, view.column + view.entry_count);
  column[static_cast<std::size_t>(view.row_offsets[view.env_row_offsets[broken]])] = 9;
  JacobianBatchView<double> there = problem.on_device();
  there.column = column.data();
  Capacity room = kRoom;
  room.env_rows = widest - 1;
  JacobianGradients<double> own(view, 2);
  pull(Derivative(Device::emulated(), {}, room), there, problem, own);
  EXPECT_EQ(own.status[static_cast<std::size_t>(broken)].flags, kGradientBadStructure);
  for (Offset e = 0; e < view.env_count; ++e) {
    const bool too_large = view.env_rows(e) >= widest;
    const auto same = [&](const std::vector<double>& one, const std::vector<double>& other, const Offset* begin) {
      for (auto i = static_cast<std::size_t>(begin[e]); i < static_cast<std::size_t>(begin[e + 1]); ++i)
        EXPECT_EQ(one[i], e == broken ? 77.0 : too_large ? 0.0 : other[i]) << "environment " << e;
    };
    same(own.target, expected.target, view.env_row_offsets);
    same(own.mu, expected.mu, view.env_row_offsets);
    same(own.v_free, expected.v_free, view.env_dof_offsets);
    same(own.M, expected.M, view.env_mass_offsets);
    if (too_large && e != broken) {
      EXPECT_EQ(own.status[static_cast<std::size_t>(e)].flags, kGradientOverCapacity);
    }
  }
}

TEST(DeviceJacobianDerivative, ACaptureNeedsACallOfItsSizeBefore) {
  Problem<float> problem(kForms[0], Law::coulomb);
  const auto view = problem.batch.view();
  const auto device = std::make_shared<cuda::EmulatedDevice>(cuda::EmulatedDeviceOptions{3, 2, 4});
  cuda::DeviceDerivativeMachine machine(device, kRoom, DerivativeOptions{}, false);
  const cuda::Stream stream(*device);
  const DerivativeOptions o;
  JacobianChanges<float> own(view, 2), expected(view, 2);
  JacobianJvpJob<float> job{};
  job.contact.at = {problem.lambda.data(), nullptr};
  job.contact.law = Law::coulomb;
  job.contact.residual_limit = o.residual_limit;
  job.contact.tie_tolerance = o.tie_tolerance;
  job.contact.max_unknowns = o.max_unknowns;
  job.contact.count = 2;
  job.contact.status = own.status.data();
  job.assembly.batch = problem.on_device();
  job.tangents = problem.along.tangents();
  job.contact.tangents.R = job.tangents.R;
  job.contact.tangents.mu = job.tangents.mu;
  job.contact.tangents.lo = job.tangents.lo;
  job.contact.tangents.hi = job.tangents.hi;
  job.changes = own.view();
  job.contact.changes.w = own.w.data();
  device->begin_capture(stream.get());
  EXPECT_NE(error_message([&] { machine.jvp(job, StreamRef(stream.get())); }).find("before the capture"),
            std::string::npos);
  device->end_capture(stream.get());
  machine.jvp(job, StreamRef(stream.get()));
  device->synchronize(stream.get());
  device->begin_capture(stream.get());
  machine.jvp(job, StreamRef(stream.get()));
  const auto graph = device->end_capture(stream.get());
  // Arrays that the graph reads stay in place: a call that needs more is refused before anything is read.
  JacobianJvpJob<float> larger = job;
  larger.contact.count = 3;
  EXPECT_NE(error_message([&] { machine.jvp(larger, StreamRef(stream.get())); }).find("a graph holds the room"),
            std::string::npos);
  for (int again = 0; again < 2; ++again) {
    for (float& number : problem.along.v_free) number *= 1.5F;
    push(Derivative(), view, problem, expected);
    device->launch(graph, stream.get());
    device->synchronize(stream.get());
    EXPECT_EQ(own.all(), expected.all());
  }
}

}  // namespace
}  // namespace stiction::test
