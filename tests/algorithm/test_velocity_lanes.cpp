#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "core/algorithm/velocity/evaluate/velocity_result.hpp"
#include "core/algorithm/velocity/lanes/likeness.hpp"
#include "core/algorithm/velocity/solve_pack.hpp"
#include "stiction/residual.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/roomy_jacobians.hpp"
#include "tests/support/velocity_cases.hpp"

/// Newton's method in velocities from inside: packs of every width, with unlike and broken environments in them,
/// against each environment alone.
namespace {

using namespace stiction;
using namespace stiction::test;

/// Memory that is written over before it is used: nothing may be taken from what was there.
template <class Types>
struct Memory {
  std::vector<Offset>& lists_memory;
  std::vector<double>& numbers_memory;

  [[nodiscard]] void* lists(Offset bytes) const {
    lists_memory.assign(static_cast<std::size_t>(bytes) / sizeof(Offset) + 1, -1);
    return lists_memory.data();
  }
  [[nodiscard]] VelocityWorkspace<Types> numbers(const SlotCounts& counts, Index dofs, Index tree_entries) const {
    const auto size = static_cast<std::size_t>(VelocityWorkspace<Types>::doubles(counts, dofs, tree_entries));
    numbers_memory.assign(size + 1, std::numeric_limits<double>::quiet_NaN());
    return VelocityWorkspace<Types>(numbers_memory.data(), counts, dofs, tree_entries);
  }
};

template <class Real>
struct Answers {
  std::vector<Real> lambda, w, velocity;
  std::vector<EnvStatus> status;
  std::vector<std::uint8_t> answered;
};

/// Environments of a batch in the lanes of packs, in that order.
template <class Wide, class Set = DofSet, class Real = Scalar<Wide>>
auto solve_in_packs(const JacobianBatch<Real>& batch, const std::vector<Offset>& order, double tolerance,
                    const JacobianStart<Real>& start = {}) {
  using Types = LaneTypes<Wide, RealTraits<Wide>::kLanes, Set, Real>;
  Answers<Real> answers;
  const JacobianBatchView<Real> view = batch.view();
  answers.lambda.assign(static_cast<std::size_t>(view.row_count), Real(-7));
  answers.w = answers.lambda;
  answers.velocity.assign(static_cast<std::size_t>(view.dof_count), Real(-7));
  answers.status.resize(static_cast<std::size_t>(view.env_count));
  answers.answered.assign(static_cast<std::size_t>(view.env_count), 9);
  VelocityJob<Real> job;
  job.batch = view;
  job.law = view.law;
  job.tolerance = tolerance;
  job.max_iterations = 100;
  job.warm_start = start.reactions;
  job.warm_velocity = start.velocities;
  job.to = {answers.lambda.data(), answers.w.data(), answers.velocity.data(), answers.status.data()};
  job.answered = answers.answered.data();
  std::vector<Offset> lists;
  std::vector<double> numbers;
  for (std::size_t at = 0; at < order.size(); at += Types::kLanes) {
    const auto count = std::min<std::size_t>(Types::kLanes, order.size() - at);
    LaneEnv<Real> members[Types::kLanes];
    VelocityResult results[Types::kLanes];
    for (std::size_t i = 0; i < count; ++i) {
      members[i] = lane_env(view, order[at + i]);
      members[i].result = &results[i];
    }
    solve_pack<Types>(job, members, static_cast<Index>(count), Memory<Types>{lists, numbers});
    for (std::size_t i = 0; i < count; ++i) finish(job, order[at + i], results[i]);
  }
  return answers;
}

/// Chains of unlike length, cones and stiffness: none fits its neighbours' slots or tree.
std::vector<JacobianEnvironment<double>> unlike_environments(MassForm form) {
  std::vector<JacobianEnvironment<double>> envs;
  const std::vector<std::vector<Cone>> cones = {
      {friction(3), unilateral(), friction(3)}, cones_of_every_kind(), {unilateral()}, {box(), box(), free_row()}};
  for (std::uint64_t seed = 0; seed < 24; ++seed) {
    const ChainRecipe recipe{seed + 1, static_cast<Index>(3 + 5 * (seed % 7)), cones[seed % cones.size()], 0.0,
                             seed % 6 == 5 ? 0.0 : 0.01};
    const JacobianEnvironment<double> chain = random_chain(recipe);
    // The factor of every other one has the zeros of its tree.
    envs.push_back(in_form(form == MassForm::factor && seed % 2 == 1 ? reversed(chain) : chain, form));
  }
  return envs;
}
template <class Real>
JacobianBatch<Real> unlike_chains(Law law, MassForm form = MassForm::matrix) {
  JacobianBatch<Real> batch(law, form);
  for (const auto& env : unlike_environments(form)) batch.add(cast<Real>(env));
  return batch;
}

std::vector<Offset> upwards(Offset count) {
  std::vector<Offset> order;
  for (Offset env = 0; env < count; ++env) order.push_back(env);
  return order;
}
std::vector<Offset> shuffled(Offset count) {
  std::vector<Offset> order;
  for (Offset k = 0; k < count; ++k) order.push_back((7 * k + 5) % count);
  return order;
}

template <class Real>
void expect_the_same(const Answers<Real>& expected, const Answers<Real>& actual) {
  EXPECT_EQ(expected.answered, actual.answered);
  EXPECT_TRUE(same_bits(std::span<const Real>(expected.lambda), std::span<const Real>(actual.lambda)));
  EXPECT_TRUE(same_bits(std::span<const Real>(expected.w), std::span<const Real>(actual.w)));
  EXPECT_TRUE(same_bits(std::span<const Real>(expected.velocity), std::span<const Real>(actual.velocity)));
  EXPECT_TRUE(same_bits(std::span<const EnvStatus>(expected.status), std::span<const EnvStatus>(actual.status)));
}

/// Guesses near the answers, some of which are not finite.
template <class Real>
struct Guess {
  std::vector<Real> reactions, velocities;

  Guess(const JacobianBatchView<Real>& batch, const Answers<Real>& answers)
      : reactions(answers.lambda), velocities(answers.velocity) {
    scenes::Rng rng(5);
    const auto disturb = [&](std::vector<Real>& numbers) {
      for (Real& number : numbers) number *= static_cast<Real>(1.0 + rng.symmetric(0.1));
    };
    disturb(reactions);
    disturb(velocities);
    reactions[static_cast<std::size_t>(batch.env_row_offsets[4])] = std::numeric_limits<Real>::infinity();
    velocities[static_cast<std::size_t>(batch.env_dof_offsets[9])] = std::numeric_limits<Real>::quiet_NaN();
  }
};

template <class Wide, class Real = Scalar<Wide>>
void expect_the_bits_of_single_environments(Law law, MassForm form, double tolerance) {
  const auto one_by_one = [&](auto&&... arguments) { return solve_in_packs<Scalar<Wide>, DofSet, Real>(arguments...); };
  const auto in_packs = [&](auto&&... arguments) { return solve_in_packs<Wide, DofSet, Real>(arguments...); };
  const auto batch = unlike_chains<Real>(law, form);
  const auto upward = upwards(batch.env_count());
  const auto cold = one_by_one(batch, upward, tolerance);
  EXPECT_GE(std::count(cold.answered.begin(), cold.answered.end(), 1), law == Law::convex ? 21 : 15)
      << "fewer are solved than were";
  const Guess<Real> guess(batch.view(), cold);
  const Real* const reactions = guess.reactions.data();
  const Real* const velocities = guess.velocities.data();
  for (const JacobianStart<Real>& start :
       {JacobianStart<Real>{}, JacobianStart<Real>{reactions, nullptr}, JacobianStart<Real>{nullptr, velocities},
        JacobianStart<Real>{reactions, velocities}}) {
    SCOPED_TRACE(::testing::Message() << "reactions " << (start.reactions != nullptr) << ", velocities "
                                      << (start.velocities != nullptr));
    const auto expected = one_by_one(batch, upward, tolerance, start);
    expect_the_same(expected, in_packs(batch, upward, tolerance, start));
    expect_the_same(expected, in_packs(batch, shuffled(batch.env_count()), tolerance, start));
    const auto rejected = static_cast<std::uint32_t>(kFlagWarmStartRejected);
    // A sequence of problems reads reactions alone, where there are any.
    const bool reads = start.velocities != nullptr && (law == Law::convex || start.reactions == nullptr);
    EXPECT_EQ(expected.status[9].flags, reads ? rejected : 0U);
  }
}

TEST(VelocityLanes, EveryWidthHasTheBitsOfASingleEnvironment) {
  for (const MassForm form : {MassForm::matrix, MassForm::factor})
    for (const Law law : {Law::convex, Law::coulomb}) {
      SCOPED_TRACE(std::string(to_string(law)) + (form == MassForm::matrix ? ", M" : ", its factor"));
      expect_the_bits_of_single_environments<Pack<double, 2>>(law, form, 1e-8);
      expect_the_bits_of_single_environments<Pack<double, 4>>(law, form, 1e-8);
      expect_the_bits_of_single_environments<Pack<double, 8>>(law, form, 1e-8);
      expect_the_bits_of_single_environments<Pack<float, 4>>(law, form, 1e-4);
      expect_the_bits_of_single_environments<Pack<float, 8>>(law, form, 1e-4);
      expect_the_bits_of_single_environments<Pack<float, 16>>(law, form, 1e-4);
      expect_the_bits_of_single_environments<Pack<double, 2>, float>(law, form, 1e-6);
      expect_the_bits_of_single_environments<Pack<double, 4>, float>(law, form, 1e-6);
      expect_the_bits_of_single_environments<Pack<double, 8>, float>(law, form, 1e-6);
    }
}

// What is judged in double is what a single-precision batch gets: rounding is a part of the residual.
TEST(VelocityLanes, StepsInDoubleSolveWhatSinglePrecisionGets) {
  JacobianBatch<float> batch(Law::convex);
  JacobianBatch<double> exact(Law::convex);
  for (const auto& env : unlike_environments(MassForm::matrix)) {
    batch.add(cast<float>(env));
    exact.add(cast<double>(cast<float>(env)));
  }
  const auto answers = solve_in_packs<double, DofSet, float>(batch, upwards(batch.env_count()), 1e-6);
  const std::vector<double> lambda(answers.lambda.begin(), answers.lambda.end());
  const auto judged = verify(assemble(exact.view()).view(), std::span<const double>(lambda));
  Offset solved = 0;
  for (Offset env = 0; env < batch.env_count(); ++env) {
    const auto e = static_cast<std::size_t>(env);
    if (answers.answered[e] != 1) continue;
    ++solved;
    EXPECT_LE(judged[e].relative, 1e-6 * (1 + 1e-6)) << env;
    EXPECT_NEAR(judged[e].relative, answers.status[e].residual, 1e-12) << env;
  }
  EXPECT_GE(solved, 21);
}

// Two robots take turns. Side by side, each kind fills slots of its own: as many as one environment has cones.
TEST(VelocityLanes, LikeEnvironmentsAreFound) {
  JacobianBatch<double> batch(Law::convex);
  const std::vector<Cone> kinds[] = {{friction(3), unilateral(), friction(3)}, {friction(3), friction(3), friction(4)}};
  constexpr Offset kEnvs = 16;
  for (Offset env = 0; env < kEnvs; ++env) batch.add(random_chain({7, 12, kinds[env % 2]}));
  const auto view = batch.view();
  std::vector<SlotItem<DofSet>> items(3 * kEnvs);
  std::vector<Likeness> keys;
  for (Offset env = 0; env < kEnvs; ++env) {
    const LaneEnv<double> one = lane_env(view, env);
    list_items(view, one, items.data() + 3 * env);
    keys.push_back(likeness_of(items.data() + 3 * env, 3, one.dofs, env >= 12, static_cast<Index>(env)));
  }
  std::sort(keys.begin(), keys.end());
  std::vector<Index> order;
  for (const Likeness& key : keys) order.push_back(key.at);
  const bool first = order[0] % 2 == 1;
  for (std::size_t i = 0; i < 12; ++i) EXPECT_EQ(order[i] % 2 == 1, first == (i < 6)) << "place " << i;
  for (std::size_t i = 12; i < 16; ++i) EXPECT_GE(order[i], 12) << "steps in double come last";

  const SlotItem<DofSet>* members[4];
  const Index cones[4] = {3, 3, 3, 3};
  for (std::size_t l = 0; l < 4; ++l) members[l] = items.data() + 3 * order[l];
  std::vector<Slot<4, DofSet>> slots(12);
  std::vector<unsigned char> columns(static_cast<std::size_t>(column_room<DofSet>(12)));
  EXPECT_EQ((merge_items<4, DofSet>(members, cones, slots.data(), columns.data()).slots), 3);
}

// Rows of a large tree begin where they have entries: what is left out are exact zeros.
TEST(VelocityLanes, LargeSetsHaveTheBitsOfWords) {
  for (const MassForm form : {MassForm::matrix, MassForm::factor}) {
    const auto batch = unlike_chains<double>(Law::convex, form);
    const auto order = shuffled(batch.env_count());
    const auto expected = solve_in_packs<double>(batch, order, 1e-8);
    expect_the_same(expected, solve_in_packs<double, LargeDofSet>(batch, order, 1e-8));
    expect_the_same(expected, solve_in_packs<Pack<double, 4>, LargeDofSet>(batch, order, 1e-8));
  }
}

// A last pivot of three thousandths: the rounding of M's sums is a larger share of it than the tolerance.
TEST(VelocityLanes, AFactorIsSolvedWithAsItIsGiven) {
  JacobianBatch<float> batch(Law::convex, MassForm::factor);
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    auto env = with_factor(random_chain({seed, 8, {friction(3), unilateral(), friction(3)}, 0.7, 1e3}));
    env.M.back() *= 3e-3;
    batch.add(cast<float>(env));
  }
  const auto answers = solve_in_packs<float>(batch, upwards(batch.env_count()), 1e-4);
  EXPECT_EQ(std::count(answers.answered.begin(), answers.answered.end(), 1), 8);
}

TEST(VelocityLanes, ALargeTreeKeepsToItsRoom) {
  const auto tree = std::make_unique<DofTree<LargeDofSet>>();
  Slot<1, LargeDofSet>* const no_slots = nullptr;
  const auto fits = [&](Index dofs, const auto& coupled_of) {
    std::vector<LargeDofSet> coupled(static_cast<std::size_t>(dofs));
    for (Index k = 0; k < dofs; ++k) coupled[static_cast<std::size_t>(k)] = coupled_of(k);
    return build_tree(*tree, dofs, coupled.data(), no_slots, 0);
  };
  const auto dense = [](Index k) { return below<LargeDofSet>(k); };
  EXPECT_TRUE(fits(180, dense)) << "16290 entries";
  EXPECT_FALSE(fits(181, dense)) << "16471";
  // A path of 256 and leaves at its end: each has a list of 257, the first one goes on with the path's.
  const auto comb = [](Index k) { return k == 0 ? LargeDofSet{} : only<LargeDofSet>(k < 256 ? k - 1 : 255); };
  EXPECT_TRUE(fits(256 + 63, comb));
  EXPECT_EQ(tree->entries, 1 + 2 * (255 + 63));
  EXPECT_EQ(tree->path(300)[255], 255);
  EXPECT_EQ(tree->path(300)[256], 300);
  EXPECT_FALSE(fits(256 + 64, comb));
}

// Environments of one size and one pattern go through tiles, the last one's rows up to the end of the arrays.
TEST(VelocityLanes, EnvironmentsOfOneSizeHaveThemToo) {
  for (const MassForm form : {MassForm::matrix, MassForm::factor})
    for (const Index dofs : {6, 21}) {
      JacobianBatch<float> batch(Law::convex, form);
      for (std::uint64_t seed = 0; seed < 8; ++seed)
        batch.add(cast<float>(in_form(reversed(random_chain({1, dofs, cones_of_every_kind()})), form)));
      const auto order = upwards(batch.env_count());
      const auto expected = solve_in_packs<float>(batch, order, 1e-4);
      EXPECT_EQ(std::count(expected.answered.begin(), expected.answered.end(), 1), 8);
      expect_the_same(expected, solve_in_packs<Pack<float, 8>>(batch, order, 1e-4));
    }
}

/// Entries of the tree of an environment without cones.
Index tree_entries(const JacobianEnvironment<double>& env, MassForm form) {
  JacobianBatch<double> batch(Law::convex, form);
  batch.add(in_form(env, form));
  DofSet coupled[kMostVelocityDofs] = {};
  add_mass_dofs(lane_env(batch.view(), 0), coupled);
  const auto tree = std::make_unique<DofTree<DofSet>>();
  Slot<1, DofSet>* const no_slots = nullptr;
  EXPECT_TRUE(build_tree(*tree, static_cast<Index>(env.v_free.size()), coupled, no_slots, 0));
  return tree->entries;
}

TEST(VelocityLanes, AFactorHasTheTreeOfItsMatrix) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    auto chain = random_chain({seed, 40});
    chain.cones.clear();
    for (auto* array : {&chain.J, &chain.mu, &chain.R, &chain.target, &chain.lo, &chain.hi}) array->clear();
    const Index entries = tree_entries(chain, MassForm::matrix);
    EXPECT_LT(entries, 40 * 41 / 2);
    EXPECT_EQ(tree_entries(reversed(chain), MassForm::factor), entries);
  }
}

TEST(VelocityLanes, ABrokenEnvironmentIsLeftAndChangesNoOther) {
  const auto clean = unlike_chains<double>(Law::convex);
  const auto order = shuffled(clean.env_count());
  const auto expected = solve_in_packs<Pack<double, 8>>(clean, order, 1e-8);
  const double infinite = std::numeric_limits<double>::infinity();
  for (int fault = 0; fault < 10; ++fault) {
    SCOPED_TRACE(fault);
    // The last faults are those of a factor.
    const MassForm form = fault < 8 ? MassForm::matrix : MassForm::factor;
    JacobianBatch<double> batch(Law::convex, form);
    for (std::uint64_t seed = 0; seed < 24; ++seed) {
      JacobianEnvironment<double> env = in_form(random_chain({seed + 1, 9}), form);
      if (seed == 11) {
        if (fault == 8) env.M[4 * 9 + 4] = -env.M[4 * 9 + 4];
        if (fault == 9) env.M[4 * 9 + 1] = infinite;
        if (fault == 0) env.J[env.J.size() - 2] = std::numeric_limits<double>::quiet_NaN();
        if (fault == 1) env.M[0] = infinite;
        if (fault == 2) env.M[0] = -1.0;
        if (fault == 3) env.v_free[3] = infinite;
        if (fault == 4) env.R[2] = -1e-3;
        if (fault == 5) env.mu[1] = -0.5;
        if (fault == 6) env.target[0] = infinite;
        if (fault == 7) env.J.assign(env.J.size(), 1e200);
      }
      batch.add(env);
    }
    JacobianBatch<double> sound(Law::convex, form);
    for (std::uint64_t seed = 0; seed < 24; ++seed) sound.add(in_form(random_chain({seed + 1, 9}), form));
    auto with_fault = solve_in_packs<Pack<double, 8>>(batch, order, 1e-8);
    auto without = solve_in_packs<Pack<double, 8>>(sound, order, 1e-8);
    EXPECT_EQ(with_fault.answered[11], 0);
    // Of what is not solved nothing is written.
    const auto view = batch.view();
    for (Offset row = view.env_row_offsets[11]; row < view.env_row_offsets[12]; ++row) {
      EXPECT_EQ(with_fault.lambda[static_cast<std::size_t>(row)], -7.0);
      with_fault.lambda[static_cast<std::size_t>(row)] = without.lambda[static_cast<std::size_t>(row)];
      with_fault.w[static_cast<std::size_t>(row)] = without.w[static_cast<std::size_t>(row)];
    }
    for (Offset k = view.env_dof_offsets[11]; k < view.env_dof_offsets[12]; ++k)
      with_fault.velocity[static_cast<std::size_t>(k)] = without.velocity[static_cast<std::size_t>(k)];
    with_fault.answered[11] = without.answered[11];
    with_fault.status[11] = without.status[11];
    expect_the_same(without, with_fault);
  }
  EXPECT_GE(std::count(expected.answered.begin(), expected.answered.end(), 1), 20);
}

}  // namespace
