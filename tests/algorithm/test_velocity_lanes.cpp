#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "core/algorithm/velocity/lanes/likeness.hpp"
#include "stiction/residual.hpp"
#include "tests/support/machines/velocity_packs.hpp"
#include "tests/support/systems/roomy_jacobians.hpp"
#include "tests/support/systems/velocity_cases.hpp"

/// Newton's method in velocities from inside: the library's packs of every width, with unlike and broken environments
/// in them, against each environment alone.
namespace {

using namespace stiction;
using namespace stiction::test;

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

template <class Number, class Real = Number>
void expect_the_bits_of_single_environments(Law law, MassForm form, double tolerance) {
  const auto batch = unlike_chains<Real>(law, form);
  const auto upward = upwards(batch.env_count());
  const auto cold = solve_one_by_one(batch, upward, tolerance);
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
    const auto expected = solve_one_by_one(batch, upward, tolerance, start);
    for (const cpu::Isa* isa : builds_with_packs()) {
      SCOPED_TRACE(isa->name);
      expect_the_same(expected, solve_in_packs<Number>(*isa, batch, upward, tolerance, start));
      expect_the_same(expected, solve_in_packs<Number>(*isa, batch, shuffled(batch.env_count()), tolerance, start));
    }
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
      expect_the_bits_of_single_environments<double>(law, form, 1e-8);
      expect_the_bits_of_single_environments<float>(law, form, 1e-4);
      expect_the_bits_of_single_environments<double, float>(law, form, 1e-6);
    }
}

// A single-precision batch gets the residual in double: rounding is a part of it.
TEST(VelocityLanes, StepsInDoubleSolveWhatSinglePrecisionGets) {
  JacobianBatch<float> batch(Law::convex);
  JacobianBatch<double> exact(Law::convex);
  for (const auto& env : unlike_environments(MassForm::matrix)) {
    batch.add(cast<float>(env));
    exact.add(cast<double>(cast<float>(env)));
  }
  const auto answers = solve_one_by_one(batch, upwards(batch.env_count()), 1e-6);
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

/// Unilateral rows at single degrees of freedom, a few of which M couples: islands of every size. Approaches are from
/// 0.001 to 1.
JacobianEnvironment<double> loosely_coupled(std::uint64_t seed) {
  constexpr std::size_t kDofs = 8;
  scenes::Rng rng(seed);
  JacobianEnvironment<double> env;
  env.M.assign(kDofs * kDofs, 0.0);
  for (std::size_t k = 0; k < kDofs; ++k) {
    env.M[k * kDofs + k] = 3.0;
    for (std::size_t j = 0; j < k; ++j)
      if (rng.uniform(0.0, 1.0) < 0.25) env.M[k * kDofs + j] = env.M[j * kDofs + k] = rng.symmetric(0.4);
    env.v_free.push_back(-std::pow(10.0, rng.uniform(-3.0, 0.0)));
    if (rng.uniform(0.0, 1.0) < 0.4) continue;
    env.cones.push_back(unilateral());
    env.R.push_back(0.01 * rng.uniform(1.0, 3.0));
    for (auto* zeros : {&env.mu, &env.target, &env.lo, &env.hi}) zeros->push_back(0.0);
    for (std::size_t j = 0; j < kDofs; ++j) env.J.push_back(j == k ? rng.uniform(0.5, 1.0) : 0.0);
  }
  return env;
}

// verify() reads islands off A. Rows of M lead to them in any order, also where parents are not coupled.
TEST(VelocityLanes, IslandsReachAsFarAsMCouples) {
  JacobianBatch<float> batch(Law::convex);
  JacobianBatch<double> exact(Law::convex);
  for (std::uint64_t seed = 1; seed <= 256; ++seed) {
    const auto env = cast<float>(loosely_coupled(seed));
    batch.add(env);
    exact.add(cast<double>(env));
  }
  const auto order = upwards(batch.env_count());
  const auto answers = solve_one_by_one(batch, order, 1e-5);
  const std::vector<double> lambda(answers.lambda.begin(), answers.lambda.end());
  const auto judged = verify(assemble(exact.view()).view(), std::span<const double>(lambda));
  for (std::size_t env = 0; env < judged.size(); ++env) {
    EXPECT_EQ(answers.answered[env], 1);
    EXPECT_NEAR(judged[env].relative, answers.status[env].residual, 1e-12) << env;
  }
  for (const cpu::Isa* isa : builds_with_packs()) {
    SCOPED_TRACE(isa->name);
    expect_the_same(answers, solve_in_packs<double>(*isa, batch, order, 1e-5));
  }
}

// Two robots take turns. Side by side, each kind fills slots of its own: as many as one environment has cones.
TEST(VelocityLanes, LikeEnvironmentsAreFound) {
  const std::vector<Cone> edges(4, unilateral());  // of a pyramid at the last link
  const ChainRecipe kinds[][2] = {
      {{7, 12, {friction(3), unilateral(), friction(3)}}, {7, 12, {friction(3), friction(3), friction(4)}}},
      {{7, 12, edges, 0.95}, {8, 12, edges, 0.95}}};
  constexpr Offset kEnvs = 16;
  for (const auto& robots : kinds) {
    JacobianBatch<double> batch(Law::convex);
    for (Offset env = 0; env < kEnvs; ++env) batch.add(random_chain(robots[env % 2]));
    const auto view = batch.view();
    const auto each = static_cast<Index>(robots[0].cones.size());
    std::vector<SlotItem<DofSet>> items(static_cast<std::size_t>(each * kEnvs));
    std::vector<Likeness> keys;
    SerialTeam alone;
    for (Offset env = 0; env < kEnvs; ++env) {
      const LaneEnv<double> one = lane_env(view, env);
      SlotItem<DofSet>* const own = items.data() + each * env;
      list_items(alone, view, one, own);
      keys.push_back(likeness_of(own, each, one.dofs, env >= 12, static_cast<Index>(env)));
    }
    std::sort(keys.begin(), keys.end());
    std::vector<Index> order;
    for (const Likeness& key : keys) order.push_back(key.at);
    const bool first = order[0] % 2 == 1;
    for (std::size_t i = 0; i < 12; ++i) EXPECT_EQ(order[i] % 2 == 1, first == (i < 6)) << "place " << i;
    for (std::size_t i = 12; i < 16; ++i) EXPECT_GE(order[i], 12) << "steps in double come last";

    const SlotItem<DofSet>* members[4];
    const Index cones[4] = {each, each, each, each};
    for (std::size_t l = 0; l < 4; ++l) members[l] = items.data() + each * order[l];
    std::vector<Slot<4, DofSet>> slots(static_cast<std::size_t>(4 * each));
    std::vector<unsigned char> columns(static_cast<std::size_t>(column_room<DofSet>(4 * each)));
    EXPECT_EQ((merge_items<4, DofSet>(members, cones, slots.data(), columns.data()).slots), each);
  }
}

// Rows of a large tree begin where they have entries: those left out are exact zeros.
TEST(VelocityLanes, LargeSetsHaveTheBitsOfWords) {
  for (const MassForm form : {MassForm::matrix, MassForm::factor}) {
    const auto batch = unlike_chains<double>(Law::convex, form);
    const auto order = shuffled(batch.env_count());
    const auto expected = solve_one_by_one(batch, order, 1e-8);
    expect_the_same(expected, solve_with_large_sets(batch, order, 1e-8));
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
  const auto answers = solve_one_by_one(batch, upwards(batch.env_count()), 1e-4);
  EXPECT_EQ(std::count(answers.answered.begin(), answers.answered.end(), 1), 8);
}

TEST(VelocityLanes, ALargeTreeKeepsToItsRoom) {
  const auto tree = std::make_unique<DofTree<LargeDofSet>>();
  Slot<1, LargeDofSet>* const no_slots = nullptr;
  const auto fits = [&](Index dofs, const auto& coupled_of) {
    std::vector<LargeDofSet> coupled(static_cast<std::size_t>(dofs));
    for (Index k = 0; k < dofs; ++k) coupled[static_cast<std::size_t>(k)] = coupled_of(k);
    SerialTeam alone;
    return build_tree(alone, *tree, dofs, coupled.data(), no_slots, 0);
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
      const auto expected = solve_one_by_one(batch, order, 1e-4);
      EXPECT_EQ(std::count(expected.answered.begin(), expected.answered.end(), 1), 8);
      for (const cpu::Isa* isa : builds_with_packs()) {
        SCOPED_TRACE(isa->name);
        expect_the_same(expected, solve_in_packs<float>(*isa, batch, order, 1e-4));
      }
    }
}

/// Entries of the tree of an environment without cones.
Index tree_entries(const JacobianEnvironment<double>& env, MassForm form) {
  JacobianBatch<double> batch(Law::convex, form);
  batch.add(in_form(env, form));
  DofSet coupled[kMostVelocityDofs] = {};
  SerialTeam alone;
  add_mass_dofs(alone, lane_env(batch.view(), 0), coupled);
  const auto tree = std::make_unique<DofTree<DofSet>>();
  Slot<1, DofSet>* const no_slots = nullptr;
  EXPECT_TRUE(build_tree(alone, *tree, static_cast<Index>(env.v_free.size()), coupled, no_slots, 0));
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

/// A chain of a batch in which one may be broken, in one of ten ways; the last two are those of a factor.
constexpr int kFaults = 10;
MassForm form_of(int fault) {
  return fault < 8 ? MassForm::matrix : MassForm::factor;
}
JacobianEnvironment<double> chain_with(int fault, std::uint64_t seed, bool is_broken) {
  JacobianEnvironment<double> env = in_form(random_chain({seed + 1, 9}), form_of(fault));
  if (!is_broken) return env;
  const double infinite = std::numeric_limits<double>::infinity();
  if (fault == 0) env.J[env.J.size() - 2] = std::numeric_limits<double>::quiet_NaN();
  if (fault == 1) env.M[0] = infinite;
  if (fault == 2) env.M[0] = -1.0;
  if (fault == 3) env.v_free[3] = infinite;
  if (fault == 4) env.R[2] = -1e-3;
  if (fault == 5) env.mu[1] = -0.5;
  if (fault == 6) env.target[0] = infinite;
  if (fault == 7) env.J.assign(env.J.size(), 1e200);
  if (fault == 8) env.M[4 * 9 + 4] = -env.M[4 * 9 + 4];
  if (fault == 9) env.M[4 * 9 + 1] = infinite;
  return env;
}

TEST(VelocityLanes, ABrokenEnvironmentIsLeftAndChangesNoOther) {
  const auto order = shuffled(24);
  for (const cpu::Isa* isa : builds_with_packs())
    for (int fault = 0; fault < kFaults; ++fault) {
      SCOPED_TRACE(::testing::Message() << isa->name << ", fault " << fault);
      JacobianBatch<double> batch(Law::convex, form_of(fault)), sound(Law::convex, form_of(fault));
      for (std::uint64_t seed = 0; seed < 24; ++seed) {
        batch.add(chain_with(fault, seed, seed == 11));
        sound.add(chain_with(fault, seed, false));
      }
      auto with_fault = solve_in_packs<double>(*isa, batch, order, 1e-8);
      const auto without = solve_in_packs<double>(*isa, sound, order, 1e-8);
      EXPECT_GE(std::count(without.answered.begin(), without.answered.end(), 1), 20);
      EXPECT_EQ(with_fault.answered[11], 0);
      // Nothing is written of an unsolved environment.
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
}

}  // namespace
