#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>

#include "stiction/jacobian_solver.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/error_message.hpp"
#include "tests/support/machines/every_solver.hpp"
#include "tests/support/systems/jacobian_systems.hpp"
#include "tests/support/systems/small_systems.hpp"

/// A solver for each environment by its spectrum. Bits are those of the environment solved alone by the solver that the
/// rules name, and by auto from there if it is not solved.
namespace {

using namespace stiction;
using namespace stiction::test;
using ::testing::HasSubstr;

template <class Real>
class SpectrumChoice : public testing::Test {};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(SpectrumChoice, Precisions);

SolverOptions by_spectrum(double tolerance = 1e-3, Index max_iterations = 60) {
  SolverOptions o = options(SolverKind::npgs, tolerance, max_iterations);
  o.choose = SolverChoice::spectrum;
  return o;
}

/// Environments of every class: scenes are badly conditioned, sparse or not, and two contacts are not.
template <class Real>
ContactBatch<Real> mixed_batch() {
  ContactBatch<double> batch = up_to(ragged_batch(2, 5), 200);
  batch.add(contact({2, 3, 3}, {-1, 0.1, 2}, 0.5));
  batch.add(contact({500, 1, 1}, {-1, 0.1, 2}, 0.5));
  return convert<Real>(batch);
}

template <class Real>
Solution<Real> alone(const ContactBatch<Real>& batch, Offset env, SolverOptions o, const SpectrumRules& rules) {
  const ContactBatch<Real> one = gather<Real>(batch, std::array{env});
  const SpectrumClass found = classify(estimate_spectrum(one.view(), 0, rules.steps), rules);
  o.choose = SolverChoice::named;
  o.solver = rules.solver_of(found);
  o.islands = found == SpectrumClass::decomposed ? IslandMode::apart : IslandMode::together;
  o.invalid = InvalidPolicy::isolate;
  Solution<Real> first = solve(one, o);
  if (first.status[0].code == EnvCode::solved) return first;
  o.solver = SolverKind::automatic;
  o.islands = IslandMode::together;
  return solve(one, o, Device::cpu(), std::span<const Real>(first.lambda));
}

TYPED_TEST(SpectrumChoice, AnEnvironmentHasTheBitsOfTheSolverThatTheRulesName) {
  using Real = TypeParam;
  const ContactBatch<Real> batch = mixed_batch<Real>();
  SolverOptions o = by_spectrum();
  o.invalid = InvalidPolicy::isolate;
  o.spectrum.sparse_density = 0.4;
  const Solution<Real> whole = solve(batch, o);
  std::array<int, kSpectrumClasses> classes{};
  int left_to_auto = 0;
  for (Offset env = 0; env < batch.env_count(); ++env) {
    SCOPED_TRACE(env);
    const SpectrumClass found = classify(estimate_spectrum(batch.view(), env), o.spectrum);
    ++classes[static_cast<std::size_t>(found)];
    const Solution<Real> expected = alone(batch, env, o, o.spectrum);
    const auto e = static_cast<std::size_t>(env);
    EXPECT_TRUE(same_bits(std::span<const EnvStatus>(expected.status), std::span(whole.status).subspan(e, 1)));
    const auto row = static_cast<std::size_t>(batch.view().env_row_offsets[env]);
    const auto part = [&](const std::vector<Real>& all) { return std::span(all).subspan(row, expected.lambda.size()); };
    EXPECT_TRUE(same_bits(std::span<const Real>(expected.lambda), part(whole.lambda)));
    EXPECT_TRUE(same_bits(std::span<const Real>(expected.w), part(whole.w)));
    left_to_auto += whole.status[e].solver != o.spectrum.solver_of(found) ? 1 : 0;
  }
  EXPECT_THAT(classes, ::testing::Each(::testing::Gt(0))) << "these environments cannot tell the classes apart";
  EXPECT_GT(left_to_auto, 0);
}

TYPED_TEST(SpectrumChoice, ThreadsAndOrderReachNoBit) {
  using Real = TypeParam;
  const ContactBatch<Real> batch = mixed_batch<Real>();
  SolverOptions o = by_spectrum();
  o.invalid = InvalidPolicy::isolate;
  const Solution<Real> expected = solve(batch, o);
  o.threads = 3;
  EXPECT_TRUE(same_bits(expected, solve(batch, o)));
  std::vector<Offset> backwards(expected.status.size());
  std::iota(backwards.rbegin(), backwards.rend(), Offset{0});
  std::vector<EnvStatus> status = solve(gather<Real>(batch, backwards), o).status;
  std::reverse(status.begin(), status.end());
  EXPECT_TRUE(same_bits(std::span<const EnvStatus>(expected.status), std::span<const EnvStatus>(status)));
}

TYPED_TEST(SpectrumChoice, ABrokenEnvironmentChangesNoOther) {
  using Real = TypeParam;
  const ContactBatch<Real> sound = mixed_batch<Real>();
  auto arrays = sound.arrays();
  const Offset broken = 1, row = arrays.env_row_offsets[broken];
  ASSERT_GT(arrays.env_row_offsets[broken + 1], row);
  arrays.b[static_cast<std::size_t>(row)] = std::numeric_limits<Real>::quiet_NaN();
  SolverOptions o = by_spectrum();
  o.invalid = InvalidPolicy::isolate;
  const Solution<Real> expected = solve(sound, o);
  const Solution<Real> found = solve(ContactBatch<Real>::from_arrays(sound.law(), arrays), o);
  for (std::size_t env = 0; env < found.status.size(); ++env) {
    if (static_cast<Offset>(env) == broken)
      EXPECT_EQ(found.status[env].code, EnvCode::invalid_input);
    else
      EXPECT_TRUE(same_bits(std::span(expected.status).subspan(env, 1), std::span(found.status).subspan(env, 1)));
  }
  o.invalid = InvalidPolicy::reject;
  EXPECT_THAT(error_message([&] { (void)solve(ContactBatch<Real>::from_arrays(sound.law(), arrays), o); }),
              HasSubstr("b[env 1"));
}

TEST(ChoiceBySpectrum, PaddedRowsThatAreNotInUseStayTheCallers) {
  const ContactBatch<double> batch =
      batch_of({contact({2, 2, 2}, {-1, 0.1, 0}, 0.5), contact({1, 3, 3}, {-1, 2, 0}, 1)});
  auto arrays = batch.arrays();
  ContactBatchView<double> view = batch.view();
  const std::array<Index, 2> rows{0, 3}, cones{0, 1};
  view.env_row_counts = rows.data();
  view.env_cone_counts = cones.data();
  std::vector<double> lambda(6, 77), w(6, 77);
  std::vector<EnvStatus> status(2);
  const Solver solver(Device::cpu(), by_spectrum(1e-9));
  solver.solve(view, {lambda.data(), w.data(), status.data()});
  EXPECT_EQ(lambda[0], 77);
  EXPECT_EQ(w[2], 77);
  EXPECT_EQ(status[1].code, EnvCode::solved);
  EXPECT_NE(lambda[3], 77);
}

TEST(ChoiceBySpectrum, PlacesInASharedMuAreReadWhereThereIsFriction) {
  Environment<double> env = system({unilateral(), friction(3)}, diagonal({2, 2, 2, 2}), {-1, -1, 0.1, 2});
  env.mu = {0, 0, 0.5, 0.5};
  const ContactBatch<double> batch = batch_of({env});
  const std::vector<double> mu{0.5};
  const Offset nowhere = std::numeric_limits<Offset>::max() / 2;
  const std::array<Offset, 4> places{nowhere, -nowhere, 0, 0};
  ContactBatchView<double> view = batch.view();
  view.mu = mu.data();
  view.mu_offsets = places.data();
  view.mu_count = 1;
  std::vector<double> lambda(4);
  EnvStatus status{};
  Solver(Device::cpu(), by_spectrum(1e-9)).solve(view, {lambda.data(), nullptr, &status});
  EXPECT_EQ(lambda, solve(batch, by_spectrum(1e-9)).lambda);
}

/// Two rows of condition 1 or 1e4, which rules send to npgs or to jacobi.
ContactBatch<double> of_condition(double condition, double coupling = 0) {
  return batch_of({system({unilateral(), unilateral()}, {condition, coupling, coupling, 1}, {-1, -1})});
}
SolverOptions keeping(bool keep) {
  SolverOptions o = by_spectrum(1e-6);
  o.spectrum.direct = SolverKind::npgs;
  o.spectrum.otherwise = SolverKind::jacobi;
  o.spectrum.keep = keep;
  return o;
}

TEST(ChoiceBySpectrum, AClassIsKeptWhereAskedForWhileTheStructureStays) {
  for (const bool keep : {false, true}) {
    const Solver solver(Device::cpu(), keeping(keep));
    const auto answered = [&](const ContactBatch<double>& batch) {
      std::vector<double> lambda(2);
      EnvStatus status{};
      solver.solve(batch.view(), {lambda.data(), nullptr, &status});
      EXPECT_EQ(status.code, EnvCode::solved);
      return status.solver;
    };
    EXPECT_EQ(answered(of_condition(1)), SolverKind::npgs);
    EXPECT_EQ(answered(of_condition(1e4)), keep ? SolverKind::npgs : SolverKind::jacobi);
    EXPECT_EQ(answered(of_condition(1e4, 0.1)), SolverKind::jacobi) << "entries came to it";
  }
}

TEST(ChoiceBySpectrum, WhereNothingIsToBeSolvedAllIterationsAreOfTheSolverNamed) {
  SolverOptions o = keeping(false);
  o.tolerance = 0;
  o.max_iterations = 7;
  const Solution<double> found = solve(of_condition(1), o);
  EXPECT_EQ(found.status[0].solver, SolverKind::npgs);
  EXPECT_EQ(found.status[0].iterations, 7);
}

TEST(ChoiceBySpectrum, BatchesInDeviceMemoryAreRefused) {
  const ContactBatch<double> batch = of_condition(1);
  ContactBatchView<double> view = batch.view();
  view.space = MemorySpace::cuda;
  std::vector<double> lambda(2);
  EnvStatus status{};
  const Solver solver(Device::emulated(), by_spectrum());
  EXPECT_THAT(error_message([&] { solver.solve(view, {lambda.data(), nullptr, &status}); }), HasSubstr("to_host"));
  const Solution<double> there = solve(batch, by_spectrum(), Device::emulated());
  EXPECT_TRUE(same_bits(solve(batch, by_spectrum()), there));
}

TEST(ChoiceBySpectrum, BatchesOfJAndMAreChosenForByTheirA) {
  JacobianBatch<double> batch;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) batch.add(random_jacobian({.seed = seed}));
  const Solution<double> expected = solve(assemble(batch.view()), by_spectrum(1e-8));
  const JacobianSolution<double> found = solve(batch, by_spectrum(1e-8));
  EXPECT_TRUE(same_bits(expected, found.contact));
  EXPECT_EQ(found.contact.status[0].code, EnvCode::solved);
}

}  // namespace
