#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "core/job/body_job.hpp"
#include "cpu_fallback/pack/work_items.hpp"
#include "scenes/body_scenes.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/machines/scoped_isa.hpp"
#include "tests/support/systems/body_systems.hpp"

/// Body environments in the lanes of packs against each of them in a separate call, which no pack takes.
namespace stiction::test {

namespace {

/// Two bodies without masses touch: a contact that cannot move.
template <class Real>
void make_immovable(BodyEnvironment<Real>& env) {
  for (std::size_t body : {0U, 1U}) {
    env.bodies[body].inv_mass = 0;
    env.bodies[body].inv_inertia = {};
  }
  env.contacts[0].body_a = 0;
  env.contacts[0].body_b = 1;
}

/// Impulses beyond all numbers.
template <class Real>
void make_too_heavy(BodyEnvironment<Real>& env) {
  for (auto& body : env.bodies) {
    body.inv_mass = 10 * std::numeric_limits<Real>::min();
    body.inv_inertia = {};
    body.twist = {100, -100, 100};
    body.kinematic = false;
  }
}

/// Nothing moves and nothing is to move.
template <class Real>
void put_to_rest(BodyEnvironment<Real>& env) {
  for (auto& body : env.bodies) body.twist = body.twist_change = {};
  for (auto& contact : env.contacts) contact.depth = 0;
}

/// Sizes that make lanes wait, leave early and be taken again. A few have lanes that all push the same bodies; a few
/// are refused, or end otherwise than their neighbours.
template <class Real>
std::vector<BodyEnvironment<Real>> crowd() {
  std::vector<BodyEnvironment<Real>> envs;
  for (std::uint64_t seed = 0; seed < 45; ++seed)
    envs.push_back(
        as<Real>(random_bodies(seed, 2 + static_cast<Index>(seed % 9), 1 + static_cast<Index>((7 * seed) % 40))));
  for (std::uint64_t seed = 0; seed < 40; ++seed) envs.push_back(as<Real>(scenes::make_body_stack(seed, 3)));
  envs.push_back({});
  envs[13].contacts[0].mu = -1;  // refused while its neighbours go on
  make_immovable(envs[17]);
  put_to_rest(envs[21]);
  put_to_rest(envs[60]);
  make_too_heavy(envs[25]);
  return envs;
}

struct Setting {
  Law law;
  bool momentum;
  Index substeps;
  double tolerance;
  bool warm;
  BlockMode blocks = BlockMode::cones;
};

constexpr Setting kSettings[] = {{Law::coulomb, true, 1, 1e-3, false},
                                 {Law::coulomb, false, 3, 0, true},
                                 {Law::convex, true, 2, 1e-5, true},
                                 {Law::convex, false, 1, 1e-2, false},
                                 {kBoxFriction, true, 2, 1e-4, true},
                                 {kBoxFriction, false, 1, 1e-3, false},
                                 {Law::coulomb, true, 1, 1e-3, true, BlockMode::pairs},
                                 {Law::convex, false, 2, 1e-4, false, BlockMode::pairs},
                                 {kBoxFriction, true, 1, 0, false, BlockMode::pairs}};

template <class Real>
void expect_packs_change_nothing(const Setting& setting) {
  const auto envs = crowd<Real>();
  const auto batch = batch_of<Real>(envs);
  const auto view = batch.view();
  BodySolverOptions options;
  options.box_friction = setting.law == kBoxFriction;
  if (!options.box_friction) options.law = setting.law;
  options.momentum = setting.momentum;
  options.substeps = setting.substeps;
  options.tolerance = setting.tolerance;
  options.blocks = setting.blocks;
  options.iterations = 41;  // chunks of 16, 16 and 9
  options.threads = 1;
  options.invalid = InvalidPolicy::isolate;
  std::vector<Real> warm;
  if (setting.warm)
    for (Offset i = 0; i < 3 * view.contact_count; ++i) warm.push_back(static_cast<Real>(i % 5) * Real(0.125));
  if (setting.warm)
    warm[static_cast<std::size_t>(3 * view.env_contact_offsets[29])] = std::numeric_limits<Real>::quiet_NaN();
  const auto together = solve_bodies(batch, {}, options, Device::cpu(), std::span<const Real>(warm));
  EXPECT_EQ(together.status[17].flags & kFlagBadDiagonal, 0U);
  EXPECT_EQ((together.status[29].flags & kFlagWarmStartRejected) != 0, setting.warm);
  EXPECT_EQ(together.status[21].residual_absolute, 0.0);
  // Boxed friction has impulses that single precision still holds, and finds them.
  if (sizeof(Real) == sizeof(double) || !options.box_friction) {
    EXPECT_NE(together.status[25].code, EnvCode::solved);
  }
  for (Offset env = 0; env < view.env_count; ++env) {
    const auto one = batch_of<Real>({envs[static_cast<std::size_t>(env)]});
    const auto contact = static_cast<std::size_t>(3 * view.env_contact_offsets[env]);
    const auto body = static_cast<std::size_t>(6 * view.env_body_offsets[env]);
    const auto own =
        warm.empty() ? std::span<const Real>()
                     : std::span<const Real>(warm).subspan(contact, static_cast<std::size_t>(3 * one.contact_count()));
    const auto alone = solve_bodies(one, {}, options, Device::cpu(), own);
    const auto same = [](const std::vector<Real>& part, const std::vector<Real>& all, std::size_t first) {
      return same_bits(std::span<const Real>(part), std::span<const Real>(all).subspan(first, part.size()));
    };
    EXPECT_TRUE(same(alone.impulse, together.impulse, contact)) << env;
    EXPECT_TRUE(same(alone.twist, together.twist, body)) << env;
    EXPECT_TRUE(same(alone.w, together.w, contact)) << env;
    EXPECT_TRUE(same_bits(std::span<const EnvStatus>(alone.status),
                          std::span<const EnvStatus>(together.status).subspan(static_cast<std::size_t>(env), 1)))
        << env;
  }
}

}  // namespace

TEST(BodyPacks, AnEnvironmentHasTheBitsOfACallOfItsOwn) {
  for (const char* name : usable_isas()) {
    const ScopedIsa isa(name);
    for (const Setting& setting : kSettings) {
      SCOPED_TRACE(std::string(name) + ", law " + std::to_string(static_cast<int>(setting.law)) + ", " +
                   to_string(setting.blocks));
      expect_packs_change_nothing<float>(setting);
      expect_packs_change_nothing<double>(setting);
    }
  }
}

TEST(BodyPacks, EveryEnvironmentIsDealtOnceAndPacksHoldLikeSizes) {
  BodyPlanData plan;
  plan.kept = {40, 0, 5000, 41, 3, 42, 39, 2, 38, 3, 700};
  std::vector<Offset> bodies{0};
  std::vector<Offset> contacts{0};
  for (std::size_t env = 0; env < plan.kept.size(); ++env) {
    bodies.push_back(bodies.back() + 5 + static_cast<Offset>(env));
    contacts.push_back(contacts.back() + plan.kept[env]);
  }
  plan.sides.assign(static_cast<std::size_t>(2 * contacts.back()), 0);
  const auto bytes = [](const cpu::PackShape& room) { return Offset{room.contacts} * 3000; };
  const cpu::BodyWorkItems deal = cpu::make_work_items(plan, bodies.data(), contacts.data(), {2, 4, bytes});
  EXPECT_EQ(deal.large, std::vector<Offset>{2});
  std::vector<int> seen(plan.kept.size());
  std::vector<bool> packed(plan.kept.size());
  for (const cpu::WorkItem<cpu::PackShape>& work : deal.items)
    for (const Offset env : work.envs) {
      const auto e = static_cast<std::size_t>(env);
      ++seen[e];
      packed[e] = work.packed;
      if (!work.packed) continue;
      EXPECT_LE(plan.kept[e], work.shape.contacts);
      EXPECT_LE(bodies[e + 1] - bodies[e], work.shape.bodies);
      EXPECT_LE(work.shape.contacts, 2 * plan.kept[e]);
    }
  EXPECT_EQ(seen, (std::vector<int>{1, 1, 0, 1, 1, 1, 1, 1, 1, 1, 1}));
  // The five of some forty contacts share a pack; one without contacts or too large for one has none.
  for (const std::size_t e : {0U, 3U, 5U, 6U, 8U}) EXPECT_TRUE(packed[e]) << e;
  for (const std::size_t e : {1U, 10U}) EXPECT_FALSE(packed[e]) << e;
}

TEST(BodyPacks, EnvironmentsWhoseContactsAreBetweenTheSameBodiesComeTogether) {
  BodyPlanData plan;
  std::vector<Offset> bodies{0};
  std::vector<Offset> contacts{0};
  for (int env = 0; env < 12; ++env) {
    plan.kept.push_back(2);
    plan.sides.insert(plan.sides.end(), env % 3 == 0 ? std::initializer_list<Index>{~2, 0, 0, 1}
                                                     : std::initializer_list<Index>{~2, 1, 1, 0});
    bodies.push_back(bodies.back() + 2);
    contacts.push_back(contacts.back() + 2);
  }
  const auto bytes = [](const cpu::PackShape&) { return Offset{1}; };
  const cpu::BodyWorkItems deal = cpu::make_work_items(plan, bodies.data(), contacts.data(), {1, 4, bytes});
  ASSERT_EQ(deal.items.size(), 1U);
  int changes = 0;
  for (std::size_t k = 1; k < deal.items[0].envs.size(); ++k)
    changes += (deal.items[0].envs[k] % 3 == 0) != (deal.items[0].envs[k - 1] % 3 == 0) ? 1 : 0;
  EXPECT_EQ(changes, 1);
}

}  // namespace stiction::test
