#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <utility>
#include <vector>

#include "core/plan/body_plan.hpp"
#include "scenes/body_scenes.hpp"
#include "tests/support/systems/body_systems.hpp"

namespace stiction::test {

namespace {

using Env = BodyEnvironment<double>;

/// Everything a plan promises about one environment that is the only one of its batch.
void expect_sound(const Env& env, const BodyPlanData& plan) {
  const auto contacts = static_cast<Index>(env.contacts.size());
  const auto pushed = [&](Index body) { return body >= 0 && !env.bodies[static_cast<std::size_t>(body)].kinematic; };
  std::set<Index> seen;
  ASSERT_EQ(
      plan.vertex_offsets[static_cast<std::size_t>(plan.color_offsets[static_cast<std::size_t>(plan.color_count[0])])],
      contacts);
  for (Index color = 0; color < plan.color_count[0]; ++color) {
    std::set<Index> busy;
    const Index first = plan.color_offsets[static_cast<std::size_t>(color)];
    const Index last = plan.color_offsets[static_cast<std::size_t>(color) + 1];
    EXPECT_LT(first, last) << "an empty colour";
    for (Index v = first; v < last; ++v) {
      const Index begin = plan.vertex_offsets[static_cast<std::size_t>(v)];
      const Index end = plan.vertex_offsets[static_cast<std::size_t>(v) + 1];
      EXPECT_LE(end - begin, kManifoldContacts);
      std::set<Index> bodies;
      for (Index p = begin; p < end; ++p) {
        const Index c = plan.contact_order[static_cast<std::size_t>(p)];
        EXPECT_TRUE(seen.insert(c).second) << "contact " << c << " twice";
        const auto& contact = env.contacts[static_cast<std::size_t>(c)];
        for (const auto& [body, side] : {std::pair(contact.body_a, plan.sides[2 * static_cast<std::size_t>(p)]),
                                         std::pair(contact.body_b, plan.sides[2 * static_cast<std::size_t>(p) + 1])}) {
          EXPECT_EQ(side >= 0, pushed(body));
          EXPECT_EQ(side >= 0 ? side : ~side, body < 0 ? static_cast<Index>(env.bodies.size()) : body);
          if (pushed(body)) bodies.insert(body);
        }
      }
      EXPECT_LE(bodies.size(), 2U);
      for (const Index body : bodies) EXPECT_TRUE(busy.insert(body).second) << "body " << body << " twice in a colour";
    }
  }
  EXPECT_EQ(static_cast<Index>(seen.size()), contacts);

  // Bodies list their own contacts, in order of position.
  for (std::size_t body = 0; body < env.bodies.size(); ++body) {
    std::vector<Index> expected;
    if (pushed(static_cast<Index>(body)))
      for (Index p = 0; p < contacts; ++p) {
        const auto& contact = env.contacts[static_cast<std::size_t>(plan.contact_order[static_cast<std::size_t>(p)])];
        if (contact.body_a == static_cast<Index>(body)) expected.push_back(~p);
        if (contact.body_b == static_cast<Index>(body)) expected.push_back(p);
      }
    EXPECT_EQ(expected, std::vector<Index>(plan.body_contacts.begin() + plan.body_offsets[body],
                                           plan.body_contacts.begin() + plan.body_offsets[body + 1]))
        << "body " << body;
  }
}

}  // namespace

TEST(BodyPlan, ColoursNeverPushABodyTwice) {
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    const Env env = random_bodies(seed, 2 + static_cast<Index>(seed % 9), static_cast<Index>(seed % 40));
    SCOPED_TRACE(seed);
    expect_sound(env, make_body_plan(batch_of<double>({env}).view(), 0));
  }
}

TEST(BodyPlan, AHubOfManyContactsIsColouredLikeAnyOtherBody) {
  // One body that touches 300 others, which touch their neighbours: the hub alone needs 300 colours.
  Env env;
  env.bodies.resize(301);
  for (Index k = 1; k <= 300; ++k) {
    auto& spoke = env.contacts.emplace_back();
    spoke.body_a = k % 2 == 0 ? 0 : k;
    spoke.body_b = k % 2 == 0 ? k : 0;
    auto& rim = env.contacts.emplace_back();
    rim.body_a = k;
    rim.body_b = 1 + k % 300;
  }
  const BodyPlanData plan = make_body_plan(batch_of<double>({env}).view(), 0);
  expect_sound(env, plan);
  EXPECT_EQ(plan.color_count[0], 300);
}

TEST(BodyPlan, APileNeedsFewColours) {
  const Env env = scenes::make_body_pile(1, 3000);
  const BodyPlanData plan = make_body_plan(batch_of<double>({env}).view(), 0);
  expect_sound(env, plan);
  std::vector<Index> degree(env.bodies.size(), 0);
  for (const auto& contact : env.contacts)
    for (const Index body : {contact.body_a, contact.body_b})
      if (body >= 0) ++degree[static_cast<std::size_t>(body)];
  // Vizing: some colouring needs at most one more than the largest degree; greedy came out one or two above it.
  const Index largest = *std::max_element(degree.begin(), degree.end());
  EXPECT_GE(plan.color_count[0], largest);
  EXPECT_LE(plan.color_count[0], largest + 3);
}

TEST(BodyPlan, FourContactsOfAFaceAreOneVertex) {
  const Env env = scenes::make_body_stack(1, 6);
  const BodyPlanData plan = make_body_plan(batch_of<double>({env}).view(), 0);
  expect_sound(env, plan);
  EXPECT_EQ(plan.color_count[0], 2);
  EXPECT_EQ(plan.color_offsets[2], 6);
}

TEST(BodyPlan, AnEnvironmentIsPlannedAsIfItWereAlone) {
  const Env a = random_bodies(1, 5, 20), b = random_bodies(2, 7, 31);
  const BodyPlanData alone = make_body_plan(batch_of<double>({b}).view(), 0);
  const BodyPlanData both = make_body_plan(batch_of<double>({a, Env{}, b}).view(), 0);
  const auto part = [](const std::vector<Index>& array, std::size_t first, const std::vector<Index>& expected) {
    return std::vector<Index>(array.begin() + static_cast<std::ptrdiff_t>(first),
                              array.begin() + static_cast<std::ptrdiff_t>(first + expected.size()));
  };
  EXPECT_EQ(part(both.contact_order, 20, alone.contact_order), alone.contact_order);
  EXPECT_EQ(part(both.sides, 40, alone.sides), alone.sides);
  EXPECT_EQ(both.color_count[2], alone.color_count[0]);
  EXPECT_EQ(part(both.body_offsets, 5 + 2, alone.body_offsets), alone.body_offsets);
}

/// Expects the plan of environment e in a batch to be its plan in a separate batch, integer by integer.
void expect_planned_alone(const std::vector<Env>& envs, const BodyPlanData& plan, std::size_t e, Index capacity) {
  const BodyPlanData alone = make_body_plan(batch_of<double>({envs[e]}).view(), capacity);
  const auto body = static_cast<std::ptrdiff_t>(plan.env_body_offsets[e]);
  const auto contact = static_cast<std::ptrdiff_t>(plan.env_contact_offsets[e]);
  const auto index = static_cast<std::ptrdiff_t>(e);
  const auto expect_part = [&](const char* name, const std::vector<Index>& all, std::ptrdiff_t first,
                               const std::vector<Index>& expected) {
    const auto begin = all.begin() + first;
    EXPECT_EQ(std::vector<Index>(begin, begin + static_cast<std::ptrdiff_t>(expected.size())), expected)
        << name << " of environment " << e;
  };
  expect_part("kept", plan.kept, index, alone.kept);
  expect_part("contact_order", plan.contact_order, contact, alone.contact_order);
  expect_part("sides", plan.sides, 2 * contact, alone.sides);
  expect_part("vertex_offsets", plan.vertex_offsets, contact + index, alone.vertex_offsets);
  expect_part("color_offsets", plan.color_offsets, contact + index, alone.color_offsets);
  expect_part("color_count", plan.color_count, index, alone.color_count);
  expect_part("body_offsets", plan.body_offsets, body + index, alone.body_offsets);
  expect_part("body_contacts", plan.body_contacts, 2 * contact, alone.body_contacts);
}

TEST(BodyPlan, NeighboursThatAreAlikeArePlannedAsIfTheyWereAlone) {
  const Env base = random_bodies(3, 6, 25);
  Env held = base, moved = base, turned = base, crowded = base, shallow = base;
  held.bodies[2].kinematic = !held.bodies[2].kinematic;
  for (auto& contact : moved.contacts)
    if (contact.body_b == 1 && contact.body_a != 4) contact.body_b = 4;
  for (auto& contact : turned.contacts) std::swap(contact.body_a, contact.body_b);
  crowded.bodies.push_back(base.bodies.front());
  for (std::size_t c = 0; c < shallow.contacts.size(); ++c) shallow.contacts[c].depth = 0.01 * static_cast<double>(c);
  std::vector<Env> envs;
  for (const Env& other : {held, moved, turned, crowded, shallow, Env{}})
    for (const Env* env : {&base, &base, &other, &other}) envs.push_back(*env);
  for (const Index capacity : {0, 10}) {
    const BodyPlanData plan = make_body_plan(batch_of<double>(envs).view(), capacity);
    for (std::size_t e = 0; e < envs.size(); ++e) expect_planned_alone(envs, plan, e, capacity);
  }
}

}  // namespace stiction::test
