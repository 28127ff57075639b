// Blocks of cones that a sweep solves together: which cones they are. Their answers are held against a judge and a
// method of another kind, their bits against threads and devices.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>

#include "core/job/cone_blocks.hpp"
#include "core/plan/block_places.hpp"
#include "core/plan/cone_blocks.hpp"
#include "stiction/residual.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/error_message.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

constexpr BlockMode kBlockModes[] = {BlockMode::pairs, BlockMode::strong};
constexpr SolverKind kSweeps[] = {SolverKind::pgs, SolverKind::npgs, SolverKind::nsgs};

SolverOptions in_blocks(SolverOptions options, BlockMode mode) {
  options.blocks = mode;
  return options;
}

/// Rows in pairs, each pair coupled by that number, and the groups given.
Environment<double> coupled_pairs(const std::vector<double>& coupling, const std::vector<Index>& groups) {
  const std::size_t n = groups.size();
  std::vector<double> A(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) A[i * n + i] = 4;
  for (std::size_t i = 0; i + 1 < n; ++i) A[i * n + i + 1] = A[(i + 1) * n + i] = coupling[i];
  std::vector<Cone> cones;
  for (const Index group : groups) cones.push_back({ConeKind::unilateral, 1, group});
  return system(cones, A, std::vector<double>(n, -1.0));
}

std::vector<Index> groups_of(const std::vector<Environment<double>>& envs, BlockMode mode) {
  const ContactBatch<double> batch = batch_of(envs);
  return block_groups(batch.view(), mode);
}

TEST(Blocks, StrongOnesFollowTheNumbersOfA) {
  const auto env = coupled_pairs({1.9, 2.1, -3, 0.1, 2}, {-1, -1, -1, -1, -1, -1});
  // |A_ij| against half of the root of A_ii A_jj, which is 2.
  EXPECT_EQ(groups_of({env, env}, BlockMode::strong), (std::vector<Index>{0, 1, 1, 1, 4, 4, 0, 1, 1, 1, 4, 4}));
}

TEST(Blocks, StrongOnesTakeWhatIsCoupledMost) {
  // One block of all 14 rows would hold. The first 12 are those that are coupled the most, from row 0 on.
  std::vector<double> A(14 * 14, 0.0);
  for (std::size_t i = 0; i < 14; ++i) A[i * 14 + i] = 4;
  for (std::size_t i = 1; i < 14; ++i) A[i] = A[i * 14] = i == 3 || i == 8 ? 2.5 : i % 2 == 0 ? 3 : -3.5;
  const auto env = system(std::vector<Cone>(14, unilateral()), A, std::vector<double>(14, -1.0));
  EXPECT_EQ(groups_of({env}, BlockMode::strong), (std::vector<Index>{0, 0, 0, 3, 0, 0, 0, 0, 8, 0, 0, 0, 0, 0}));
}

TEST(Blocks, PairsAreOfOneGroupWhereverTheyStand) {
  const auto env = coupled_pairs({0, 0, 0, 0, 0}, {-1, 7, 7, -1, -1, 7});
  EXPECT_EQ(groups_of({env}, BlockMode::pairs), (std::vector<Index>{0, 1, 1, 3, 4, 1}));
}

TEST(Blocks, WithoutGroupsPairsStoreTheSameColumns) {
  Environment<double> env = coupled_pairs({1, 0, 1, 0, 0}, {-1, -1, -1, -1, -1, -1});
  env.cones.assign(6, unilateral());
  ContactBatch<double>::Arrays arrays;
  const ContactBatch<double> full = batch_of({env});
  arrays = full.arrays();
  // Rows 0 and 3 store columns 0 and 3, rows 1 and 2 likewise, rows 4 and 5 their own alone.
  arrays.row_offsets = {0, 2, 4, 6, 8, 9, 10};
  arrays.column = {0, 3, 1, 2, 1, 2, 0, 3, 4, 5};
  arrays.A = {4, 1, 4, 1, 1, 4, 1, 4, 4, 4};
  arrays.cone_group.clear();
  const auto sparse = ContactBatch<double>::from_arrays(Law::convex, std::move(arrays));
  EXPECT_EQ(block_groups(sparse.view(), BlockMode::pairs), (std::vector<Index>{0, 1, 1, 0, 4, 5}));
}

TEST(Blocks, TheyHaveTwelveRowsAtMost) {
  const auto env = coupled_pairs(std::vector<double>(29, 3.0), std::vector<Index>(30, 5));
  for (const BlockMode mode : kBlockModes) {
    const std::vector<Index> groups = groups_of({env}, mode);
    for (Index cone = 0; cone < 30; ++cone)
      EXPECT_EQ(groups[static_cast<std::size_t>(cone)], cone / kMostBlockRows * kMostBlockRows);
  }
}

/// Cones dealt out: the first of each group, then the second of each, and so on. `from` gets each one's old number.
Environment<double> dealt(const Environment<double>& env, std::vector<Index>& from) {
  std::map<Index, Index> met;
  std::vector<std::pair<Index, Index>> turns;
  std::vector<Index> first_row;
  Index rows = 0;
  for (const Cone& cone : env.cones) {
    turns.emplace_back(cone.group < 0 ? 0 : met[cone.group]++, static_cast<Index>(turns.size()));
    first_row.push_back(rows);
    rows += cone.row_count;
  }
  std::sort(turns.begin(), turns.end());
  Environment<double> result;
  std::vector<Index> old_row, new_row(static_cast<std::size_t>(rows));
  for (const auto& [turn, cone] : turns) {
    const auto c = static_cast<std::size_t>(cone);
    from.push_back(cone);
    result.cones.push_back(env.cones[c]);
    for (Index k = 0; k < env.cones[c].row_count; ++k) {
      new_row[static_cast<std::size_t>(first_row[c] + k)] = static_cast<Index>(old_row.size());
      old_row.push_back(first_row[c] + k);
    }
  }
  const auto pick = [&](const std::vector<double>& numbers, std::vector<double>& to) {
    for (const Index row : old_row)
      if (!numbers.empty()) to.push_back(numbers[static_cast<std::size_t>(row)]);
  };
  pick(env.b, result.b);
  pick(env.R, result.R);
  pick(env.mu, result.mu);
  pick(env.lo, result.lo);
  pick(env.hi, result.hi);
  for (const Index row : old_row) {
    std::map<Index, double> entries;
    for (Index k = env.row_offsets[static_cast<std::size_t>(row)];
         k < env.row_offsets[static_cast<std::size_t>(row) + 1]; ++k)
      entries[new_row[static_cast<std::size_t>(env.column[static_cast<std::size_t>(k)])]] =
          env.A[static_cast<std::size_t>(k)];
    for (const auto& [column, value] : entries) {
      result.column.push_back(column);
      result.A.push_back(value);
    }
    result.row_offsets.push_back(static_cast<Index>(result.A.size()));
  }
  return result;
}

/// Contacts of one face that stand apart in the file: the same blocks, as many sweeps, and an answer that holds.
TEST(Blocks, FacesWhoseContactsStandApartAreTheSameBlocks) {
  const Environment<double> wall = scenes::make("wall", 1, 0, 4).system;
  std::vector<Index> from;
  const Environment<double> apart = dealt(wall, from);
  const ContactBatch<double> batch = batch_of({wall}), other = batch_of({apart});
  for (const BlockMode mode : kBlockModes) {
    SCOPED_TRACE(to_string(mode));
    const std::vector<Index> blocks = groups_of({wall}, mode), dealt_out = groups_of({apart}, mode);
    std::map<Index, Index> name;
    Index neighbours = 0;
    for (std::size_t c = 0; c < from.size(); ++c) {
      const Index was = blocks[static_cast<std::size_t>(from[c])];
      EXPECT_EQ(name.try_emplace(dealt_out[c], was).first->second, was) << "cone " << c;
      neighbours += c > 0 && dealt_out[c] == dealt_out[c - 1] ? 1 : 0;
    }
    EXPECT_EQ(name.size(), std::set<Index>(blocks.begin(), blocks.end()).size());
    EXPECT_LT(name.size(), from.size() / 3) << "there are blocks";
    EXPECT_EQ(neighbours, 0) << "and their cones stand apart";
    const SolverOptions o = in_blocks(options(SolverKind::npgs, 1e-6, 100000), mode);
    const auto expected = solve(batch, o), solution = solve(other, o);
    ASSERT_EQ(solution.status[0].code, EnvCode::solved);
    EXPECT_EQ(solution.status[0].iterations, expected.status[0].iterations);
    EXPECT_LE(verify(other.view(), std::span<const double>(solution.lambda))[0].relative, 1.001e-6);
  }
}

TEST(Blocks, TheirAnswersPassAnIndependentJudge) {
  for (const char* scene : {"stack", "wall", "grasp", "mixed"})
    for (const Law law : kBothLaws) {
      ContactBatch<double> batch(law);
      for (std::uint64_t e = 0; e < 3; ++e)
        batch.add(scenes::make(scene, 3, e, std::string(scene) == "wall" ? 3 : 0).system);
      for (const SolverKind solver : kSweeps)
        for (const BlockMode mode : kBlockModes) {
          SCOPED_TRACE(std::string(scene) + ", " + label(solver, law) + ", " + to_string(mode));
          const auto plain = solve(batch, options(solver, 1e-3, 4000));
          const auto blocks = solve(batch, in_blocks(options(solver, 1e-3, 4000), mode));
          const auto judged = verify(batch.view(), std::span<const double>(blocks.lambda));
          for (std::size_t e = 0; e < judged.size(); ++e) {
            if (plain.status[e].code != EnvCode::solved) continue;
            EXPECT_EQ(blocks.status[e].code, EnvCode::solved) << "env " << e;
            EXPECT_LE(judged[e].relative, 1.001e-3) << "env " << e;
          }
        }
    }
}

TEST(Blocks, TheirMotionIsThatOfInteriorPoints) {
  ContactBatch<double> batch(Law::convex);
  for (std::uint64_t e = 0; e < 3; ++e) batch.add(scenes::make("stack", 5, e, 4).system);
  const auto expected = solve(batch, options(SolverKind::ipm, 1e-10, 100));
  for (const BlockMode mode : kBlockModes) {
    const auto solution = solve(batch, in_blocks(options(SolverKind::npgs, 1e-8, 100000), mode));
    for (std::size_t e = 0; e < 3; ++e) ASSERT_EQ(solution.status[e].code, EnvCode::solved);
    // The convex law's motion is unique; errors of 1e-8 of b bound its error by their root in the energy.
    for (std::size_t i = 0; i < solution.w.size(); ++i) EXPECT_NEAR(solution.w[i], expected.w[i], 1e-4);
  }
}

TEST(Blocks, ManifoldsOfAWallNeedFewerSweeps) {
  ContactBatch<double> batch(Law::convex);
  batch.add(scenes::make("wall", 1, 0, 4).system);
  const auto sweeps = [&](BlockMode mode) {
    const auto solution = solve(batch, in_blocks(options(SolverKind::npgs, 1e-6, 100000), mode));
    EXPECT_EQ(solution.status[0].code, EnvCode::solved);
    return solution.status[0].iterations;
  };
  const Index plain = sweeps(BlockMode::cones);
  for (const BlockMode mode : kBlockModes) EXPECT_LT(sweeps(mode), 0.9 * plain) << to_string(mode);
}

template <class Real>
void expect_same_everywhere() {
  const ContactBatch<Real> batch = convert<Real>(ragged_batch(2, 11));
  for (const SolverKind solver : kSweeps)
    for (const BlockMode mode : kBlockModes) {
      SCOPED_TRACE(std::string(to_string(solver)) + ", " + to_string(mode));
      SolverOptions o = in_blocks(options(solver, 0, 22), mode);
      const auto expected = solve_hashes(batch, o);
      EXPECT_NE(expected, solve_hashes(batch, in_blocks(o, BlockMode::cones))) << "blocks reach the bits";
      for (const int threads : {2, 7}) {
        o.threads = threads;
        EXPECT_EQ(solve_hashes(batch, o), expected) << threads << " threads";
      }
      EXPECT_EQ(env_hashes(batch, solve(batch, o, Device::emulated())), expected) << "the emulated device";
    }
}

TEST(Blocks, ThreadsAndDevicesHaveNoSayInABit) {
  expect_same_everywhere<float>();
  expect_same_everywhere<double>();
}

template <class Real>
void expect_bits_of_each_alone(const ContactBatch<Real>& batch, const SolverOptions& o) {
  const auto together = solve_hashes(batch, o);
  for (Offset e = 0; e < batch.env_count(); ++e) {
    ContactBatch<Real> alone(batch.law());
    alone.add(environment_of(batch.view(), e));
    EXPECT_EQ(solve_hashes(alone, o).front(), together[static_cast<std::size_t>(e)]) << e;
  }
}

TEST(Blocks, EnvironmentsKeepTheirBitsWhateverStandsBesideThem) {
  expect_bits_of_each_alone(ragged_batch(1, 4), in_blocks(options(SolverKind::npgs, 0, 20), BlockMode::strong));
}

/// Cones in windows: places of cones in the order in which a dense sweep visits them.
TEST(Blocks, TheyFillTheWindowsOfASmallEnvironment) {
  Environment<double> env = system({}, diagonal(std::vector<double>(28, 1.0)), std::vector<double>(28, -1.0));
  // Nine contacts, four of which make a window, behind one row of another shape.
  for (const Index group : {5, 5, 5, 6, 6, 6, 7, 7, 8}) env.cones.push_back({ConeKind::friction, 3, group});
  env.cones.push_back({ConeKind::unilateral, 1, 5});
  env.mu.assign(28, 0.5);
  const ContactBatch<double> batch = batch_of({env});
  const auto places = block_places(batch.view(), block_groups(batch.view(), BlockMode::pairs));
  std::vector<Index> order(10);
  for (std::size_t cone = 0; cone < 10; ++cone)
    order[static_cast<std::size_t>(place_of(places[cone]))] = static_cast<Index>(cone);
  // Two of three and the blocks that fit beside each of them: the single one whole, one of the two that are left.
  EXPECT_EQ(order, (std::vector<Index>{9, 0, 1, 2, 8, 3, 4, 5, 6, 7}));
}

/// Small environments that are all alike in shape and differ in their blocks, in lanes and one by one.
template <class Real>
void expect_lanes_have_the_bits_of_one() {
  constexpr std::pair<const char*, int> kScenes[] = {{"stack", 2}, {"grasp", 2}, {"mixed", 16}};
  for (const auto& [scene, size] : kScenes) {
    ContactBatch<double> wide(Law::coulomb);
    for (std::uint64_t e = 0; e < 41; ++e) wide.add(scenes::make(scene, 5, e, e % 8 == 7 ? size : size + 1).system);
    const ContactBatch<Real> batch = convert<Real>(wide);
    for (const SolverKind solver : kSweeps)
      for (const BlockMode mode : kBlockModes) {
        SCOPED_TRACE(std::string(scene) + ", " + to_string(solver) + ", " + to_string(mode));
        expect_bits_of_each_alone(batch, in_blocks(options(solver, 1e-4, 30), mode));
      }
  }
}

TEST(Blocks, LanesHaveTheBitsOfEachEnvironmentAlone) {
  expect_lanes_have_the_bits_of_one<float>();
  expect_lanes_have_the_bits_of_one<double>();
}

/// Faces whose contacts stand apart in the file.
TEST(Blocks, SmallEnvironmentsNeedFewerSweeps) {
  for (const BlockMode mode : kBlockModes) {
    Index plain = 0, blocks = 0;
    for (std::uint64_t e = 0; e < 8; ++e) {
      const Environment<double> env = scenes::make("stack", 5, e, 4).system;
      std::vector<Index> from;
      const ContactBatch<double> batch = batch_of({dealt(env, from)});
      const auto sweeps = [&](const SolverOptions& o) {
        const auto solution = solve(batch, o);
        EXPECT_EQ(solution.status[0].code, EnvCode::solved);
        return solution.status[0].iterations;
      };
      plain += sweeps(options(SolverKind::npgs, 1e-6, 100000));
      blocks += sweeps(in_blocks(options(SolverKind::npgs, 1e-6, 100000), mode));
    }
    EXPECT_LT(blocks, 0.9 * plain) << to_string(mode);
  }
}

/// A row that lacks an entry of its block: the block's cones are visited one by one.
TEST(Blocks, ABlockThatIsNotStoredAsAWholeIsNoBlock) {
  Environment<double> env = coupled_pairs({1, 1}, {5, 5, 5});
  const ContactBatch<double> full = batch_of({env});
  auto arrays = full.arrays();
  arrays.row_offsets = {0, 2, 5, 7};
  arrays.column = {0, 1, 0, 1, 2, 1, 2};
  arrays.A = {4, 1, 1, 4, 1, 1, 4};
  const auto holey = ContactBatch<double>::from_arrays(Law::convex, std::move(arrays));
  const auto solution = solve(holey, in_blocks(options(SolverKind::pgs, 1e-10, 1000), BlockMode::pairs));
  const auto expected = solve(full, options(SolverKind::pgs, 1e-10, 1000));
  ASSERT_EQ(solution.status[0].code, EnvCode::solved);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(solution.lambda[i], expected.lambda[i], 1e-8);
}

TEST(Blocks, APlanKeepsThem) {
  const ContactBatch<double> batch = scene_batch("stack", 3, 2);
  const SolverOptions o = in_blocks(options(SolverKind::npgs, 0, 20), BlockMode::strong);
  Solution<double> solution{
      std::vector<double>(static_cast<std::size_t>(batch.row_count())), {}, std::vector<EnvStatus>(3)};
  const SolutionView<double> out{solution.lambda.data(), nullptr, solution.status.data()};
  for (const Device device : {Device::cpu(), Device::emulated()}) {
    const Solver solver(device, o);
    solver.solve(solver.plan(batch.view()), batch.view(), out);
    EXPECT_TRUE(same_bits(std::span<const double>(solve(batch, o).lambda), std::span<const double>(solution.lambda)));
  }
}

TEST(Blocks, WhatCannotHaveThemSaysSo) {
  const ContactBatch<double> batch = scene_batch("stack", 2, 2);
  const auto expect_refused = [](const std::string& said, const std::string& part) {
    EXPECT_NE(said.find(part), std::string::npos) << said;
  };
  for (const SolverKind solver : {SolverKind::apgd, SolverKind::automatic})
    expect_refused(error_message([&] { Solver(Device::cpu(), in_blocks(options(solver, 0, 1), BlockMode::pairs)); }),
                   std::string("blocks = pairs with solver = ") + to_string(solver) + ": blocks are of sweeps; choose");
  SolverOptions spectrum = in_blocks(options(SolverKind::npgs, 0, 1), BlockMode::pairs);
  spectrum.choose = SolverChoice::spectrum;
  expect_refused(error_message([&] { Solver(Device::cpu(), spectrum); }), "blocks = pairs with choose = spectrum");
  SolverOptions unknown = options(SolverKind::npgs, 0, 1);
  unknown.blocks = static_cast<BlockMode>(9);
  expect_refused(error_message([&] { Solver(Device::cpu(), unknown); }), "blocks = 9: no such mode");
  expect_refused(error_message([] { block_mode_from_string("boxes"); }), "use one of: cones, pairs, strong");

  const Solver plain(Device::cpu(), options(SolverKind::npgs, 0, 1));
  const Solver blocks(Device::cpu(), in_blocks(options(SolverKind::npgs, 0, 1), BlockMode::pairs));
  std::vector<double> lambda(static_cast<std::size_t>(batch.row_count()));
  std::vector<EnvStatus> status(2);
  const SolutionView<double> out{lambda.data(), nullptr, status.data()};
  expect_refused(error_message([&] { blocks.solve(plain.plan(batch.view()), batch.view(), out); }),
                 "plan was made without blocks and the solver has blocks = pairs");
  expect_refused(error_message([&] { plain.solve(blocks.plan(batch.view()), batch.view(), out); }),
                 "plan was made with blocks and the solver has blocks = cones");
  ContactBatchView<double> elsewhere = batch.view();
  elsewhere.normal_last = true;
  expect_refused(error_message([&] { blocks.solve(elsewhere, out); }), "blocks = pairs and normal_last = true");
  elsewhere = batch.view();
  elsewhere.space = MemorySpace::cuda;  // of the emulated device, which is any memory
  const Solver emulated(Device::emulated(), blocks.options());
  expect_refused(error_message([&] { emulated.solve(elsewhere, out); }), "blocks are found on the host");
}

}  // namespace
