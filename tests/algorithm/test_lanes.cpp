#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "core/algorithm/driver/solve_environment.hpp"
#include "core/algorithm/pack/lane_progress.hpp"
#include "core/algorithm/solver/npgs.hpp"
#include "cpu_fallback/pack/shared_lanes.hpp"
#include "tests/support/machines/loaded_lanes.hpp"
#include "tests/support/systems/prepared.hpp"
#include "tests/support/systems/random_systems.hpp"

/// Lanes from inside: their loads and verdicts, against each environment alone. Compiled for each of the library's
/// widths, including packs of several tiles side by side.
namespace {

using namespace stiction;
using namespace stiction::test;

template <class Real>
bool same_bits(Real a, Real b) {
  return bits_of(a) == bits_of(b);
}

/// Every number of a lane's cones and rows is that of the environment alone, and its padding is zero.
template <class Real, int W>
void expect_lane_is(const Lanes<Real, W>& lanes, std::size_t e, int lane, const Environment<double>& environment) {
  Prepared<Npgs, kLaw, Dense, Real> alone(environment);
  const auto& one = alone.system();
  const auto& s = lanes.lanes[static_cast<std::size_t>(lane)];
  std::vector<Index> slot(static_cast<std::size_t>(s.n), -1);  // row of `one` in each row of the lane
  std::vector<Index> cone_block(static_cast<std::size_t>(s.cones), -1);
  SerialTeam team;
  for_each_slot(team, lanes.envs[e], s, [&](Index cone, ConeSlot there) {
    ConeSlot here{0, 0};
    for_each_slot(team, alone.env, one, [&](Index other, ConeSlot at) {
      if (other == cone) here = at;
    });
    cone_block[static_cast<std::size_t>(there.cone)] = here.cone;
    for (Index k = 0; k < alone.env.cone_size(cone); ++k) slot[static_cast<std::size_t>(there.row + k)] = here.row + k;
  });
  for (Index i = 0; i < s.n; ++i) {
    const Index own = slot[static_cast<std::size_t>(i)];
    const auto expect = [&](const char* what, Real got, Real want) {
      EXPECT_TRUE(same_bits(got, want)) << what << " of row " << i << " is " << got << ", not " << want;
    };
    expect("b", s.b[i], own < 0 ? Real(0) : one.b[own]);
    expect("x", s.x[i], own < 0 ? Real(0) : one.x[own]);
    expect("y", s.y[i], own < 0 ? Real(0) : one.y[own]);
    expect("best", s.best[i], own < 0 ? Real(0) : one.best[own]);
    for (Index j = 0; j < s.n; ++j) {
      const Index other = slot[static_cast<std::size_t>(j)];
      const bool is_there = own >= 0 && other >= 0;
      const Real want = is_there ? one.A[own + one.n * other] : Real(0);
      const Real got = s.A[i + s.n * j];
      EXPECT_TRUE(same_bits(got, want)) << "entry " << i << ", " << j << " is " << got << ", not " << want;
    }
  }
  for (Index c = 0; c < s.cones; ++c) {
    const Index own = cone_block[static_cast<std::size_t>(c)];
    const auto expect = [&](const char* what, auto&& array_of) {
      const Real want = own < 0 ? Real(0) : array_of(one)[own];
      const Real got = array_of(s)[c];
      EXPECT_TRUE(same_bits(got, want)) << what << " of cone " << c << " is " << got << ", not " << want;
    };
    expect("residual_weight", [](const auto& system) { return system.residual_weight; });
    expect("press", [](const auto& system) { return system.press; });
    expect("island", [](const auto& system) { return system.island; });
    expect("inv_n", [](const auto& system) { return system.inv_n; });
    expect("inv_t", [](const auto& system) { return system.inv_t; });
    expect("inv_cone", [](const auto& system) { return system.inv_cone; });
    expect("damping", [&](const auto& system) { return own < 0 ? system.inv_n : system.damping; });
    expect("share", [](const auto& system) { return system.share; });
    expect("lo", [](const auto& system) { return system.lo; });
    expect("hi", [](const auto& system) { return system.hi; });
  }
  for (const int k : {kBestResidual, kLastResidual, kBestReaction, kErrorScale, kScaleA, kScaleB})
    EXPECT_TRUE(same_bits(s.scalar[k], one.scalar[k])) << "scalar " << k;
}

template <class Width>
class LanesOf : public testing::Test {};
template <class R, int kW>
struct Width {
  using Real = R;
  static constexpr int kWidth = kW;
};
using Widths = testing::Types<Width<float, kPackWidth<float>>, Width<double, kPackWidth<double>>>;
TYPED_TEST_SUITE(LanesOf, Widths);

TYPED_TEST(LanesOf, HoldWhatAnEnvironmentHasByItself) {
  using Real = typename TypeParam::Real;
  constexpr int kWidth = TypeParam::kWidth;
  for (const bool alike : {true, false}) {
    const std::vector<Environment<double>> all = guests(alike);
    Lanes<Real, kWidth> lanes(all);
    std::array<std::size_t, kWidth> state{};
    // All lanes at once, then one or two at a time beside guests that stay.
    std::vector<std::pair<std::size_t, int>> entering;
    for (int l = 0; l < kWidth; ++l) entering.emplace_back(static_cast<std::size_t>(l), l);
    auto next = static_cast<std::size_t>(kWidth);
    for (int round = 0; next + 2 <= all.size(); ++round) {
      for (const std::uint32_t flags : lanes.enter(entering)) EXPECT_EQ(flags, 0U);
      for (const auto& [e, lane] : entering) state[static_cast<std::size_t>(lane)] = e;
      for (int l = 0; l < kWidth; ++l) {
        SCOPED_TRACE(testing::Message() << "alike " << alike << ", round " << round << ", lane " << l);
        expect_lane_is(lanes, state[static_cast<std::size_t>(l)], l, all[state[static_cast<std::size_t>(l)]]);
      }
      entering.assign(1, {next++, round % kWidth});
      if (round % 2 == 1) entering.emplace_back(next++, (round + 1) % kWidth);
    }
  }
}

TYPED_TEST(LanesOf, AreJudgedAsAnEnvironmentIsByItself) {
  using Real = typename TypeParam::Real;
  constexpr int kWidth = TypeParam::kWidth;
  int unsolved = 0;
  for (const bool alike : {true, false}) {
    const std::vector<Environment<double>> all = guests(alike);
    Lanes<Real, kWidth> lanes(all);
    fill(lanes, 0);
    SerialTeam team;
    const MethodParams<Real> params{Real(1), false};
    using Together = DenseSystem<Pack<Real, kWidth>>;
    advance<Npgs, kLaw>(team, params, Advancing<Together>{*lanes.pack, Pack<Real, kWidth>(0), Pack<Real, kWidth>(100)});
    std::array<const EnvView<Real>*, kWidth> views;
    for (int l = 0; l < kWidth; ++l) views[static_cast<std::size_t>(l)] = &lanes.envs[static_cast<std::size_t>(l)];
    // The last lane alone, then all: lanes that were not asked for are not published.
    for (const int first : {kWidth - 1, 0}) {
      std::array<int, kWidth> asked{};
      for (int l = first; l < kWidth; ++l) asked[static_cast<std::size_t>(l - first)] = l;
      std::array<FinalResidual, kWidth> evaluated{};
      for (auto& env : lanes.envs)
        for (Index i = 0; i < env.n; ++i) env.lambda[i] = Real(77);
      evaluate_lanes<kLaw>(*lanes.pack, *lanes.workspace, views.data(), asked.data(), kWidth - first, evaluated.data());
      for (int l = 0; l < kWidth; ++l) {
        SCOPED_TRACE(testing::Message() << "alike " << alike << ", first " << first << ", lane " << l);
        EnvView<Real>& env = lanes.envs[static_cast<std::size_t>(l)];
        if (l < first) {
          EXPECT_EQ(env.lambda[0], Real(77));
          continue;
        }
        const std::vector<Real> lambda(env.lambda, env.lambda + env.n), w(env.w, env.w + env.n);
        write_solution(team, env, lanes.lanes[static_cast<std::size_t>(l)]);
        env.is_full = false;  // the long way
        const auto& s = lanes.lanes[static_cast<std::size_t>(l)];
        const FinalResidual alone =
            final_residual(team, env, StoredRows<Real>{&env}, island_shares(s), error_scale_of(s));
        unsolved += alone.residual > 0.0 ? 1 : 0;
        const FinalResidual& together = evaluated[static_cast<std::size_t>(l)];
        EXPECT_EQ(together.residual, alone.residual);
        EXPECT_EQ(together.absolute, alone.absolute);
        EXPECT_EQ(together.rounding_floor, alone.rounding_floor);
        EXPECT_EQ(together.reaction, alone.reaction);
        for (Index i = 0; i < env.n; ++i) {
          EXPECT_TRUE(same_bits(lambda[static_cast<std::size_t>(i)], env.lambda[i])) << "row " << i;
          EXPECT_TRUE(same_bits(w[static_cast<std::size_t>(i)], env.w[i])) << "row " << i;
        }
      }
    }
  }
  EXPECT_GE(unsolved, 2 * kWidth);  // of 2 kWidth + 2 that were judged
}

/// Tolerances that are Reals and such as lie between two of them, and residuals at, just below and just above.
/// Residuals are roots: beside 0 the least is that of the least number.
template <class Real>
Real residual_beside(double tolerance, int side) {
  const auto nearest = static_cast<Real>(tolerance);
  if (side > 0 && nearest == Real(0)) return std::sqrt(std::numeric_limits<Real>::denorm_min());
  return side == 0 ? nearest : std::nextafter(nearest, side < 0 ? Real(0) : Real(2));
}

TYPED_TEST(LanesOf, AreLookedAtAsAnEnvironmentIsByItself) {
  using Real = typename TypeParam::Real;
  constexpr int kWidth = TypeParam::kWidth;
  const std::vector<Environment<double>> all = guests(true);
  Lanes<Real, kWidth> lanes(all);
  scenes::Rng rng(5);
  LaneSearch<Real, kWidth> together;
  std::array<StopRule, kWidth> rules{};
  std::array<EnvProgress<Real>, kWidth> alone{};
  std::array<int, 5> found{};
  const auto begin = [&](int l) {
    const auto i = static_cast<std::size_t>(l);
    constexpr double kTolerances[] = {0.0, 0.25, 0.1, 1e-4, 1e-50};
    rules[i] = {kTolerances[rng.below(5)], static_cast<Index>(rng.below(30)), static_cast<Index>(4 * rng.below(3))};
    alone[i] = EnvProgress<Real>{};
    together.begin(l, rules[i]);
    lanes.lanes[i].scalar[kBestResidual] = Real(1);
  };
  for (int l = 0; l < kWidth; ++l) begin(l);
  for (int round = 0; round < 400; ++round) {
    for (int l = 0; l < kWidth; ++l) {
      const auto i = static_cast<std::size_t>(l);
      const auto& s = lanes.lanes[i];
      const Real seen = residual_beside<Real>(rules[i].tolerance, rng.below(3) - 1) * Real(rng.chance(0.7) ? 2 : 1);
      if (rng.chance(0.5) && seen < s.scalar[kBestResidual]) s.scalar[kBestResidual] = seen;
      s.scalar[kLastResidual] = rng.chance(0.05) ? std::numeric_limits<Real>::infinity() : Real(1);
      s.scalar[kOutcome] = Real(rng.chance(0.05) ? kFinished : kRunning);
    }
    const auto polls = poll_progress<Pack<Real, kWidth>>(*lanes.pack, together.limits, together.search);
    for (int l = 0; l < kWidth; ++l) {
      SCOPED_TRACE(testing::Message() << "round " << round << ", lane " << l);
      const auto i = static_cast<std::size_t>(l);
      const EnvPoll want = poll_progress<Real>(lanes.lanes[i], rules[i], alone[i]);
      const EnvPoll got = poll_of_lane(polls, l);
      const std::array<bool, 5> wanted{want.broken, want.stalled, want.stopped, want.ended, want.has_candidate};
      EXPECT_EQ((std::array<bool, 5>{got.broken, got.stalled, got.stopped, got.ended, got.has_candidate}), wanted);
      for (std::size_t k = 0; k < wanted.size(); ++k) found[k] += wanted[k] ? 1 : 0;
      const EnvProgress<Real> lane = together.of(l, 0U);
      EXPECT_EQ(lane.iterations, alone[i].iterations);
      EXPECT_EQ(lane.best_at, alone[i].best_at);
      EXPECT_EQ(lane.best, alone[i].best);
      if (want.has_candidate && rng.chance(0.5))  // judged, and not found to be an answer
        together.search.verified.v[l] = alone[i].verified = lanes.lanes[i].scalar[kBestResidual];
      if (want.ended) begin(l);
    }
    const auto chunk = next_chunk<Npgs>(*lanes.pack, together.limits, together.search);
    for (int l = 0; l < kWidth; ++l) {
      const auto i = static_cast<std::size_t>(l);
      const auto own = next_chunk<Npgs>(lanes.lanes[i], rules[i], alone[i]);
      EXPECT_EQ(chunk.phase.v[l], own.phase);
      EXPECT_EQ(chunk.left.v[l], own.left);
    }
  }
  for (const int count : found) EXPECT_GT(count, 20);
  // A lane without an environment is never due.
  together.end(0);
  const auto idle = next_chunk<Npgs>(*lanes.pack, together.limits, together.search);
  EXPECT_EQ(idle.left.v[0], Real(0));
  EXPECT_EQ(idle.phase.v[0], Real(0));
  EXPECT_EQ(together.search.iterations.v[0], 0);
}

TYPED_TEST(LanesOf, GetTheSameBitsWhenTwoPacksTakeTurns) {
  using Real = typename TypeParam::Real;
  constexpr int kWidth = TypeParam::kWidth;
  using Packed = Pack<Real, kWidth>;
  using Together = DenseSystem<Packed>;
  SerialTeam team;
  const MethodParams<Real> params{Real(1), false};
  for (const bool alike : {true, false}) {
    const std::vector<Environment<double>> all = guests(alike);
    const std::size_t second = all.size() - static_cast<std::size_t>(kWidth);
    Lanes<Real, kWidth> a(all), b(all), a_alone(all), b_alone(all);
    for (auto* pack : {&a, &a_alone}) fill(*pack, 0);
    for (auto* pack : {&b, &b_alone}) fill(*pack, second);
    for (int chunk = 0; chunk < 6; ++chunk) {
      // One pack is a chunk further than the other, and one of its lanes runs out within the second.
      const auto next = [&](const Lanes<Real, kWidth>& lanes, int done) {
        Packed left(static_cast<Real>(100));
        left.v[kWidth - 1] = static_cast<Real>(6 - kChunk * done);
        return Advancing<Together>{*lanes.pack, Packed(static_cast<Real>(kChunk * done % kRefreshInterval)), left};
      };
      advance<Npgs, kLaw>(team, params, next(a_alone, chunk + 1));
      advance<Npgs, kLaw>(team, params, next(b_alone, chunk));
      advance<Npgs, kLaw>(team, params, next(a, chunk + 1), next(b, chunk));
      for (const auto& [turns, alone] : {std::pair(&a, &a_alone), std::pair(&b, &b_alone)})
        for (int l = 0; l < kWidth; ++l) {
          SCOPED_TRACE(testing::Message() << "alike " << alike << ", chunk " << chunk << ", lane " << l);
          const auto& got = turns->lanes[static_cast<std::size_t>(l)];
          const auto& want = alone->lanes[static_cast<std::size_t>(l)];
          for (Index i = 0; i < got.n; ++i) {
            EXPECT_TRUE(same_bits(got.x[i], want.x[i])) << "x " << i;
            EXPECT_TRUE(same_bits(got.y[i], want.y[i])) << "y " << i;
            EXPECT_TRUE(same_bits(got.best[i], want.best[i])) << "best " << i;
          }
          for (const Index k : {Index{kBestResidual}, Index{kLastResidual}, Index{Npgs::kTheta}, Index{Npgs::kBeta},
                                Index{Npgs::kProgress}})
            EXPECT_TRUE(same_bits(got.scalar[k], want.scalar[k])) << "scalar " << k;
        }
    }
    // They have come somewhere, and not to the same place.
    int apart = 0;
    for (Index i = 0; i < a.pack->n; ++i)
      for (int l = 0; l < kWidth; ++l) apart += a.pack->x[i].v[l] != b.pack->x[i].v[l] ? 1 : 0;
    EXPECT_GT(apart, 2 * kWidth);
  }
}

}  // namespace
