#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/algorithm/driver/register_chunk.hpp"
#include "core/algorithm/solver/npgs.hpp"
#include "cuda/emulated/emulated_device.hpp"
#include "cuda/machine/engine.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/machines/device_batch.hpp"
#include "tests/support/systems/prepared.hpp"
#include "tests/support/systems/random_systems.hpp"

/// Small environments whose chunks run with the system in registers: those that do, and equal bits.
namespace stiction::test {
namespace {

Environment<double> contacts(int count, std::uint64_t seed, Index rows = 3) {
  Recipe recipe;
  recipe.seed = seed;
  recipe.contacts = count;
  recipe.others = 0;
  recipe.friction_rows = rows;
  return random_contacts(recipe);
}

template <class Method, Law kLaw>
using Ready = Prepared<Method, kLaw, Dense, float>;

Index window_for(const Environment<double>& environment) {
  Ready<Pgs, Law::coulomb> ready(environment);
  return register_capacity(ready.system());
}

TEST(DeviceRegisters, UpToSixContactsOfThreeRowsFitIntoAWindow) {
  for (const auto& [count, window] :
       {std::pair{1, 4}, std::pair{3, 4}, std::pair{4, 4}, std::pair{5, 6}, std::pair{6, 6}, std::pair{7, 0}})
    EXPECT_EQ(window_for(contacts(count, 5)), window) << count;
}

TEST(DeviceRegisters, OtherConesDoNotFit) {
  EXPECT_EQ(window_for(contacts(3, 5, 2)), 0);
  EXPECT_EQ(window_for(contacts(3, 5, 4)), 0);
  Environment<double> mixed = system({friction(3), unilateral()}, diagonal({1, 1, 1, 1}), {-1, 0, 0, -1});
  mixed.mu = {0, 0.5, 0.5, 0};
  EXPECT_EQ(window_for(mixed), 0);
}

TEST(DeviceRegisters, AMatrixThatIsNotItsTransposeToTheBitDoesNotFit) {
  Ready<Npgs, Law::convex> ready(contacts(2, 6));
  auto& s = ready.system();
  ASSERT_EQ(register_capacity(s), 4);
  const float entry = s.A[1];
  s.A[1] = std::nextafter(entry, 2.0F);
  EXPECT_EQ(register_capacity(s), 0);
  s.A[1] = entry;
  ASSERT_EQ(register_capacity(s), 4);
  // Signs of zero count: they are where equal algorithms differ first.
  s.A[5 * s.n] = 0.0F;
  s.A[5] = -0.0F;
  EXPECT_EQ(register_capacity(s), 0);
}

/// Everything iterations change, as bits.
template <class System>
std::vector<std::uint32_t> state_of(const System& s, Index vectors) {
  std::vector<std::uint32_t> state;
  for (Index i = 0; i < s.n; ++i) {
    state.push_back(bits_of(s.x[i]));
    state.push_back(bits_of(s.y[i]));
    state.push_back(bits_of(s.best[i]));
    for (Index k = 0; k < vectors; ++k) state.push_back(bits_of(s.vector(k)[i]));
  }
  for (Index k = 0; k < kStateScalars; ++k) state.push_back(bits_of(s.scalar[k]));
  return state;
}

/// Chunk after chunk of the same environment with and without a window, past two refreshes and a chunk cut short.
template <class Method, Law kLaw>
void expect_equal_chunks(int count) {
  const Environment<double> environment = contacts(count, static_cast<std::uint64_t>(40 + count));
  Ready<Method, kLaw> plain(environment), windowed(environment);
  const Index window = register_capacity(windowed.system());
  ASSERT_GT(window, 0);
  const StopRule rule{0.0, 38, 0};
  const MethodParams<float> params{1.1F};
  EnvProgress<float> progress, progress_windowed;
  while (progress.iterations < rule.max_iterations) {
    advance_chunk<Method, kLaw>(plain.team, plain.system(), params, rule, progress);
    advance_chunk<Method, kLaw>(windowed.team, windowed.system(), params, rule, progress_windowed, window);
    ASSERT_EQ(progress.iterations, progress_windowed.iterations);
    ASSERT_EQ(state_of(plain.system(), Method::workspace().vectors),
              state_of(windowed.system(), Method::workspace().vectors))
        << count << " contacts, " << progress.iterations << " iterations";
  }
}

TEST(DeviceRegisters, EveryChunkLeavesTheBitsOfTheDenseSystem) {
  for (int count = 1; count <= 6; ++count) {
    expect_equal_chunks<Pgs, Law::convex>(count);
    expect_equal_chunks<Pgs, Law::coulomb>(count);
    expect_equal_chunks<Npgs, Law::convex>(count);
    expect_equal_chunks<Npgs, Law::coulomb>(count);
  }
}

/// x after one chunk of an environment of which everything below the diagonal was overwritten. A window does not read
/// that, and the dense system does.
std::vector<std::uint32_t> one_chunk_without_lower_half(Index max_iterations, bool with_window, bool overwritten) {
  Ready<Npgs, Law::coulomb> ready(contacts(5, 9));
  auto& s = ready.system();
  const Index window = with_window ? register_capacity(s) : 0;
  if (overwritten)
    for (Index j = 0; j < s.n; ++j)
      for (Index i = j + 1; i < s.n; ++i) s.A[i + s.n * j] = 0.25F;
  EnvProgress<float> progress;
  advance_chunk<Npgs, Law::coulomb>(ready.team, s, MethodParams<float>{1.0F}, StopRule{0.0, max_iterations, 0},
                                    progress, window);
  std::vector<std::uint32_t> x;
  for (Index i = 0; i < s.n; ++i) x.push_back(bits_of(s.x[i]));
  return x;
}

TEST(DeviceRegisters, WholeChunksRunInTheWindowAndNoOthers) {
  const auto intact = one_chunk_without_lower_half(8, false, false);
  EXPECT_EQ(one_chunk_without_lower_half(8, true, true), intact);
  EXPECT_NE(one_chunk_without_lower_half(8, false, true), intact);
  EXPECT_EQ(one_chunk_without_lower_half(3, true, true), one_chunk_without_lower_half(3, false, true));
  EXPECT_NE(one_chunk_without_lower_half(3, true, true), one_chunk_without_lower_half(3, true, false));
}

/// Environments of one to six contacts, two of which stay dense (the last bit of A, a unilateral row). One has
/// iterates that grow until they overflow, one a NaN, one no rows.
ContactBatch<float> small_batch() {
  ContactBatch<double> well(Law::coulomb);
  for (std::uint64_t seed = 0; seed < 8; ++seed)
    for (int count = 1; count <= 6; ++count) well.add(contacts(count, 10 * seed + static_cast<std::uint64_t>(count)));
  Environment<double> growing = contacts(3, 1);
  for (std::size_t i = 0; i < 9; ++i) {
    growing.b[i] = -1;
    for (std::size_t j = 0; j < 9; ++j) growing.A[9 * i + j] = i == j ? 1 : -4;
  }
  well.add(growing);
  well.add(system({unilateral()}, {1}, {-1}));
  well.add(Environment<double>{});
  const ContactBatch<float> rounded = convert<float>(well);
  ContactBatch<float> batch(Law::coulomb);
  for (Offset e = 0; e < rounded.env_count(); ++e) {
    batch.add(environment_of(rounded.view(), e));
    if (e != 4 && e != 11) continue;
    Environment<float> odd = environment_of(rounded.view(), e);
    odd.A[1] = std::nextafter(odd.A[1], 2.0F);
    batch.add(odd);
    odd.A[1] = std::numeric_limits<float>::quiet_NaN();
    batch.add(odd);
  }
  return batch;
}

TEST(DeviceRegisters, BatchesOfSmallEnvironmentsHaveTheCpusBits) {
  const ContactBatch<float> batch = small_batch();
  const Capacity need = Capacity::of(batch.view());
  bool overflowed = false;
  for (const SolverKind solver : {SolverKind::pgs, SolverKind::npgs, SolverKind::subspace})
    for (const Law law : kBothLaws)
      for (const Index limit : {1, 3, 4, 6, 90}) {
        SolverOptions wanted = options(solver, limit == 90 ? 1e-6 : 0, limit);
        wanted.law = law;
        wanted.invalid = InvalidPolicy::isolate;
        cuda::EmulatedDevice device({2, 3, static_cast<std::uint64_t>(limit)});
        cuda::Engine engine(device);
        engine.reserve(need, solver, Precision::f32);
        const cuda::Stream stream(device);
        DeviceBatch<float> there(device, need);
        there.fill(batch, stream.get());
        engine.solve(SolveRequest<float>{nullptr, there.view(), there.solution(), nullptr, law, wanted,
                                         StreamRef(stream.get())});
        const Solution<float> answer = there.fetch(batch, stream.get());
        EXPECT_EQ(env_hashes(batch, answer), solve_hashes(batch, wanted)) << label(solver, law) << ", " << limit;
        for (const EnvStatus& status : answer.status) overflowed |= status.code == EnvCode::numerical;
      }
  EXPECT_TRUE(overflowed);
}

}  // namespace
}  // namespace stiction::test
