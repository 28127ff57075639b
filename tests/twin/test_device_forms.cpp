#include <gtest/gtest.h>

#include <limits>

#include "stiction/jacobian.hpp"
#include "stiction/padded.hpp"
#include "tests/support/systems/jacobian_systems.hpp"
#include "tests/support/systems/random_systems.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/small_systems.hpp"

/// The forms a batch can have beside plain CSR rows: read where they lie by a device too, with the CPU's bits.
namespace stiction::test {
namespace {

constexpr double kRubbish = -7.25;

Solution<double> rubbish(const ContactBatchView<double>& view) {
  const auto rows = static_cast<std::size_t>(view.row_count);
  return {std::vector<double>(rows, kRubbish), std::vector<double>(rows, kRubbish),
          std::vector<EnvStatus>(static_cast<std::size_t>(view.env_count))};
}

SolutionView<double> view_of(Solution<double>& solution) {
  return {solution.lambda.data(), solution.w.data(), solution.status.data()};
}

/// Hash of the whole answer, rows that are not in use included.
std::uint64_t hash_of(const Solution<double>& solution) {
  std::uint64_t hash = hash_bits(std::span<const double>(solution.lambda));
  hash = hash * 0x100000001b3ULL + hash_bits(std::span<const double>(solution.w));
  for (const EnvStatus& status : solution.status) {
    const double record[] = {status.residual, status.residual_absolute, static_cast<double>(status.flags),
                             static_cast<double>(status.iterations), static_cast<double>(status.code)};
    hash = hash * 0x100000001b3ULL + hash_bits(std::span<const double>(record));
  }
  return hash;
}

/// Once through the buffers of a host batch, once where it lies (the emulated device's memory is the host's).
void expect_the_cpus_bits(const ContactBatchView<double>& view) {
  // Lemke's method refuses by the kinds of cones that planning counted.
  for (const SolverKind kind : {SolverKind::npgs, SolverKind::apgd, SolverKind::lemke}) {
    SolverOptions options;
    options.solver = kind;
    options.max_iterations = 30;
    options.invalid = InvalidPolicy::isolate;
    Solution<double> expected = rubbish(view), staged = rubbish(view), resident = rubbish(view);
    Solver(Device::cpu(), options).solve(view, view_of(expected));
    Solver(Device::emulated(), options).solve(view, view_of(staged));
    EXPECT_EQ(hash_of(staged), hash_of(expected)) << to_string(kind);

    ContactBatchView<double> there = view;
    there.space = MemorySpace::cuda;
    const Solver solver(Device::emulated(), options, Capacity::of(view));
    solver.solve(there, view_of(resident));
    solver.synchronize();
    EXPECT_EQ(hash_of(resident), hash_of(expected)) << to_string(kind);
    Solution<double> planned = rubbish(view);
    const Plan plan = solver.plan(there);
    for (int again = 0; again < 2; ++again) solver.solve(plan, there, view_of(planned));
    solver.synchronize();
    EXPECT_EQ(hash_of(planned), hash_of(expected)) << to_string(kind);
  }
}

TEST(DeviceForms, Factors) {
  JacobianBatch<double> batch(Law::coulomb);
  for (std::uint64_t seed = 1; seed < 6; ++seed) {
    batch.add(random_jacobian({seed, 2, 2, 6}));
    batch.add(random_jacobian({seed + 10, 25, 9, static_cast<Index>(17 + seed)}));
  }
  const ContactBatch<double> assembled = assemble(batch.view(), FactorUse::by_size);
  expect_the_cpus_bits(assembled.view());
  expect_the_cpus_bits(assemble(batch.view(), FactorUse::always).view());
}

/// Random contacts in arrays with room for `room` rows an environment, NaN where nothing is in use.
struct PaddedArrays {
  PaddedLayout<double> layout;
  std::vector<double> A, b, R, mu, lo, hi;

  PaddedArrays(MatrixRows rows, RowOrder order, Index room) : layout(rows, order) {
    const auto wide = static_cast<std::size_t>(room);
    Offset contacts = 0;
    for (std::uint64_t seed = 1; seed < 8; ++seed) {
      Recipe recipe;
      recipe.seed = seed;
      recipe.contacts = static_cast<int>(seed);
      recipe.others = order == RowOrder::normal_last ? 0 : 2;
      const Environment<double> env = random_contacts(recipe);
      const bool by_contact = order == RowOrder::normal_last;
      layout.add(room, env.cones, false, by_contact ? contacts : -1);
      contacts += static_cast<Offset>(env.cones.size());
      for (const auto& [to, from] : {std::pair{&b, &env.b}, std::pair{&R, &env.R}, std::pair{&lo, &env.lo},
                                     std::pair{&hi, &env.hi}, std::pair{&mu, &env.mu}}) {
        if (to == &mu && by_contact) continue;
        for (std::size_t i = 0; i < wide; ++i)
          to->push_back(i < from->size() ? (*from)[i] : std::numeric_limits<double>::quiet_NaN());
      }
      if (by_contact)
        for (std::size_t c = 0; c < env.cones.size(); ++c) mu.push_back(0.3 + 0.1 * static_cast<double>(c % 4));
      const std::size_t n = env.b.size(), first = A.size();
      const auto solved = static_cast<std::size_t>(layout.rows(layout.env_count() - 1));
      A.resize(first + wide * wide, std::numeric_limits<double>::quiet_NaN());
      for (std::size_t i = 0; i < solved; ++i)
        for (std::size_t j = 0; j < solved; ++j)
          A[first + i * (rows == MatrixRows::by_room ? wide : solved) + j] = env.A[i * n + j];
    }
  }
  [[nodiscard]] ContactBatchView<double> view() const {
    return layout.view({A.data(), b.data(), R.data(), mu.data(), lo.data(), hi.data()}, Law::coulomb);
  }
};

TEST(DeviceForms, PaddedArrays) {
  expect_the_cpus_bits(PaddedArrays(MatrixRows::by_room, RowOrder::normal_first, 40).view());
  expect_the_cpus_bits(PaddedArrays(MatrixRows::by_rows, RowOrder::normal_first, 40).view());
}

TEST(DeviceForms, PaddedArraysWithTooLittleRoomAreFlagged) {
  const PaddedArrays arrays(MatrixRows::by_room, RowOrder::normal_first, 12);
  expect_the_cpus_bits(arrays.view());
  Solution<double> answer = rubbish(arrays.view());
  SolverOptions options;
  Solver(Device::emulated(), options).solve(arrays.view(), view_of(answer));
  int flagged = 0;
  for (const EnvStatus& status : answer.status) flagged += (status.flags & kFlagContactsDropped) != 0 ? 1 : 0;
  EXPECT_GT(flagged, 0);
  EXPECT_LT(flagged, 7);
}

TEST(DeviceForms, NormalsLastAndFrictionByContact) {
  expect_the_cpus_bits(PaddedArrays(MatrixRows::by_rows, RowOrder::normal_last, 40).view());
}

}  // namespace
}  // namespace stiction::test
