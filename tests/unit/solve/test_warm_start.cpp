#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <random>
#include <vector>

#include "stiction/error.hpp"
#include "stiction/padded.hpp"
#include "stiction/warm_start.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/warm_start_life.hpp"

namespace stiction::test {
namespace {

using ::testing::HasSubstr;

/// Expected guesses of one environment: a map by id, written from the description in warm_start.hpp.
template <class Real>
class Oracle {
 public:
  Oracle(double beta, StepScaling scaling) : beta_(beta), scaling_(scaling) {}

  std::vector<Real> load(const EnvStep<Real>& env, double dt, bool fits) {
    record_.hits = 0;
    record_.flags = fits ? 0U : std::uint32_t{kWarmStartTooLarge};
    if (!fits) ++record_.too_large;
    std::vector<Real> guess(env.lambda.size(), Real(0));
    std::map<std::uint64_t, int> seen;
    std::size_t row = 0;
    for (const Cone& cone : env.cones) {
      const auto known = known_.find(cone.id);
      const bool first = seen[cone.id]++ == 0;
      if (!first && fits) record_.flags |= kWarmStartDuplicateId;
      if (fits && first && known != known_.end() && known->second.kind == cone.kind &&
          known->second.lambda.size() == static_cast<std::size_t>(cone.rows)) {
        ++record_.hits;
        for (std::size_t k = 0; k < known->second.lambda.size(); ++k)
          guess[row + k] = static_cast<Real>(beta_ * ratio(dt)) * known->second.lambda[k] + Real(0);
      }
      row += static_cast<std::size_t>(cone.rows);
    }
    record_.misses = static_cast<Index>(env.cones.size()) - record_.hits;
    return guess;
  }

  void store(const EnvStep<Real>& env, double dt, bool fits) {
    known_.clear();
    dt_ = dt;
    std::uint32_t refused = 0;
    if (env.code == EnvCode::numerical || env.code == EnvCode::invalid_input || env.code == EnvCode::unsupported) {
      refused = kWarmStartFailed;  // and nothing else is read
    } else {
      for (const Real value : env.lambda)
        if (!std::isfinite(value)) refused |= kWarmStartNotFinite;
      if (!fits) {
        refused |= kWarmStartTooLarge;
        ++record_.too_large;
      }
    }
    record_.flags |= refused;
    if (refused != 0) return;
    std::size_t row = 0;
    for (const Cone& cone : env.cones) {
      const auto first = env.lambda.begin() + static_cast<std::ptrdiff_t>(row);
      const bool fresh = known_.try_emplace(cone.id, Known{cone.kind, {first, first + cone.rows}}).second;
      if (!fresh) record_.flags |= kWarmStartDuplicateId;
      row += static_cast<std::size_t>(cone.rows);
    }
  }

  void reset() {
    known_.clear();
    record_.flags |= kWarmStartReset;
  }

  [[nodiscard]] const WarmStartRecord& record() const { return record_; }

 private:
  struct Known {
    ConeKind kind;
    std::vector<Real> lambda;
  };
  [[nodiscard]] double ratio(double dt) const {
    if (scaling_ == StepScaling::none) return 1.0;
    if (scaling_ == StepScaling::proportional) return dt / dt_;
    return std::min(1.0, dt_ / dt);
  }
  double beta_;
  StepScaling scaling_;
  double dt_ = 1.0;
  std::map<std::uint64_t, Known> known_;
  WarmStartRecord record_{};
};

template <class Real>
std::vector<Real> load_guess(WarmStartStore<Real>& store, const Packed<Real>& step, double dt) {
  std::vector<Real> guess(step.lambda.size(), Real(77));
  store.load(step.batch.view(), step.id.data(), dt, guess.data());
  return guess;
}
template <class Real>
void store_step(WarmStartStore<Real>& store, Packed<Real>& step, double dt) {
  store.store(step.batch.view(), step.id.data(), {step.lambda.data(), nullptr, step.status.data()}, dt);
}
template <class Real>
std::vector<WarmStartRecord> records(const WarmStartStore<Real>& store) {
  std::vector<WarmStartRecord> out(static_cast<std::size_t>(store.capacity().envs));
  store.records(out);
  return out;
}

/// Lives a life in one store and, beside it, in one oracle per environment.
template <class Real>
void expect_life_like_the_oracle(std::uint64_t seed, const WarmStartCapacity& capacity,
                                 const WarmStartOptions& options) {
  std::mt19937_64 random(seed);
  const int envs = static_cast<int>(capacity.envs);
  WarmStartStore<Real> store(Device::cpu(), capacity, options);
  std::vector<Oracle<Real>> oracle(static_cast<std::size_t>(envs), Oracle<Real>(options.beta, options.scaling));
  for (const Step<Real>& step : random_life<Real>(random, envs, 40)) {
    Packed<Real> packed(step.envs);
    const auto& arrays = packed.batch.arrays();
    const std::vector<Real> guess = load_guess(store, packed, step.dt);
    std::vector<Real> expected;
    std::vector<bool> fits;
    for (std::size_t e = 0; e < step.envs.size(); ++e) {
      fits.push_back(arrays.env_cone_offsets[e + 1] <= capacity.cones &&
                     arrays.env_row_offsets[e + 1] <= capacity.rows);
      const auto part = oracle[e].load(step.envs[e], step.dt, fits[e]);
      expected.insert(expected.end(), part.begin(), part.end());
    }
    ASSERT_TRUE(same_bits(guess, expected)) << "seed " << seed;
    store_step(store, packed, step.dt);
    for (std::size_t e = 0; e < step.envs.size(); ++e) oracle[e].store(step.envs[e], step.dt, fits[e]);
    store.reset(step.reset);
    for (const Offset e : step.reset) oracle[static_cast<std::size_t>(e)].reset();
    const auto found = records(store);
    for (std::size_t e = 0; e < step.envs.size(); ++e)
      ASSERT_EQ(std::memcmp(&found[e], &oracle[e].record(), sizeof(WarmStartRecord)), 0)
          << "seed " << seed << ", environment " << e << ": hits " << found[e].hits << " " << oracle[e].record().hits
          << ", flags " << found[e].flags << " " << oracle[e].record().flags;
  }
}

TEST(WarmStart, ServesWhatAMapByIdWould) {
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    expect_life_like_the_oracle<double>(seed, {5, 2000, 8000}, {});
    expect_life_like_the_oracle<float>(seed, {5, 2000, 8000}, {0.8, StepScaling::proportional, 1});
    expect_life_like_the_oracle<float>(seed, {2, 2000, 8000}, {1.0, StepScaling::none, 1});
  }
}

TEST(WarmStart, WhatDoesNotFitStartsFromZeroAndIsCounted) {
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    expect_life_like_the_oracle<double>(seed, {6, 60, 8000}, {});
    expect_life_like_the_oracle<float>(seed, {6, 2000, 150}, {});
    expect_life_like_the_oracle<float>(seed, {3, 0, 0}, {});
  }
}

TEST(WarmStart, AnEnvironmentIsServedAlikeAloneAndAmongTwoHundredOnAnyNumberOfThreads) {
  std::mt19937_64 random(9);
  const int envs = 200;
  const auto life = random_life<float>(random, envs, 12);
  std::vector<WarmStartStore<float>> together;
  for (const int threads : {1, 2, 7})
    together.emplace_back(Device::cpu(), WarmStartCapacity{envs, 40000, 160000},
                          WarmStartOptions{0.95, StepScaling::capped, threads});
  std::vector<WarmStartStore<float>> alone;
  for (int e = 0; e < envs; ++e) alone.emplace_back(Device::cpu(), WarmStartCapacity{1, 1000, 5000});
  for (const Step<float>& step : life) {
    Packed<float> all(step.envs);
    std::vector<float> expected;
    for (std::size_t e = 0; e < step.envs.size(); ++e) {
      Packed<float> one({step.envs[e]});
      const auto guess = load_guess(alone[e], one, step.dt);
      expected.insert(expected.end(), guess.begin(), guess.end());
      store_step(alone[e], one, step.dt);
    }
    for (auto& store : together) {
      EXPECT_TRUE(same_bits(load_guess(store, all, step.dt), expected));
      store_step(store, all, step.dt);
    }
  }
}

TEST(WarmStart, AnEnvironmentThatStartsOverIsLikeOneOfANewStore) {
  std::mt19937_64 random(10);
  const auto life = random_life<double>(random, 4, 30);
  WarmStartStore<double> store(Device::cpu(), {4, 2000, 8000});
  WarmStartStore<double> fresh(Device::cpu(), store.capacity());
  for (std::size_t s = 0; s < life.size(); ++s) {
    Packed<double> step(life[s].envs);
    EXPECT_TRUE(same_bits(load_guess(store, step, life[s].dt), load_guess(fresh, step, life[s].dt))) << "step " << s;
    store_step(store, step, life[s].dt);
    store_step(fresh, step, life[s].dt);
    const auto a = records(store);
    const auto b = records(fresh);
    EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size() * sizeof(WarmStartRecord)), 0) << "step " << s;
    if (s % 5 != 4) continue;
    if (s % 10 == 4) {
      const std::uint8_t mask[] = {1, 1, 255, 1};
      store.reset_where(mask);
    } else {
      store.reset_all();
    }
    fresh = WarmStartStore<double>(Device::cpu(), store.capacity());
  }
}

TEST(WarmStart, AMaskResetsTheEnvironmentsItNamesAndNoOther) {
  Packed<double> step({{{{5, ConeKind::unilateral, 1}}, {2.0}}, {{{5, ConeKind::unilateral, 1}}, {3.0}}});
  WarmStartStore<double> store(Device::cpu(), {2, 2, 2}, {1.0});
  store_step(store, step, 0.01);
  const std::uint8_t mask[] = {0, 1};
  store.reset_where(mask);
  EXPECT_EQ(load_guess(store, step, 0.01), (std::vector<double>{2.0, 0.0}));
}

TEST(WarmStart, PaddedArraysAreServedLikePackedOnesAndWhatLiesBehindTheirUseIsLeftAlone) {
  std::mt19937_64 random(12);
  const int envs = 5;
  WarmStartStore<float> packed_store(Device::cpu(), {envs, 4000, 16000});
  WarmStartStore<float> padded_store(Device::cpu(), {envs, 4000, 16000});
  for (const Step<float>& step : random_life<float>(random, envs, 15)) {
    Packed<float> packed(step.envs);
    PaddedLayout<float> layout(MatrixRows::by_room);
    for (const EnvStep<float>& env : step.envs) {
      std::vector<Environment<float>::Cone> cones;
      for (const Cone& cone : env.cones) cones.push_back({cone.kind, cone.rows, -1});
      layout.add(static_cast<Index>(env.lambda.size()) + 3, cones);
    }
    const auto view = layout.view({}, Law::convex);
    std::vector<std::uint64_t> id(static_cast<std::size_t>(view.cone_count), 5);
    std::vector<float> lambda(static_cast<std::size_t>(view.row_count), std::nanf("")), guess(lambda.size(), 77.0F);
    for (std::size_t e = 0; e < step.envs.size(); ++e) {
      for (std::size_t c = 0; c < step.envs[e].cones.size(); ++c)
        id[static_cast<std::size_t>(view.env_cone_offsets[e]) + c] = step.envs[e].cones[c].id;
      std::copy(step.envs[e].lambda.begin(), step.envs[e].lambda.end(), lambda.begin() + view.env_row_offsets[e]);
    }
    padded_store.load(view, id.data(), step.dt, guess.data());
    const auto expected = load_guess(packed_store, packed, step.dt);
    std::size_t row = 0;
    for (std::size_t e = 0; e < step.envs.size(); ++e) {
      const auto first = static_cast<std::size_t>(view.env_row_offsets[e]);
      const std::size_t used = step.envs[e].lambda.size();
      for (std::size_t i = 0; i < used; ++i) ASSERT_EQ(guess[first + i], expected[row + i]);
      for (std::size_t i = used; i < used + 3; ++i) ASSERT_EQ(guess[first + i], 77.0F);
      row += used;
    }
    padded_store.store(view, id.data(), {lambda.data(), nullptr, packed.status.data()}, step.dt);
    store_step(packed_store, packed, step.dt);
    const auto a = records(padded_store);
    const auto b = records(packed_store);
    ASSERT_EQ(std::memcmp(a.data(), b.data(), a.size() * sizeof(WarmStartRecord)), 0);
  }
}

TEST(WarmStart, AnEnvironmentMissingFromTheLastBatchIsReset) {
  Packed<double> two({{{{5, ConeKind::unilateral, 1}}, {2.0}}, {{{5, ConeKind::unilateral, 1}}, {3.0}}});
  Packed<double> one({{{{5, ConeKind::unilateral, 1}}, {4.0}}});
  WarmStartStore<double> store(Device::cpu(), {2, 2, 2}, {1.0});
  store_step(store, two, 0.01);
  store_step(store, one, 0.01);
  EXPECT_EQ(load_guess(store, two, 0.01), (std::vector<double>{4.0, 0.0}));
}

TEST(WarmStart, SteppingASceneAgainTakesFewerIterationsAndAPoisonedEnvironmentLeavesNoTrace) {
  const ContactBatch<double> batch = scene_batch("stack", 3, 4);
  auto arrays = batch.arrays();
  arrays.b[0] = std::numeric_limits<double>::quiet_NaN();
  const auto poisoned = ContactBatch<double>::from_arrays(batch.law(), arrays);
  std::vector<std::uint64_t> id;
  for (std::size_t c = 0; c < arrays.cone_kind.size(); ++c) id.push_back(1000 - c);

  SolverOptions options;
  options.tolerance = 1e-6;
  options.max_iterations = 20000;
  options.invalid = InvalidPolicy::isolate;
  const Solver solver(Device::cpu(), options);
  WarmStartStore<double> store(Device::cpu(), {3, 1000, 3000}, {1.0});
  const auto step = [&](const ContactBatch<double>& now) {
    const auto rows = static_cast<std::size_t>(now.row_count());
    Solution<double> out{std::vector<double>(rows), std::vector<double>(rows), std::vector<EnvStatus>(3)};
    std::vector<double> guess(rows);
    store.load(now.view(), id.data(), 0.01, guess.data());
    const SolutionView<double> view{out.lambda.data(), out.w.data(), out.status.data()};
    solver.solve(solver.plan(now.view()), now.view(), view, guess.data());
    store.store(now.view(), id.data(), view, 0.01);
    return out;
  };
  const auto cold = step(batch);
  const auto warm = step(batch);
  const auto failed = step(poisoned);
  const auto after = step(batch);
  for (std::size_t e = 0; e < 3; ++e) {
    EXPECT_EQ(cold.status[e].code, EnvCode::solved);
    EXPECT_EQ(warm.status[e].code, EnvCode::solved);
    EXPECT_LT(2 * warm.status[e].iterations, cold.status[e].iterations);
  }
  EXPECT_EQ(failed.status[0].code, EnvCode::invalid_input);
  const auto hashes = env_hashes(batch, after);
  EXPECT_EQ(hashes[0], env_hashes(batch, cold)[0]) << "an environment that failed starts cold";
  EXPECT_LT(2 * after.status[1].iterations, cold.status[1].iterations) << "its neighbour does not";
}

/// The message of the invalid_argument that `action` throws.
template <class F>
std::string misuse(F&& action) {
  try {
    action();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::invalid_argument) << error.what();
    return error.what();
  }
  return "no Error was thrown";
}

TEST(WarmStart, MisuseIsRefusedWithNameValueAndRemedyAndChangesNothing) {
  const auto make = [](const WarmStartCapacity& capacity, const WarmStartOptions& options) {
    return misuse([&] { WarmStartStore<double>(Device::cpu(), capacity, options); });
  };
  EXPECT_THAT(make({-1, 2, 3}, {}), HasSubstr("capacity.envs = -1"));
  EXPECT_THAT(make({1, -2, 3}, {}), HasSubstr("capacity.cones = -2"));
  EXPECT_THAT(make({1, 2, -3}, {}), HasSubstr("capacity.rows = -3"));
  EXPECT_THAT(make({1, 2, 3}, {0.0}), HasSubstr("beta = 0.0"));
  EXPECT_THAT(make({1, 2, 3}, {1.01}), HasSubstr("beta = 1.01"));
  EXPECT_THAT(make({1, 2, 3}, {std::nan("")}), HasSubstr("beta = "));
  EXPECT_THAT(make({1, 2, 3}, {0.9, static_cast<StepScaling>(9)}), HasSubstr("scaling = 9"));
  EXPECT_THAT(make({1, 2, 3}, {0.9, StepScaling::none, -1}), HasSubstr("threads = -1"));
  try {
    WarmStartStore<double>(Device::cpu(), {1, Offset{1} << 60, 3});
    FAIL() << "2^60 cones fit";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::out_of_memory);
  }

  Packed<double> one({{{{5, ConeKind::unilateral, 1}}, {4.0}}});
  Packed<double> two({{{{5, ConeKind::unilateral, 1}}, {2.0}}, {{{5, ConeKind::unilateral, 1}}, {3.0}}});
  WarmStartStore<double> store(Device::cpu(), {1, 2, 2}, {1.0});
  store_step(store, one, 0.01);
  EXPECT_THAT(misuse([&] { load_guess(store, two, 0.01); }), HasSubstr("2 environments, the store has room for 1"));
  EXPECT_THAT(misuse([&] { store_step(store, two, 0.01); }), HasSubstr("2 environments, the store has room for 1"));
  for (const double dt : {0.0, -1.0, std::nan(""), std::numeric_limits<double>::infinity()})
    EXPECT_THAT(misuse([&] { store_step(store, one, dt); }), HasSubstr("dt = "));
  std::vector<double> guess{77.0};
  EXPECT_THAT(misuse([&] { store.load(one.batch.view(), nullptr, 0.01, guess.data()); }), HasSubstr("cone_id is null"));
  EXPECT_THAT(misuse([&] { store.load(one.batch.view(), one.id.data(), 0.01, nullptr); }), HasSubstr("guess is null"));
  EXPECT_THAT(misuse([&] { store.store(one.batch.view(), one.id.data(), {}, 0.01); }), HasSubstr("lambda is null"));
  EXPECT_THAT(
      misuse([&] { store.store(one.batch.view(), one.id.data(), {one.lambda.data(), nullptr, nullptr}, 0.01); }),
      HasSubstr("status is null"));
  auto device_view = one.batch.view();
  device_view.space = MemorySpace::cuda;
  EXPECT_THAT(misuse([&] { store.load(device_view, one.id.data(), 0.01, guess.data()); }), HasSubstr("space"));
  const Offset outside[] = {0, 1};
  EXPECT_THAT(misuse([&] { store.reset(outside); }), HasSubstr("environment 1 cannot be reset"));
  EXPECT_THAT(misuse([&] { store.reset_where(nullptr); }), HasSubstr("mask is null"));
  std::vector<WarmStartRecord> many(2);
  EXPECT_THAT(misuse([&] { store.records(many); }), HasSubstr("2 records"));
  EXPECT_EQ(guess[0], 77.0);
  EXPECT_EQ(load_guess(store, one, 0.01), std::vector<double>{4.0}) << "a refused call changed what is stored";
}

TEST(WarmStart, AStoreAndABatchWithoutAnythingWork) {
  Packed<float> none({});
  WarmStartStore<float> store(Device::cpu(), {});
  EXPECT_TRUE(load_guess(store, none, 0.01).empty());
  store_step(store, none, 0.01);
  store.reset_all();
  EXPECT_TRUE(records(store).empty());
}

}  // namespace
}  // namespace stiction::test
