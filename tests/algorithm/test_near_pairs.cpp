// The tree of a large environment finds the contacts that testing all pairs finds, in the same order and bits. Numbers
// of pairs are those of a sorted list, and spheres touch by their centres.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <tuple>

#include "core/algorithm/collision/detect.hpp"
#include "core/machine/world_arrays.hpp"
#include "core/runtime/world/world_model.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/machines/stress_team.hpp"
#include "tests/support/systems/random_worlds.hpp"

namespace stiction::test {

namespace {

constexpr std::size_t kAll = std::size_t{1} << 30;

/// A world in host memory and the contacts that are found in it.
template <class Real>
struct Found {
  Found(const WorldDescription& world, const WorldOptions& options, std::size_t most_listed)
      : model(world, options, most_listed), arrays(model.view(), 1) {}

  void put(const Poses<Real>& poses) {
    arrays.position = poses.position;
    arrays.orientation = poses.orientation;
    arrays.twist = poses.twist;
  }

  template <Team TeamT>
  void find(TeamT& team) {
    const WorldJob<Real> job = arrays.job();
    const WorldModelView<Real>& view = model.view();
    prepare_world(team, job, 0);
    if (!view.by_tree) {
      single(team, [&] { memory.resize(static_cast<std::size_t>(ListedPairs<Real>::bytes(view)) / 16 + 1); });
      const ListedPairs<Real> pairs(view, memory.data());
      const Index count = find_contacts(team, job, 0, pairs);
      single(team, [&] { found.resize(static_cast<std::size_t>(count)); });
      return list_contacts(team, job, 0, pairs, found.data());
    }
    single(team, [&] { memory.resize(static_cast<std::size_t>(NearWorkspace<Real>::bytes(view)) / 16 + 1); });
    NearWorkspace<Real> workspace(view, memory.data());
    const auto near = static_cast<Index>(count_near_pairs(team, job, 0, workspace));
    single(team, [&] { pair_memory.resize(static_cast<std::size_t>(NearPairs<Real>::bytes(near)) / 16 + 1); });
    const Index count = find_near_contacts(team, job, 0, workspace, near, pair_memory.data());
    single(team, [&] { found.resize(static_cast<std::size_t>(count)); });
    list_contacts(team, job, 0, NearPairs<Real>(view, workspace, near, pair_memory.data()), found.data());
  }

  /// Contacts as a batch has them.
  HostContacts<Real>& contacts() {
    SerialTeam team;
    find(team);
    HostContacts<Real>& now = arrays.contacts;
    now.offsets = {0, static_cast<Offset>(found.size())};
    now.resize(now.offsets[1]);
    ContactSink<Real> sink{};
    sink.now = now.view();
    emit_contacts(team, model.view(), sink, 0, found.data());
    return now;
  }

  WorldModel<Real> model;
  WorldArrays<Real> arrays;
  std::vector<std::max_align_t> memory, pair_memory;
  std::vector<FoundContact<Real>> found;
};

template <class T>
testing::AssertionResult same(const std::vector<T>& one, const std::vector<T>& other) {
  return same_bits(std::span<const T>(one), std::span<const T>(other));
}

template <class Real>
void expect_same(HostContacts<Real>& one, HostContacts<Real>& other) {
  EXPECT_EQ(one.id, other.id);
  EXPECT_EQ(one.body_a, other.body_a);
  EXPECT_EQ(one.body_b, other.body_b);
  EXPECT_TRUE(same(one.arm_a, other.arm_a));
  EXPECT_TRUE(same(one.arm_b, other.arm_b));
  EXPECT_TRUE(same(one.normal, other.normal));
  EXPECT_TRUE(same(one.depth, other.depth));
  EXPECT_TRUE(same(one.mu, other.mu));
  EXPECT_TRUE(same(one.restitution, other.restitution));
}

/// Contacts of both ways over a few placements of the same bodies; returns how many there were.
template <class Real>
std::size_t expect_the_tree_finds_all(const RandomWorld& what, std::uint64_t seed, double margin = 0.01) {
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 random(seed);
  const WorldDescription world = random_world(what, random);
  WorldOptions options;
  options.margin = margin;
  Found<Real> listed(world, options, kAll), by_tree(world, options, 0);
  EXPECT_FALSE(listed.model.view().by_tree);
  EXPECT_TRUE(by_tree.model.view().by_tree);
  std::size_t contacts = 0;
  for (int placement = 0; placement < 4; ++placement) {
    const Poses<Real> poses = random_poses<Real>(world, what, random);
    listed.put(poses);
    by_tree.put(poses);
    expect_same(listed.contacts(), by_tree.contacts());
    contacts += listed.found.size();
  }
  return contacts;
}

template <class Real>
class NearPairsOf : public testing::Test {};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(NearPairsOf, Precisions);

}  // namespace

TYPED_TEST(NearPairsOf, ContactsAreThoseOfAllPairs) {
  std::size_t contacts = 0;
  for (std::uint64_t seed = 0; seed < 40; ++seed)
    contacts +=
        expect_the_tree_finds_all<TypeParam>({static_cast<int>(seed * 3), 0.2 + 0.02 * double(seed), 4, false}, seed);
  EXPECT_GT(contacts, 20000U);
}

TYPED_TEST(NearPairsOf, BrokenBodiesHideNoContacts) {
  for (std::uint64_t seed = 0; seed < 25; ++seed)
    EXPECT_GT(expect_the_tree_finds_all<TypeParam>({80, 0.5, 8, true}, seed), 0U);
}

TYPED_TEST(NearPairsOf, SizesMayBeAsUnlikeAsTheyLike) {
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    expect_the_tree_finds_all<TypeParam>({60, 1, 1e6, false}, seed);
    expect_the_tree_finds_all<TypeParam>({60, 1, 1e-9, false}, seed);
    expect_the_tree_finds_all<TypeParam>({40, 1e5, 1e6, false}, seed);
    expect_the_tree_finds_all<TypeParam>({30, 1, 1e24, true}, seed, 0);
  }
}

/// The farthest place along an axis that passes the test of all pairs, found by bisection, has boxes that overlap.
TYPED_TEST(NearPairsOf, BoxesReachToTheBordersOfTheTest) {
  using Real = TypeParam;
  std::mt19937_64 random(23);
  std::uniform_real_distribution<double> any(-1, 1), exponent(-28, 8);
  const auto length = [&] { return static_cast<Real>(std::pow(10.0, exponent(random))); };
  WorldModelView<Real> model{};
  int borders = 0;
  for (int round = 0; round < 4000; ++round) {
    model.margin = round % 3 == 0 ? Real(0) : length();
    MovingShape<Real> a{}, b{};
    a.bound = length(), b.bound = length();
    a.travel = round % 2 == 0 ? Real(0) : length(), b.travel = length();
    const Real from = static_cast<Real>(any(random)) * (round % 5 == 0 ? Real(0) : length());
    a.placed.centre = {from, from, from};
    const auto pass = [&](Real x) {
      b.placed.centre = {from, x, from};
      return bounds_overlap(a, b, pair_margin(model, a, b));
    };
    const Real sign = round % 7 < 3 ? Real(-1) : Real(1);
    Real near = from, far = from + sign * Real(1e12);
    ASSERT_TRUE(pass(near) && !pass(far));
    for (int halving = 0; halving < 2000; ++halving) {
      const Real middle = near + (far - near) / 2;
      if (middle == near || middle == far) break;
      (pass(middle) ? near : far) = middle;
    }
    borders += near != from ? 1 : 0;
    EXPECT_TRUE(pass(near) && boxes_overlap(box_of(a, model.margin), box_of(b, model.margin))) << "round " << round;
  }
  EXPECT_GT(borders, 2000);
}

/// Far from the origin neighbouring numbers are as far apart as the spheres are large. Every other pair just touches.
TYPED_TEST(NearPairsOf, RoundingLosesNoPair) {
  using Real = TypeParam;
  for (const double far : {0.0, 1e3, 1e5, 1e8, 1e15}) {
    WorldDescription world;
    const double ulp = static_cast<double>(std::numeric_limits<Real>::epsilon()) * std::max(far, 0.1);
    for (int k = 0; k < 60; ++k)
      add_body(world, ShapeKind::sphere, {(k % 4 + 1) * std::max(ulp, 1e-9), 0, 0}, 0.5, 0).position = {
          far + k * ulp, far - k % 7 * ulp, k % 3 * ulp};
    WorldOptions options;
    options.margin = 0;
    Poses<Real> poses;
    for (const WorldBody& body : world.bodies) {
      for (const double x : body.position) poses.position.push_back(static_cast<Real>(x));
      for (const double x : {1, 0, 0, 0}) poses.orientation.push_back(static_cast<Real>(x));
      poses.twist.insert(poses.twist.end(), 6, Real(0));
    }
    Found<Real> listed(world, options, kAll), by_tree(world, options, 0);
    listed.put(poses);
    by_tree.put(poses);
    expect_same(listed.contacts(), by_tree.contacts());
    EXPECT_GT(listed.found.size(), 30U) << "at " << far;
  }
}

/// The order that the world promises, sorted here from the description.
TEST(NearPairs, NumbersAreThoseOfASortedList) {
  std::mt19937_64 random(5);
  for (int round = 0; round < 20; ++round) {
    const WorldDescription world = random_world({round * 2, 1, 4, false}, random);
    const WorldModel<double> model(world, {}, 0);
    using Named = std::tuple<Index, Index, Index, Index>;
    std::vector<Named> pairs;
    for (Index i = 0; i < static_cast<Index>(world.shapes.size()); ++i)
      for (Index j = 0; j < static_cast<Index>(world.shapes.size()); ++j) {
        const Index a = world.shapes[static_cast<std::size_t>(i)].body,
                    b = world.shapes[static_cast<std::size_t>(j)].body;
        if (a < b) pairs.emplace_back(a, b, i, j);
      }
    std::sort(pairs.begin(), pairs.end());
    for (std::size_t number = 0; number < pairs.size(); ++number) {
      const ShapePair pair = numbered_pair(model.view(), static_cast<Offset>(number));
      EXPECT_EQ(Named(pair.body_a, pair.body_b, model.described(pair.shape_a), model.described(pair.shape_b)),
                pairs[number]);
      EXPECT_EQ(pair_number(model.view(), pair), static_cast<Offset>(number));
    }
  }
}

/// Spheres at rest: bodies touch where the distance of their centres is at most the radii and the margin.
TEST(NearPairs, SpheresTouchWhereTheirCentresSaySo) {
  constexpr int kSpheres = 1100;
  constexpr double kMargin = 0.01;
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> any(-1, 1), radius(0.02, 0.12);
  WorldDescription world;
  world.gravity = {0, 0, 0};
  Poses<double> poses;
  for (int k = 0; k < kSpheres; ++k) {
    add_body(world, ShapeKind::sphere, {radius(random), 0, 0}).position = {any(random), any(random), any(random)};
    for (const double x : world.bodies.back().position) poses.position.push_back(x);
    for (const double x : {1, 0, 0, 0}) poses.orientation.push_back(x);
    poses.twist.insert(poses.twist.end(), 6, 0.0);
  }
  std::set<std::pair<Index, Index>> touching;
  for (std::size_t a = 0; a < kSpheres; ++a)
    for (std::size_t b = a + 1; b < kSpheres; ++b) {
      const auto& p = world.bodies[a].position;
      const auto& q = world.bodies[b].position;
      if (std::hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2]) <=
          world.shapes[a].size[0] + world.shapes[b].size[0] + kMargin)
        touching.emplace(a, b);
    }
  WorldOptions options;
  options.margin = kMargin;
  Found<double> by_tree(world, options, 0);
  by_tree.put(poses);
  const HostContacts<double>& contacts = by_tree.contacts();
  std::set<std::pair<Index, Index>> found;
  for (std::size_t c = 0; c < contacts.id.size(); ++c) found.emplace(contacts.body_a[c], contacts.body_b[c]);
  EXPECT_EQ(found, touching);
  EXPECT_EQ(contacts.id.size(), touching.size());
  EXPECT_GT(touching.size(), 1000U);
}

TEST(NearPairs, LanesDoNotReachTheContacts) {
  std::mt19937_64 random(3);
  const RandomWorld what{90, 0.6, 6, true};
  const WorldDescription world = random_world(what, random);
  const Poses<double> poses = random_poses<double>(world, what, random);
  Found<double> listed(world, {}, kAll);
  listed.put(poses);
  listed.contacts();
  for (const Index width : {2, 3, 5}) {
    Found<double> by_tree(world, {}, 0);
    by_tree.put(poses);
    run_stressed(width, [&](auto& team) { by_tree.find(team); }, 17);
    ASSERT_EQ(by_tree.found.size(), listed.found.size());
    for (std::size_t c = 0; c < listed.found.size(); ++c) {
      EXPECT_EQ(by_tree.found[c].pair, listed.found[c].pair);
      EXPECT_EQ(by_tree.found[c].feature, listed.found[c].feature);
      EXPECT_EQ(hex_bits(by_tree.found[c].depth), hex_bits(listed.found[c].depth));
    }
  }
}

}  // namespace stiction::test
