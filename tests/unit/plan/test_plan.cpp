#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <iterator>
#include <numeric>
#include <random>
#include <utility>
#include <vector>

#include "core/base/extents.hpp"
#include "core/plan/plan.hpp"

namespace {

using namespace stiction;

struct ConeSpec {
  ConeKind kind;
  Index rows;
  Index group = -1;
};

/// Cones whose rows are joined in full where `joined` is true, each cone with itself always; `one_sided` keeps only
/// the block below the diagonal.
Environment<double> environment_of(const std::vector<ConeSpec>& cones, const std::vector<std::pair<int, int>>& joined,
                                   bool one_sided = false) {
  Environment<double> environment;
  std::vector<std::vector<Index>> blocks(cones.size());
  for (std::size_t c = 0; c < cones.size(); ++c) {
    environment.cones.push_back({cones[c].kind, cones[c].rows, cones[c].group});
    blocks[c].push_back(static_cast<Index>(c));
  }
  for (const auto& [low, high] : joined) {
    blocks[at(high)].push_back(low);
    if (!one_sided) blocks[at(low)].push_back(high);
  }
  std::vector<Index> first(cones.size() + 1, 0);
  for (std::size_t c = 0; c < cones.size(); ++c) first[c + 1] = first[c] + cones[c].rows;
  for (std::size_t c = 0; c < cones.size(); ++c) {
    std::sort(blocks[c].begin(), blocks[c].end());
    for (Index i = 0; i < cones[c].rows; ++i) {
      for (const Index block : blocks[c]) {
        for (Index j = first[at(block)]; j < first[at(block) + 1]; ++j) {
          environment.column.push_back(j);
          environment.A.push_back(first[c] + i == j ? 4.0 : 0.0);  // a stored zero joins too
        }
      }
      environment.row_offsets.push_back(static_cast<Index>(environment.column.size()));
      environment.b.push_back(-1.0);
    }
  }
  return environment;
}

/// n cones of 3 rows, each joined with the next.
Environment<double> chain_of(int n) {
  std::vector<std::pair<int, int>> joined;
  for (int c = 0; c + 1 < n; ++c) joined.emplace_back(c, c + 1);
  return environment_of(std::vector<ConeSpec>(at(n), {ConeKind::friction, 3}), joined);
}

PlanData plan_of(const std::vector<Environment<double>>& environments) {
  ContactBatch<double> batch;
  for (const auto& environment : environments) batch.add(environment);
  return make_plan(batch.view());
}

template <class T>
std::vector<T> part(const std::vector<T>& values, Offset begin, Offset end) {
  return {values.begin() + begin, values.begin() + end};
}

std::vector<Index> vertices_of(const PlanData& plan, Offset env) {
  return part(plan.vertex_offsets, plan.env_vertex_offsets[at(env)], plan.env_vertex_offsets[at(env) + 1]);
}

std::vector<Index> colors_of(const PlanData& plan, Offset env) {
  return part(plan.color_offsets, plan.env_color_offsets[at(env)], plan.env_color_offsets[at(env) + 1]);
}

/// 30 unilateral cones and 15 friction cones of 3 rows: 75 rows, sparse whatever is joined with little else.
std::vector<ConeSpec> seventy_five_rows() {
  std::vector<ConeSpec> cones(15, {ConeKind::friction, 3});
  cones.insert(cones.end(), 30, {ConeKind::unilateral, 1});
  return cones;
}

Environment<double> random_environment(std::mt19937& random) {
  const int cone_count = static_cast<int>(random() % 60);
  std::vector<ConeSpec> cones;
  for (int c = 0; c < cone_count; ++c) {
    const auto kind = static_cast<ConeKind>(random() % 4);
    const auto rows = kind == ConeKind::friction ? static_cast<Index>(2 + random() % 5) : 1;
    cones.push_back({kind, rows, static_cast<Index>(random() % 4) - 1});
  }
  std::vector<std::pair<int, int>> joined;
  for (int k = 0; cone_count > 1 && k < cone_count; ++k) {
    const auto u = static_cast<int>(random() % at(cone_count)), v = static_cast<int>(random() % at(cone_count));
    const std::pair<int, int> edge(std::min(u, v), std::max(u, v));
    if (u != v && std::find(joined.begin(), joined.end(), edge) == joined.end()) joined.push_back(edge);
  }
  return environment_of(cones, joined, random() % 2 == 0);
}

/// The plan's promises about one environment, checked from the batch itself.
void expect_sound(const ContactBatchView<double>& batch, const PlanData& plan, Offset env) {
  const Offset first_cone = batch.env_cone_offsets[env], cones = batch.env_cone_offsets[env + 1] - first_cone;
  const Offset first_row = batch.env_row_offsets[env], rows = batch.env_row_offsets[env + 1] - first_row;
  const std::vector<Index> order = part(plan.cone_order, first_cone, first_cone + cones);
  std::vector<Index> sorted = order, all(at(cones));
  std::sort(sorted.begin(), sorted.end());
  std::iota(all.begin(), all.end(), 0);
  ASSERT_EQ(sorted, all) << "every cone once";
  ASSERT_EQ(row_count(plan.counts[at(env)]), rows);
  ASSERT_EQ(plan.color_count.size(), plan.path.size());
  if (plan.path[at(env)] != EnvPath::sparse) {
    EXPECT_EQ(plan.color_count[at(env)], 0);
    EXPECT_TRUE(vertices_of(plan, env).empty());
    EXPECT_TRUE(colors_of(plan, env).empty());
    return;
  }
  const std::vector<Index> vertices = vertices_of(plan, env), colors = colors_of(plan, env);
  ASSERT_EQ(vertices.front(), 0);
  ASSERT_EQ(vertices.back(), cones);
  ASSERT_EQ(colors.front(), 0);
  ASSERT_EQ(colors.back(), static_cast<Index>(vertices.size()) - 1);
  ASSERT_EQ(plan.color_count[at(env)], static_cast<Index>(colors.size()) - 1);

  std::vector<Index> vertex_of_cone(at(cones)), color_of_vertex(vertices.size() - 1), cone_of_row(at(rows));
  for (std::size_t v = 0; v + 1 < vertices.size(); ++v) {
    ASSERT_LT(vertices[v], vertices[v + 1]);
    for (Index p = vertices[v]; p < vertices[v + 1]; ++p) vertex_of_cone[at(order[at(p)])] = static_cast<Index>(v);
  }
  for (std::size_t c = 0; c + 1 < colors.size(); ++c) {
    ASSERT_LT(colors[c], colors[c + 1]) << "no colour is empty";
    for (Index v = colors[c]; v < colors[c + 1]; ++v) color_of_vertex[at(v)] = static_cast<Index>(c);
  }
  for (Offset c = 0; c < cones; ++c) {
    const Offset begin = batch.cone_row_offsets[first_cone + c] - first_row;
    const Offset end = batch.cone_row_offsets[first_cone + c + 1] - first_row;
    for (Offset row = begin; row < end; ++row) cone_of_row[at(row)] = static_cast<Index>(c);
  }
  for (Offset row = 0; row < rows; ++row) {
    for (Offset k = batch.row_offsets[first_row + row]; k < batch.row_offsets[first_row + row + 1]; ++k) {
      const Index u = vertex_of_cone[at(cone_of_row[at(row)])];
      const Index v = vertex_of_cone[at(cone_of_row[at(batch.column[k])])];
      if (u != v) {
        ASSERT_NE(color_of_vertex[at(u)], color_of_vertex[at(v)]) << "rows " << row << " and " << batch.column[k];
      }
    }
  }
}

TEST(Plan, ABatchWithoutEnvironmentsHasAnEmptyPlan) {
  const PlanData plan = plan_of({});
  EXPECT_EQ(plan.env_count, 0);
  EXPECT_EQ(plan.env_vertex_offsets, std::vector<Offset>{0});
  EXPECT_EQ(plan.env_color_offsets, std::vector<Offset>{0});
  EXPECT_TRUE(plan.cone_order.empty());
  EXPECT_TRUE(plan.dense_order.empty());
  EXPECT_TRUE(plan.sparse_order.empty());
}

TEST(Plan, EmptyEnvironmentsAreInNeitherOrder) {
  const PlanData plan = plan_of({{}, environment_of({{ConeKind::unilateral, 1}}, {}), {}});
  EXPECT_EQ(plan.path, (std::vector<EnvPath>{EnvPath::empty, EnvPath::dense, EnvPath::empty}));
  EXPECT_EQ(plan.dense_order, std::vector<Offset>{1});
  EXPECT_TRUE(plan.sparse_order.empty());
  EXPECT_EQ(plan.env_color_offsets, (std::vector<Offset>{0, 0, 0, 0}));
}

TEST(Plan, TheTotalsAreThoseOfTheBatch) {
  const PlanData plan = plan_of({chain_of(2), {}, chain_of(1)});
  EXPECT_EQ(plan.env_count, 3);
  EXPECT_EQ(plan.cone_count, 3);
  EXPECT_EQ(plan.row_count, 9);
  EXPECT_EQ(plan.nonzero_count, 36 + 9);
}

TEST(Plan, ThePathChangesWhereTheHeaderSays) {
  EXPECT_EQ(choose_path(0, 0), EnvPath::empty);
  EXPECT_EQ(choose_path(64, 64), EnvPath::dense);
  EXPECT_EQ(choose_path(65, 65), EnvPath::sparse);
  EXPECT_EQ(choose_path(100, 2499), EnvPath::sparse);
  EXPECT_EQ(choose_path(100, 2500), EnvPath::dense);
  EXPECT_EQ(choose_path(1024, 1024 * 1024), EnvPath::dense);
  EXPECT_EQ(choose_path(1025, 1025 * 1025), EnvPath::sparse);
}

TEST(Plan, DenseConesAreSortedByKindAndRowsStably) {
  const PlanData plan = plan_of({environment_of({{ConeKind::friction, 3},
                                                 {ConeKind::unilateral, 1},
                                                 {ConeKind::friction, 2},
                                                 {ConeKind::box, 1},
                                                 {ConeKind::friction, 3},
                                                 {ConeKind::free, 1},
                                                 {ConeKind::unilateral, 1},
                                                 {ConeKind::friction, 6}},
                                                {})});
  EXPECT_EQ(plan.cone_order, (std::vector<Index>{5, 1, 6, 3, 2, 0, 4, 7}));
  const ConeCounts& counts = plan.counts[0];
  EXPECT_EQ(counts.free, 1);
  EXPECT_EQ(counts.unilateral, 2);
  EXPECT_EQ(counts.box, 1);
  EXPECT_EQ(std::vector<Index>(std::begin(counts.friction), std::end(counts.friction)),
            (std::vector<Index>{0, 0, 1, 2, 0, 0, 1}));
}

// Rows: 3, 4, 3, 3. Among the 3-row environments the one with more free cones comes first, then more unilateral ones,
// equal shapes by index.
TEST(Plan, DenseEnvironmentsComeLargestFirstWithEqualShapesTogether) {
  const auto three_unilateral = environment_of(std::vector<ConeSpec>(3, {ConeKind::unilateral, 1}), {});
  const auto with_a_free_row =
      environment_of({{ConeKind::unilateral, 1}, {ConeKind::unilateral, 1}, {ConeKind::free, 1}}, {});
  const auto four_boxes = environment_of(std::vector<ConeSpec>(4, {ConeKind::box, 1}), {});
  const PlanData plan = plan_of({three_unilateral, four_boxes, chain_of(1), with_a_free_row, three_unilateral});
  EXPECT_EQ(plan.dense_order, (std::vector<Offset>{1, 3, 0, 4, 2}));
}

TEST(Plan, SparseEnvironmentsComeByStoredEntriesThenIndex) {
  const PlanData plan = plan_of({chain_of(30), chain_of(40), chain_of(1), chain_of(30)});
  EXPECT_EQ(plan.sparse_order, (std::vector<Offset>{1, 0, 3}));
  EXPECT_EQ(plan.dense_order, std::vector<Offset>{2});
}

// Nothing is joined: one colour, in it unilateral (kind 1) before friction (kind 3), by index.
TEST(Plan, VerticesOfOneColourAreSortedByKindRowsAndIndex) {
  const PlanData plan = plan_of({environment_of(seventy_five_rows(), {})});
  ASSERT_EQ(plan.path[0], EnvPath::sparse);
  EXPECT_EQ(colors_of(plan, 0), (std::vector<Index>{0, 45}));
  std::vector<Index> expected(45);
  std::iota(expected.begin(), expected.begin() + 30, 15);
  std::iota(expected.begin() + 30, expected.end(), 0);
  EXPECT_EQ(plan.cone_order, expected);
}

// Cone 2 is joined with 0, 1 and 3. It has the largest degree and colour 0, as has everything that is not joined; 0,
// 1, 3 get 1.
TEST(Plan, ConesJoinedByAnEntryEitherWayRoundGetDifferentColours) {
  for (const bool one_sided : {false, true}) {
    const PlanData plan = plan_of({environment_of(seventy_five_rows(), {{0, 2}, {1, 2}, {2, 3}}, one_sided)});
    EXPECT_EQ(colors_of(plan, 0), (std::vector<Index>{0, 42, 45}));
    EXPECT_EQ(part(plan.cone_order, 42, 45), (std::vector<Index>{0, 1, 3}));
    EXPECT_EQ(plan.cone_order[30], 2);
  }
}

// Cones 0 1 | 2 | 3 4 form the groups 7, 7 | none | 7, 7. The run is broken by cone 2, so that 3 4 is another vertex.
TEST(Plan, NeighbouringConesOfOneGroupAreOneVertex) {
  auto cones = seventy_five_rows();
  for (const int c : {0, 1, 3, 4}) cones[at(c)].group = 7;
  const PlanData plan = plan_of({environment_of(cones, {{0, 1}, {3, 4}})});
  EXPECT_EQ(colors_of(plan, 0), (std::vector<Index>{0, 43})) << "cones of one vertex do not conflict";
  // 30 unilateral vertices; then friction by rows: singles 2, 5..14 before the two manifolds of 6 rows.
  EXPECT_EQ(part(plan.cone_order, 30, 45), (std::vector<Index>{2, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 0, 1, 3, 4}));
  const std::vector<Index> vertices = vertices_of(plan, 0);
  EXPECT_EQ(part(vertices, 40, 44), (std::vector<Index>{40, 41, 43, 45}));
}

TEST(Plan, NegativeGroupsAndGroupsOfSeveralEnvironmentsAreNotMerged) {
  auto cones = seventy_five_rows();
  cones.front().group = cones.back().group = 3;
  const PlanData plan = plan_of({environment_of(cones, {}), environment_of(cones, {})});
  EXPECT_EQ(vertices_of(plan, 0).size(), 46U);
  EXPECT_EQ(vertices_of(plan, 0), vertices_of(plan, 1));
}

TEST(Plan, ColoursNeverJoinConflictingCones) {
  std::mt19937 random(11);
  ContactBatch<double> batch;
  for (int e = 0; e < 300; ++e) batch.add(random_environment(random));
  const PlanData plan = make_plan(batch.view());
  EXPECT_GT(plan.sparse_order.size(), 50U) << "the test must reach the sparse path";
  for (Offset env = 0; env < batch.env_count(); ++env) expect_sound(batch.view(), plan, env);
}

TEST(Plan, PermutingEnvironmentsPermutesEachPartAndNothingElse) {
  std::mt19937 random(12);
  ContactBatch<double> batch;
  for (int e = 0; e < 200; ++e) batch.add(random_environment(random));
  std::vector<Offset> order(200);
  std::iota(order.begin(), order.end(), Offset{0});
  for (std::size_t i = order.size() - 1; i > 0; --i) std::swap(order[i], order[random() % (i + 1)]);
  const ContactBatch<double> permuted = gather(batch, std::span<const Offset>(order));

  const PlanData plan = make_plan(batch.view()), other = make_plan(permuted.view());
  for (Offset env = 0; env < permuted.env_count(); ++env) {
    const Offset source = order[at(env)];
    EXPECT_EQ(other.path[at(env)], plan.path[at(source)]);
    EXPECT_TRUE(other.counts[at(env)] == plan.counts[at(source)]);
    EXPECT_EQ(vertices_of(other, env), vertices_of(plan, source));
    EXPECT_EQ(colors_of(other, env), colors_of(plan, source));
    const auto cones = [](const ContactBatch<double>& b, const PlanData& p, Offset e) {
      return part(p.cone_order, b.arrays().env_cone_offsets[at(e)], b.arrays().env_cone_offsets[at(e) + 1]);
    };
    EXPECT_EQ(cones(permuted, other, env), cones(batch, plan, source));
  }
}

TEST(Plan, ValuesAndPrecisionDoNotReachIt) {
  std::mt19937 random(13);
  ContactBatch<double> batch;
  for (int e = 0; e < 40; ++e) batch.add(random_environment(random));
  auto arrays = batch.arrays();
  for (double& value : arrays.A) value = static_cast<double>(random());
  const PlanData plan = make_plan(batch.view());
  const PlanData other = make_plan(convert<float>(ContactBatch<double>::from_arrays(Law::coulomb, arrays)).view());
  EXPECT_EQ(other.cone_order, plan.cone_order);
  EXPECT_EQ(other.color_offsets, plan.color_offsets);
  EXPECT_EQ(other.vertex_offsets, plan.vertex_offsets);
  EXPECT_EQ(other.dense_order, plan.dense_order);
  EXPECT_EQ(other.sparse_order, plan.sparse_order);
}

TEST(Plan, AChainOfTenThousandContactsNeedsTwoOrThreeColours) {
  ContactBatch<double> batch;
  batch.add(chain_of(10000));
  const PlanData plan = make_plan(batch.view());
  ASSERT_EQ(plan.path[0], EnvPath::sparse);
  expect_sound(batch.view(), plan, 0);
  // Inner cones are coloured along the chain, 0 1 0 1 ...; the ends come last and never need a third colour.
  EXPECT_EQ(colors_of(plan, 0), (std::vector<Index>{0, 5000, 10000}));
}

// One cone that is joined with all others makes a quadratic plan show: 10^5 cones would take minutes.
TEST(Plan, AHundredThousandConesAroundAHubArePlannedWithoutQuadraticWork) {
  constexpr int kCones = 100000;
  std::vector<std::pair<int, int>> joined;
  for (int c = 1; c < kCones; ++c) joined.emplace_back(0, c);
  const auto environment = environment_of(std::vector<ConeSpec>(kCones, {ConeKind::unilateral, 1}), joined);
  ContactBatch<double> batch;
  batch.add(environment);
  const auto start = std::chrono::steady_clock::now();
  const PlanData plan = make_plan(batch.view());
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  EXPECT_EQ(colors_of(plan, 0), (std::vector<Index>{0, 1, kCones}));
  EXPECT_LT(seconds.count(), 5.0) << "quadratic work would take minutes; a sanitizer build takes a second";
}

TEST(Plan, SixteenThousandEnvironmentsArePlannedInOneCall) {
  std::mt19937 random(14);
  std::vector<Environment<double>> kinds;
  for (int k = 0; k < 16; ++k) kinds.push_back(chain_of(1 + k));
  ContactBatch<double> batch;
  for (int e = 0; e < 16384; ++e) batch.add(kinds[random() % kinds.size()]);
  const PlanData plan = make_plan(batch.view());
  ASSERT_EQ(plan.dense_order.size(), 16384U);
  for (std::size_t i = 1; i < plan.dense_order.size(); ++i) {
    const Offset a = plan.dense_order[i - 1], b = plan.dense_order[i];
    const Index left = row_count(plan.counts[at(a)]), right = row_count(plan.counts[at(b)]);
    ASSERT_TRUE(left > right || (left == right && a < b)) << "position " << i;
  }
}

}  // namespace
