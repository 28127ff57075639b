#include <gtest/gtest.h>

/// Who solves what and where: integers that need no GPU.
#if !defined(STICTION_HAS_CUDA)
TEST(CudaLayout, is_tested_where_the_build_has_cuda) {
  GTEST_SKIP() << "built without the CUDA machine";
}
#else

#include <algorithm>
#include <vector>

#include "core/body/dense_system.hpp"
#include "core/body/sparse_system.hpp"
#include "cuda/layout.hpp"
#include "tests/support/scene_batches.hpp"

namespace stiction::test {
namespace {

using cuda::LaunchSpan;
using cuda::Layout;
using cuda::LayoutRules;
using cuda::Team;

constexpr Offset kVectors = 2;

PlanData ragged_plan(Offset envs_each = 3) {
  ContactBatch<double> batch = ragged_batch(envs_each, 9);
  for (std::uint64_t e = 0; e < 70; ++e) batch.add(scenes::make("stack", 9, e, 1 + static_cast<int>(e % 2)).system);
  batch.add(scenes::make("stack", 9, 0, 40).system);
  return make_plan(batch.view());
}

/// Numbers environment `env` needs.
Offset need(const PlanData& plan, Offset env) {
  const ConeCounts& counts = plan.counts[static_cast<std::size_t>(env)];
  for (std::size_t k = 0; k < plan.sparse_order.size(); ++k)
    if (plan.sparse_order[k] == env)
      return SparseSystem<double>::elements(row_count(counts), cone_count(counts), plan.sparse_nonzeros[k], kVectors);
  return DenseSystem<double>::elements(counts, kVectors);
}

/// One piece of workspace and how much of it is written.
struct Piece {
  Offset begin, end;
};

std::vector<Piece> pieces(const PlanData& plan, const Layout& layout, const LaunchSpan& span) {
  std::vector<Piece> all;
  const Offset group = span.team == Team::threads ? cuda::kWarp : 1;
  for (Offset first = 0; first < span.env_count; first += group) {
    Offset largest = 0;
    for (Offset k = first; k < std::min(first + group, span.env_count); ++k)
      largest = std::max(largest, need(plan, layout.envs[static_cast<std::size_t>(span.first_env + k)]));
    const Offset begin = layout.offsets[static_cast<std::size_t>(span.first_offset + first / group)];
    all.push_back({begin, begin + largest * group});
  }
  return all;
}

TEST(CudaLayout, every_environment_is_solved_once) {
  const PlanData plan = ragged_plan();
  const Layout layout = make_layout(plan, LayoutRules{kVectors});
  std::vector<int> seen(static_cast<std::size_t>(plan.env_count));
  for (const LaunchSpan& span : layout.launches)
    for (Offset k = 0; k < span.env_count; ++k)
      ++seen[static_cast<std::size_t>(layout.envs[static_cast<std::size_t>(span.first_env + k)])];
  EXPECT_TRUE(std::all_of(seen.begin(), seen.end(), [](int times) { return times == 1; }));
}

TEST(CudaLayout, a_team_gets_the_environments_it_is_for) {
  const PlanData plan = ragged_plan();
  const LayoutRules rules{kVectors};
  const Layout layout = make_layout(plan, rules);
  int teams[3] = {};
  for (const LaunchSpan& span : layout.launches) {
    ++teams[static_cast<int>(span.team)];
    EXPECT_EQ(span.width % cuda::kWarp, 0);
    EXPECT_LE(span.width, span.team == Team::threads ? cuda::kThreadsWidth : cuda::kWidestBlock);
    EXPECT_GT(span.env_count, 0);
    for (Offset k = 0; k < span.env_count; ++k) {
      const auto env = static_cast<std::size_t>(layout.envs[static_cast<std::size_t>(span.first_env + k)]);
      const Index rows = row_count(plan.counts[env]);
      if (plan.path[env] == EnvPath::sparse) {
        EXPECT_EQ(span.team, Team::sparse_blocks);
      } else if (rows <= rules.thread_rows) {
        EXPECT_EQ(span.team, Team::threads);
      } else {
        EXPECT_EQ(span.team, Team::dense_blocks);
      }
      if (span.team != Team::threads) {
        EXPECT_EQ(span.width, cuda::block_width(rows));
      }
    }
  }
  for (const int launches : teams) EXPECT_GT(launches, 0);
}

TEST(CudaLayout, workspaces_of_one_launch_do_not_overlap_and_fit) {
  const PlanData plan = ragged_plan();
  for (const Offset limit : {Offset{1} << 28, Offset{100000}, Offset{1}}) {
    LayoutRules rules{kVectors};
    rules.workspace_limit = limit;
    const Layout layout = make_layout(plan, rules);
    for (const LaunchSpan& span : layout.launches) {
      auto all = pieces(plan, layout, span);
      std::sort(all.begin(), all.end(), [](Piece a, Piece b) { return a.begin < b.begin; });
      for (std::size_t k = 0; k < all.size(); ++k) {
        if (k > 0) {
          EXPECT_LE(all[k - 1].end, all[k].begin);
        }
        EXPECT_LE(all[k].end, layout.workspace);
        EXPECT_EQ(all[k].begin % cuda::kWarp, 0);
      }
      if (all.size() > 1) {
        EXPECT_LE(all.back().end, limit) << "more than one piece only within the limit";
      }
    }
  }
}

TEST(CudaLayout, less_workspace_means_more_launches) {
  const PlanData plan = ragged_plan();
  LayoutRules tight{kVectors};
  tight.workspace_limit = 1;
  const Layout one_by_one = make_layout(plan, tight);
  const Layout wide = make_layout(plan, LayoutRules{kVectors});
  EXPECT_GT(one_by_one.launches.size(), wide.launches.size());
  EXPECT_LT(one_by_one.workspace, wide.workspace);
}

TEST(CudaLayout, without_rows_for_threads_only_empty_environments_are_left_to_them) {
  const PlanData plan = ragged_plan();
  LayoutRules rules{kVectors};
  rules.thread_rows = 0;
  const Layout layout = make_layout(plan, rules);
  for (const LaunchSpan& span : layout.launches)
    for (Offset k = 0; k < span.env_count; ++k) {
      const auto env = static_cast<std::size_t>(layout.envs[static_cast<std::size_t>(span.first_env + k)]);
      EXPECT_EQ(span.team == Team::threads, plan.path[env] == EnvPath::empty);
    }
}

TEST(CudaLayout, blocks_are_as_wide_as_their_rows_in_whole_warps) {
  EXPECT_EQ(cuda::block_width(1), 32);
  EXPECT_EQ(cuda::block_width(32), 32);
  EXPECT_EQ(cuda::block_width(33), 64);
  EXPECT_EQ(cuda::block_width(129), 256);
  EXPECT_EQ(cuda::block_width(30000), 256);
}

TEST(CudaLayout, a_plan_without_environments_launches_nothing) {
  const Layout layout = make_layout(make_plan(ContactBatch<float>{}.view()), LayoutRules{kVectors});
  EXPECT_TRUE(layout.launches.empty());
  EXPECT_EQ(layout.workspace, 0);
}

}  // namespace
}  // namespace stiction::test

#endif
