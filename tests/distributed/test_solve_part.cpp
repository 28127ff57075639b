#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <mutex>

#include "distributed/transport/thread_transport.hpp"
#include "distributed/world/bodies.hpp"
#include "distributed/world/solve_part.hpp"
#include "stiction/error.hpp"
#include "tests/distributed/rank_cases.hpp"

namespace stiction::distributed {
namespace {

constexpr Index kSide = 2, kLayers = 7;
constexpr std::uint64_t kSeed = 9;

Index bodies_of_column() {
  return static_cast<Index>(scenes::column_bodies(kSide, kLayers));
}

scenes::BodyPart part_of(int rank, int ranks) {
  const BodyRange own = share_of(bodies_of_column(), rank, ranks);
  return scenes::make_body_column_part(kSeed, kSide, kLayers, own.first, own.end);
}

/// Identity of a contact, with the whole's numbers of its bodies.
struct Named {
  Index a, b;
  std::array<double, 12> numbers;
  auto operator<=>(const Named&) const = default;
};

Named named(const BodyEnvironment<double>::Contact& contact, const std::vector<Index>* body) {
  const auto of = [&](Index k) { return k < 0 || body == nullptr ? k : (*body)[static_cast<std::size_t>(k)]; };
  Named made{of(contact.body_a), of(contact.body_b), {}};
  auto to = made.numbers.begin();
  for (const auto* three : {&contact.arm_a, &contact.arm_b, &contact.normal})
    to = std::copy(three->begin(), three->end(), to);
  *to++ = contact.mu;
  *to++ = contact.depth;
  *to = contact.restitution;
  return made;
}

TEST(SolvePart, PartsOfAColumnAreThoseOfTheWhole) {
  const BodyEnvironment<double> whole = scenes::make_body_column(kSeed, kSide, kLayers);
  ASSERT_EQ(static_cast<Index>(whole.bodies.size()), bodies_of_column());
  for (const int ranks : {1, 2, 3, 5, 120}) {
    std::size_t walls = 0, pairs = 0;
    for (int rank = 0; rank < ranks; ++rank) {
      const scenes::BodyPart part = part_of(rank, ranks);
      const BodyRange own = share_of(bodies_of_column(), rank, ranks);
      for (std::size_t k = 0; k < part.body.size(); ++k) {
        const auto& is = part.environment.bodies[k];
        const auto& was = whole.bodies[static_cast<std::size_t>(part.body[k])];
        EXPECT_EQ(is.inv_mass, was.inv_mass);
        EXPECT_EQ(is.inv_inertia, was.inv_inertia);
        EXPECT_EQ(is.twist, was.twist);
        EXPECT_EQ(is.twist_change, was.twist_change);
      }
      std::vector<Named> expected, found;
      for (const auto& contact : whole.contacts)
        if (own.has(contact.body_a) || own.has(contact.body_b)) expected.push_back(named(contact, nullptr));
      for (const auto& contact : part.environment.contacts) found.push_back(named(contact, &part.body));
      EXPECT_TRUE(found == expected) << "part " << rank << " of " << ranks;
      walls += static_cast<std::size_t>(part.walls);
      pairs += part.environment.contacts.size() - static_cast<std::size_t>(part.walls + part.pairs_below);
    }
    EXPECT_EQ(walls + pairs, whole.contacts.size()) << ranks;
  }
}

/// By as many threads as ranks, each with its part: all impulses, by the whole's contact.
template <class Real>
BodySolution<Real> by_parts(int ranks, const Case& how, const BodyBatchView<Real>& whole) {
  BodySolution<Real> solution = room_for(whole);
  std::mutex mutex;
  run_thread_ranks(ranks, 600, [&](Transport& transport) {
    const scenes::BodyPart part = part_of(transport.rank(), ranks);
    BodyBatch<Real> batch;
    if constexpr (sizeof(Real) == sizeof(float)) {
      batch = single_of(part.environment);
    } else {
      batch = batch_of(part.environment);
    }
    PieceBodies bodies{part.body, {}, transport.rank()};
    for (const Index body : part.body) bodies.owner.push_back(rank_with(body, bodies_of_column(), ranks));
    std::vector<Real> impulse(3 * static_cast<std::size_t>(batch.contact_count()));
    RankReport report;
    const EnvStatus status =
        solve_part(transport, batch.view(), bodies, how.stepping, how.options, impulse.data(), report);
    EXPECT_EQ(report.bodies, batch.body_count());
    EXPECT_EQ(report.exchanges > 0, ranks > 1);
    const std::lock_guard lock(mutex);
    solution.status.front() = status;
    const BodyRange own = share_of(bodies_of_column(), transport.rank(), ranks);
    std::size_t next = 0;
    for (Offset c = 0; c < whole.contact_count; ++c)
      if (own.has(whole.body_a[c]) || own.has(whole.body_b[c])) {
        std::copy_n(impulse.begin() + static_cast<std::ptrdiff_t>(3 * next), 3, solution.impulse.begin() + 3 * c);
        ++next;
      }
    EXPECT_EQ(3 * next, impulse.size());
  });
  return solution;
}

template <class Real>
void expect_bits_of_one_process(const BodyBatch<Real>& whole, const Case& how) {
  const BodySolution<Real> one = by_one_process(whole, how);
  for (const int ranks : {1, 2, 3, 4, 7}) {
    const BodySolution<Real> parts = by_parts(ranks, how, whole.view());
    EXPECT_TRUE(test::same_bits(std::span<const Real>(parts.impulse), std::span<const Real>(one.impulse))) << ranks;
    EXPECT_TRUE(test::same_bits(std::span<const EnvStatus>(parts.status), std::span<const EnvStatus>(one.status)))
        << ranks;
  }
}

TEST(SolvePart, HasTheBitsOfOneProcess) {
  const BodyEnvironment<double> column = scenes::make_body_column(kSeed, kSide, kLayers);
  expect_bits_of_one_process(batch_of(column), sweeps(40));
  Case convex = sweeps(200, 1e-3);
  convex.options.law = Law::convex;
  convex.stepping.cfm = 1e-5;
  expect_bits_of_one_process(single_of(column), convex);
  convex.options.momentum = false;
  expect_bits_of_one_process(batch_of(column), convex);
}

TEST(SolvePart, RefusesWhatRanksDoNotSolve) {
  const auto message = [](const Case& how) {
    return message_of([&] { by_parts<double>(1, how, batch_of(part_of(0, 1).environment).view()); });
  };
  Case newton = sweeps(1);
  newton.options.method = BodyMethod::newton;
  EXPECT_THAT(message(newton), ::testing::HasSubstr("BodyMethod::impulses"));
  EXPECT_THAT(message(sweeps(-1)), ::testing::HasSubstr("iterations = -1"));
  const std::string differ = message_of([] {
    run_thread_ranks(2, 600, [](Transport& transport) {
      const scenes::BodyPart part = part_of(transport.rank(), 2);
      const BodyBatch<double> batch = batch_of(part.environment);
      PieceBodies bodies{part.body, std::vector<int>(part.body.size(), transport.rank()), transport.rank()};
      std::vector<double> impulse(3 * static_cast<std::size_t>(batch.contact_count()));
      RankReport report;
      const Case how = sweeps(transport.rank() + 1);
      solve_part(transport, batch.view(), bodies, how.stepping, how.options, impulse.data(), report);
    });
  });
  EXPECT_THAT(differ, ::testing::HasSubstr("rank 1 has other options than rank 0"));
}

}  // namespace
}  // namespace stiction::distributed
