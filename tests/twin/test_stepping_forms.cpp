#include <gtest/gtest.h>

#include <algorithm>

#include "stiction/error.hpp"
#include "stiction/stepping.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/body_systems.hpp"
#include "tests/support/systems/jacobian_systems.hpp"
#include "tests/support/systems/roomy_jacobians.hpp"

/// Stepping in the Jacobian form and of bodies. A step is a solve from the last step's reactions, found by contact,
/// with the same bits on every device.
namespace stiction::test {
namespace {

constexpr Offset kEnvs = 5;
constexpr double kBeta = 0.95;

/// Environments of different sizes, one without contacts; step 1 has other numbers than step 0.
template <class Real>
JacobianBatch<Real> jacobians(int step) {
  JacobianBatch<Real> batch(Law::coulomb);
  for (Offset e = 0; e < kEnvs; ++e) {
    const int contacts = e == 3 ? 0 : 1 + static_cast<int>(e);
    JacobianEnvironment<double> env = random_jacobian({static_cast<std::uint64_t>(e) + 1, contacts, 0, 12, 0});
    for (double& v : env.v_free) v *= 1 + 0.1 * step;
    batch.add(cast<Real>(env));
  }
  return batch;
}

template <class Real>
BodyBatch<Real> bodies(int step, bool reversed = false) {
  BodyBatch<Real> batch;
  for (Offset e = 0; e < kEnvs; ++e) {
    BodyEnvironment<double> env =
        random_bodies(static_cast<std::uint64_t>(e) + 1, 4, e == 3 ? 0 : 4 * static_cast<Index>(e + 1));
    for (auto& body : env.bodies)
      for (double& v : body.twist) v *= 1 + 0.1 * step;
    for (std::size_t c = 0; c < env.contacts.size(); ++c) env.contacts[c].id = 40 + 3 * c;
    if (reversed) std::reverse(env.contacts.begin(), env.contacts.end());
    if constexpr (std::is_same_v<Real, float>)
      batch.add(scenes::rounded(env));
    else
      batch.add(env);
  }
  return batch;
}

/// Few iterations, so that where they start from reaches the answer.
SolverOptions few() {
  SolverOptions options;
  options.tolerance = 0;
  options.max_iterations = 3;
  options.threads = 1;
  return options;
}
BodySolverOptions few_sweeps() {
  BodySolverOptions options;
  options.iterations = 3;
  options.threads = 1;
  return options;
}

template <class Real>
struct Answer {
  std::vector<Real> lambda, velocity;
  std::vector<EnvStatus> status{static_cast<std::size_t>(kEnvs)};
  Answer(Offset rows, Offset dofs) : lambda(static_cast<std::size_t>(rows)), velocity(static_cast<std::size_t>(dofs)) {}
};

template <class Real>
void expect_same(const Answer<Real>& a, const Answer<Real>& b) {
  EXPECT_TRUE(same_bits(std::span<const Real>(a.lambda), std::span<const Real>(b.lambda)));
  EXPECT_TRUE(same_bits(std::span<const Real>(a.velocity), std::span<const Real>(b.velocity)));
  EXPECT_TRUE(same_bits(std::span<const EnvStatus>(a.status), std::span<const EnvStatus>(b.status)));
}

template <class Real>
JacobianSolutionView<Real> view(Answer<Real>& answer) {
  return {answer.lambda.data(), nullptr, answer.velocity.data(), answer.status.data()};
}
template <class Real>
BodySolutionView<Real> body_view(Answer<Real>& answer) {
  return {answer.lambda.data(), answer.velocity.data(), nullptr, answer.status.data()};
}

template <class Real>
Answer<Real> take(JacobianSteppingSolver<Real>& solver, const JacobianBatch<Real>& batch,
                  const std::vector<std::uint64_t>& ids) {
  JacobianBatchView<Real> seen = batch.view();
  if (solver.solver().solver().device().kind != DeviceKind::cpu) seen.space = MemorySpace::cuda;
  Answer<Real> answer(batch.row_count(), batch.dof_count());
  solver.solve(seen, ids.data(), 0.01, view(answer));
  solver.synchronize();
  return answer;
}
template <class Real>
Answer<Real> take(BodySteppingSolver<Real>& solver, const BodyBatch<Real>& batch) {
  BodyBatchView<Real> seen = batch.view();
  if (solver.solver().device().kind != DeviceKind::cpu) seen.space = MemorySpace::cuda;
  Answer<Real> answer(3 * batch.contact_count(), 6 * batch.body_count());
  solver.solve(seen, body_view(answer));
  solver.synchronize();
  return answer;
}

std::vector<std::uint64_t> ids_of(Offset cones) {
  std::vector<std::uint64_t> ids;
  for (Offset c = 0; c < cones; ++c) ids.push_back(static_cast<std::uint64_t>(900 - 7 * c));
  return ids;
}

template <class Real>
JacobianCapacity room() {
  return JacobianCapacity::of(jacobians<Real>(0).view());
}

/// Returns the start of a cone that was there.
template <class Real>
Real carried(Real lambda) {
  return lambda == Real(0) ? Real(0) : static_cast<Real>(kBeta) * lambda;
}

template <class Real>
void expect_jacobian_steps() {
  JacobianSteppingSolver<Real> solver(Device::cpu(), few(), room<Real>());
  JacobianSteppingSolver<Real> device(Device::emulated(), few(), room<Real>());
  const JacobianBatch<Real> first = jacobians<Real>(0), second = jacobians<Real>(1);
  std::vector<std::uint64_t> ids = ids_of(first.view().cone_count);
  const Answer<Real> cold = take(solver, first, ids);
  expect_same(take(device, first, ids), cold);

  std::vector<Real> guess(cold.lambda.size());
  std::transform(cold.lambda.begin(), cold.lambda.end(), guess.begin(), carried<Real>);
  ids[1] = 5;  // another contact took the place of this one, the first of environment 1
  for (const std::size_t row : {std::size_t{3}, std::size_t{4}, std::size_t{5}}) guess[row] = 0;
  JacobianSolver<Real> alone(Device::cpu(), few(), {});
  Answer<Real> expected(second.row_count(), second.dof_count());
  alone.solve(second.view(), view(expected), guess.data());
  const Answer<Real> warm = take(solver, second, ids);
  expect_same(warm, expected);
  expect_same(take(device, second, ids), expected);
  EXPECT_FALSE(same_bits(std::span<const Real>(warm.lambda), std::span<const Real>(cold.lambda)));

  const std::vector<Offset> all{0, 1, 2, 3, 4};
  solver.reset(all);
  expect_same(take(solver, first, ids), cold);
}

TEST(SteppingForms, AJacobianStepStartsFromWhatItsContactsHad) {
  expect_jacobian_steps<double>();
  expect_jacobian_steps<float>();
}

template <class Real>
void expect_body_steps() {
  const BodyBatch<Real> first = bodies<Real>(0), second = bodies<Real>(1, true);
  const Offset contacts = first.contact_count();
  BodySteppingSolver<Real> solver(Device::cpu(), {}, few_sweeps(), kEnvs, contacts);
  BodySteppingSolver<Real> device(Device::emulated(), {}, few_sweeps(), kEnvs, contacts);
  const Answer<Real> cold = take(solver, first);
  expect_same(take(device, first), cold);

  std::vector<Real> guess(cold.lambda.size());
  const BodyBatchView<Real> seen = first.view();
  for (Offset e = 0; e < kEnvs; ++e)
    for (Offset c = seen.env_contact_offsets[e]; c < seen.env_contact_offsets[e + 1]; ++c)
      for (Offset k = 0; k < 3; ++k) {
        const Offset mirrored = seen.env_contact_offsets[e] + seen.env_contact_offsets[e + 1] - 1 - c;
        guess[static_cast<std::size_t>(3 * mirrored + k)] = carried(cold.lambda[static_cast<std::size_t>(3 * c + k)]);
      }
  const BodySolver alone(Device::cpu(), {}, few_sweeps());
  Answer<Real> expected(3 * contacts, 6 * second.body_count());
  alone.solve(alone.plan(second.view()), second.view(), body_view(expected), guess.data());
  expect_same(take(solver, second), expected);
  expect_same(take(device, second), expected);

  solver.reset_all();
  expect_same(take(solver, first), cold);
}

TEST(SteppingForms, AStepOfBodiesStartsFromWhatItsContactsHad) {
  expect_body_steps<double>();
  expect_body_steps<float>();
}

/// A step half as long gives about half the impulse.
TEST(SteppingForms, BodiesWhoseStepChangesKeepTheirForces) {
  BodyBatch<double> batch;
  BodyEnvironment<double> ball = ball_on_floor(0.1, 2, 0.5);
  ball.bodies[0].twist_change[2] = -kFall;
  batch.add(ball);
  BodySolverOptions none;
  none.iterations = 0;
  BodySteppingSolver<double> solver(Device::cpu(), {}, few_sweeps(), 1, 1);
  std::vector<double> impulse(3), twist(6);
  EnvStatus status;
  const BodySolutionView<double> answer{impulse.data(), twist.data(), nullptr, &status};
  solver.solve(batch.view(), answer);
  EXPECT_NEAR(impulse[0], 2 * kFall, 1e-12);
  TimeStepping half;
  half.dt = 0.0025;
  solver.change(half, none);
  solver.solve(batch.view(), answer);
  EXPECT_NEAR(impulse[0], kBeta * kFall, 1e-12);  // the guess itself: no sweep follows
}

TEST(SteppingForms, MisuseIsRefusedAndResetsNothing) {
  EXPECT_THROW(JacobianSteppingSolver<double>(Device::cpu(), few(), JacobianCapacity{}), Error);
  EXPECT_THROW(BodySteppingSolver<double>(Device::cpu(), {}, few_sweeps(), 0, 4), Error);
  JacobianCapacity small = room<double>();
  small.rows = 3;
  JacobianSteppingSolver<double> tight(Device::cpu(), few(), small);
  const JacobianBatch<double> batch = jacobians<double>(0);
  const std::vector<std::uint64_t> ids = ids_of(batch.view().cone_count);
  EXPECT_THROW(take(tight, batch, ids), Error);
  const BodyBatch<double> falling = bodies<double>(0);
  BodySteppingSolver<double> cramped(Device::cpu(), {}, few_sweeps(), kEnvs, falling.contact_count() - 1);
  EXPECT_THROW(take(cramped, falling), Error);

  JacobianSteppingSolver<double> solver(Device::cpu(), few(), room<double>());
  take(solver, batch, ids);
  Answer<double> nowhere(batch.row_count(), batch.dof_count());
  EXPECT_THROW(solver.solve(batch.view(), ids.data(), 0.01, {}), Error);
  EXPECT_THROW(solver.solve(batch.view(), nullptr, 0.01, view(nowhere)), Error);
  EXPECT_THROW(solver.solve(batch.view(), ids.data(), 0, view(nowhere)), Error);
  JacobianBatchView<double> broken = batch.view();
  const std::vector<double> not_numbers(static_cast<std::size_t>(batch.dof_count()), std::nan(""));
  broken.v_free = not_numbers.data();
  EXPECT_THROW(solver.solve(broken, ids.data(), 0.01, view(nowhere)), Error);
  take(solver, batch, ids);
  std::vector<WarmStartRecord> records(static_cast<std::size_t>(kEnvs));
  solver.store().records(records);
  for (std::size_t e = 0; e < records.size(); ++e) {
    EXPECT_EQ(records[e].misses, 0) << e;
    EXPECT_EQ(records[e].hits, e == 3 ? 0 : static_cast<Index>(e) + 1) << e;
  }
}

}  // namespace
}  // namespace stiction::test
