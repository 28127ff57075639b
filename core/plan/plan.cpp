#include "core/plan/plan.hpp"

#include <algorithm>
#include <array>
#include <numeric>
#include <span>
#include <tuple>
#include <unordered_map>
#include <utility>

#include "core/base/extents.hpp"
#include "core/job/cone_blocks.hpp"
#include "core/plan/color.hpp"

namespace stiction {
namespace {

/// One environment of a batch. Cones and rows count from the environment's own zero.
struct EnvStructure {
  const BatchStructure& all;
  Offset env, first_row, first_cone;
  Index rows, cones;

  EnvStructure(const BatchStructure& structure, Offset number)
      : all(structure),
        env(number),
        first_row(structure.env_row_offsets[number]),
        first_cone(structure.env_cone_offsets[number]),
        rows(structure.env_rows(number)),
        cones(structure.env_cones(number)) {}

  [[nodiscard]] ConeKind kind(Index cone) const { return all.cone_kind[first_cone + cone]; }
  [[nodiscard]] Index cone_begin(Index cone) const {
    return static_cast<Index>(all.cone_row_offsets[first_cone + cone] - first_row);
  }
  [[nodiscard]] Index cone_rows(Index cone) const { return cone_begin(cone + 1) - cone_begin(cone); }
  [[nodiscard]] Index group(Index cone) const { return all.cone_group ? all.cone_group[first_cone + cone] : -1; }
  [[nodiscard]] Offset factor_entries() const {
    return all.factor_offsets ? all.factor_offsets[env + 1] - all.factor_offsets[env] : 0;
  }
  [[nodiscard]] EnvPath path(const ConeCounts& counts) const {
    return rows > 0 && factor_entries() > 0 ? EnvPath::factor : choose_path(rows, nonzeros(), counts.semidefinite > 0);
  }
  [[nodiscard]] Index entries(Index row) const {
    const Offset i = first_row + row;
    return all.row_counts ? all.row_counts[i] : static_cast<Index>(all.row_offsets[i + 1] - all.row_offsets[i]);
  }
  [[nodiscard]] const Index* columns(Index row) const {
    return all.column + (all.column_offsets ? all.column_offsets : all.row_offsets)[first_row + row];
  }
  /// Room of the stored entries, unused ones between rows included.
  [[nodiscard]] Offset entry_span() const { return all.row_offsets[first_row + rows] - all.row_offsets[first_row]; }
  /// Stored entries: the same for an environment with room between its rows as for one without.
  [[nodiscard]] Offset nonzeros() const {
    if (all.row_counts == nullptr) return entry_span();
    Offset sum = 0;
    for (Index row = 0; row < rows; ++row) sum += entries(row);
    return sum;
  }
};

ConeCounts count_cones(const EnvStructure& env) {
  ConeCounts counts;
  for (Index c = 0; c < env.cones; ++c) {
    switch (env.kind(c)) {
      case ConeKind::free:
        ++counts.free;
        break;
      case ConeKind::unilateral:
        ++counts.unilateral;
        break;
      case ConeKind::box:
        ++counts.box;
        break;
      case ConeKind::box_friction:
      case ConeKind::semidefinite:
        ++(env.kind(c) == ConeKind::semidefinite ? counts.semidefinite : counts.box_friction);
        [[fallthrough]];
      case ConeKind::friction:
        ++counts.friction[at(env.cone_rows(c))];
        break;
    }
  }
  return counts;
}

/// Cones by kind and row count: each goes behind those of its shape that came before, or to its place among blocks.
void write_canonical_order(const EnvStructure& env, const ConeCounts& counts, Index* cone_order) {
  if (env.all.block_visits > 1) {
    for (Index c = 0; c < env.cones; ++c) cone_order[place_of(env.group(c))] = c;
    return;
  }
  const auto shape_of = [&](Index c) { return stiction::shape_of(env.kind(c), env.cone_rows(c)); };
  // Cones that are all alike are in that order already.
  if (env.cones == 0 || shape_count(counts, shape_of(0)) == env.cones) {
    std::iota(cone_order, cone_order + env.cones, 0);
    return;
  }
  std::array<Index, kConeShapes> next{};
  Index place = 0;
  for (int shape = 0; shape < kConeShapes; ++shape) {
    next[static_cast<std::size_t>(shape)] = place;
    place += shape_count(counts, shape);
  }
  for (Index c = 0; c < env.cones; ++c) cone_order[next[at(shape_of(c))]++] = c;
}

/// Symmetric graph in CSR form, each neighbour once.
struct Graph {
  std::vector<Index> offsets, neighbours;
};

/// The vertices of a sparse environment and how they conflict. Its vectors are kept from one environment to the next.
class SparsePlanner {
 public:
  void append(const EnvStructure& env, PlanData& plan) {
    find_vertices(env);
    find_conflicts(env);
    const Coloring coloring = color_graph(conflicts_.offsets, conflicts_.neighbours);
    sort_vertices(env, coloring);

    Index position = 0;
    Index* const cone_order = plan.cone_order.data() + env.first_cone;
    plan.vertex_offsets.push_back(0);
    for (const Index v : order_) {
      for (Index k = vertex_begin_[at(v)]; k < vertex_begin_[at(v) + 1]; ++k) cone_order[position++] = cones_[at(k)];
      plan.vertex_offsets.push_back(position);
    }

    std::vector<Index> color_end(at(coloring.color_count) + 1, 0);
    for (const Index color : coloring.color) ++color_end[at(color) + 1];
    std::partial_sum(color_end.begin(), color_end.end(), color_end.begin());
    plan.color_offsets.insert(plan.color_offsets.end(), color_end.begin(), color_end.end());
    plan.color_count[static_cast<std::size_t>(env.env)] = coloring.color_count;
  }

 private:
  [[nodiscard]] Index vertex_count() const { return static_cast<Index>(vertex_begin_.size()) - 1; }

  /// Blocks, or runs of neighbouring cones with one non-negative group, else cones; vertex_of_row_ for the edges.
  void find_vertices(const EnvStructure& env) {
    const bool has_blocks = env.all.block_visits > 1;
    cones_.resize(at(env.cones));
    for (Index c = 0; c < env.cones; ++c) cones_[at(has_blocks ? place_of(env.group(c)) : c)] = c;
    vertex_begin_.assign(1, 0);
    vertex_of_row_.resize(at(env.rows));
    for (Index p = 0; p < env.cones; ++p) {
      const Index c = cones_[at(p)];
      const bool goes_on =
          has_blocks ? !begins_block(env.group(c)) : c > 0 && env.group(c) >= 0 && env.group(c) == env.group(c - 1);
      if (!goes_on && p > 0) vertex_begin_.push_back(p);
      const auto vertex = static_cast<Index>(vertex_begin_.size()) - 1;
      std::fill(vertex_of_row_.begin() + env.cone_begin(c), vertex_of_row_.begin() + env.cone_begin(c + 1), vertex);
    }
    vertex_begin_.push_back(env.cones);
  }

  /// Two vertices conflict if any stored entry, whatever its value, joins their rows either way round.
  void find_conflicts(const EnvStructure& env) {
    const Index vertices = vertex_count();
    stamp_.assign(at(vertices), -1);
    directed_.offsets.assign(1, 0);
    directed_.neighbours.clear();
    for (Index v = 0; v < vertices; ++v) {
      stamp_[at(v)] = v;
      for (Index c = vertex_begin_[at(v)]; c < vertex_begin_[at(v) + 1]; ++c) {
        const Index cone = cones_[at(c)];
        for (Index row = env.cone_begin(cone); row < env.cone_begin(cone + 1); ++row) {
          const Index* columns = env.columns(row);
          const Index count = env.entries(row);
          for (Index k = 0; k < count; ++k) add_once(directed_, v, vertex_of_row_[at(columns[k])]);
        }
      }
      directed_.offsets.push_back(static_cast<Index>(directed_.neighbours.size()));
    }
    transpose(directed_, transposed_);

    stamp_.assign(at(vertices), -1);
    conflicts_.offsets.assign(1, 0);
    conflicts_.neighbours.clear();
    for (Index v = 0; v < vertices; ++v) {
      for (const Graph* half : {&directed_, &transposed_}) {
        for (Index k = half->offsets[at(v)]; k < half->offsets[at(v) + 1]; ++k) {
          add_once(conflicts_, v, half->neighbours[at(k)]);
        }
      }
      conflicts_.offsets.push_back(static_cast<Index>(conflicts_.neighbours.size()));
    }
  }

  void add_once(Graph& graph, Index v, Index neighbour) {
    if (stamp_[at(neighbour)] == v) return;
    stamp_[at(neighbour)] = v;
    graph.neighbours.push_back(neighbour);
  }

  static void transpose(const Graph& graph, Graph& result) {
    const std::size_t vertices = graph.offsets.size() - 1;
    result.offsets.assign(vertices + 1, 0);
    for (const Index u : graph.neighbours) ++result.offsets[at(u) + 1];
    std::partial_sum(result.offsets.begin(), result.offsets.end(), result.offsets.begin());
    result.neighbours.resize(graph.neighbours.size());
    std::vector<Index> next(result.offsets.begin(), result.offsets.end() - 1);
    for (std::size_t v = 0; v < vertices; ++v) {
      for (Index k = graph.offsets[v]; k < graph.offsets[v + 1]; ++k) {
        result.neighbours[at(next[at(graph.neighbours[at(k)])]++)] = static_cast<Index>(v);
      }
    }
  }

  /// By colour; in a colour by kind of the first cone, then rows, so that neighbouring lanes run the same code.
  void sort_vertices(const EnvStructure& env, const Coloring& coloring) {
    order_.resize(at(vertex_count()));
    std::iota(order_.begin(), order_.end(), 0);
    const auto key = [&](Index v) {
      return std::tuple(coloring.color[at(v)], env.kind(cones_[at(vertex_begin_[at(v)])]), rows_of(env, v), v);
    };
    std::sort(order_.begin(), order_.end(), [&](Index a, Index b) { return key(a) < key(b); });
  }

  [[nodiscard]] Index rows_of(const EnvStructure& env, Index vertex) const {
    Index rows = 0;
    for (Index k = vertex_begin_[at(vertex)]; k < vertex_begin_[at(vertex) + 1]; ++k)
      rows += env.cone_rows(cones_[at(k)]);
    return rows;
  }

  std::vector<Index> cones_;          ///< by vertex
  std::vector<Index> vertex_begin_;   ///< where in cones_ each vertex begins, closed by the cone count
  std::vector<Index> vertex_of_row_;  ///< (rows)
  std::vector<Index> stamp_;          ///< stamp_[u] == v: u is already among v's neighbours
  std::vector<Index> order_;          ///< vertices as they are swept
  Graph directed_, transposed_, conflicts_;
};

/// Dense environments by rows, then by cones, then by index. Batches have far fewer shapes than environments: the
/// shapes are sorted, and the environments dealt out to them.
void sort_dense(PlanData& plan) {
  const auto counts_of = [&](Offset env) -> const ConeCounts& { return plan.counts[static_cast<std::size_t>(env)]; };
  const auto is_like_first = [&](Offset env) { return counts_of(env) == counts_of(plan.dense_order.front()); };
  if (std::all_of(plan.dense_order.begin(), plan.dense_order.end(), is_like_first)) return;
  const auto hash = [](const ConeCounts& counts) {
    std::size_t mixed = 0;
    for (int shape = 0; shape < kConeShapes; ++shape)
      mixed = (mixed ^ static_cast<std::size_t>(shape_count(counts, shape))) * 0x9E3779B97F4A7C15ULL;
    return mixed ^ (mixed >> 32);
  };
  struct Shape {
    ConeCounts counts;
    Index rows;
    std::vector<Offset> envs;
  };
  std::vector<Shape> shapes;
  std::unordered_map<ConeCounts, std::size_t, decltype(hash)> number(16, hash);
  const ConeCounts* last = nullptr;
  std::size_t shape = 0;
  for (const Offset env : plan.dense_order) {
    const ConeCounts& counts = counts_of(env);
    if (last == nullptr || *last != counts) {
      const auto [found, is_new] = number.try_emplace(counts, shapes.size());
      if (is_new) shapes.push_back({counts, row_count(counts), {}});
      shape = found->second;
    }
    last = &counts;
    shapes[shape].envs.push_back(env);
  }
  std::sort(shapes.begin(), shapes.end(),
            [](const Shape& a, const Shape& b) { return a.rows != b.rows ? a.rows > b.rows : a.counts > b.counts; });
  plan.dense_order.clear();
  for (const Shape& one : shapes) plan.dense_order.insert(plan.dense_order.end(), one.envs.begin(), one.envs.end());
}

/// Environments of one path, the most expensive first, so that none is left to run alone at the end. Ties end in the
/// index: the order is total, and no sort can leave a choice to the library.
void order_environments(const BatchStructure& structure, PlanData& plan) {
  for (Offset env = 0; env < plan.env_count; ++env) {
    const EnvPath path = plan.path[static_cast<std::size_t>(env)];
    if (path == EnvPath::dense) plan.dense_order.push_back(env);
    if (path == EnvPath::sparse) plan.sparse_order.push_back(env);
    if (path == EnvPath::factor) plan.factor_order.push_back(env);
  }
  sort_dense(plan);
  std::sort(plan.sparse_order.begin(), plan.sparse_order.end(), [&](Offset a, Offset b) {
    const Offset left = EnvStructure(structure, a).entry_span(), right = EnvStructure(structure, b).entry_span();
    return left != right ? left > right : a < b;
  });
  std::sort(plan.factor_order.begin(), plan.factor_order.end(), [&](Offset a, Offset b) {
    const Offset left = EnvStructure(structure, a).factor_entries();
    const Offset right = EnvStructure(structure, b).factor_entries();
    return left != right ? left > right : a < b;
  });
  for (const Offset env : plan.sparse_order) plan.sparse_nonzeros.push_back(EnvStructure(structure, env).entry_span());
}

/// Plans the part that every environment has. The others' order of cones is left to be found.
void plan_dense(const BatchStructure& structure, const ParallelFor& parallel_for, PlanData& plan) {
  const auto envs = static_cast<std::size_t>(structure.env_count);
  plan.counts.resize(envs);
  plan.path.resize(envs);
  plan.color_count.resize(envs);
  plan.cone_order.resize(static_cast<std::size_t>(structure.cone_count));
  parallel_for(structure.env_count, [&](Offset begin, Offset end) {
    for (Offset e = begin; e < end; ++e) {
      const EnvStructure env(structure, e);
      ConeCounts& counts = plan.counts[static_cast<std::size_t>(e)];
      counts = count_cones(env);
      const EnvPath path = plan.path[static_cast<std::size_t>(e)] = env.path(counts);
      if (path == EnvPath::dense) write_canonical_order(env, counts, plan.cone_order.data() + env.first_cone);
    }
  });
}

/// A dense environment's cones, taken in the plan's order, are sorted by kind and row count.
bool in_canonical_order(const EnvStructure& env, const Index* order) {
  int last = 0;
  for (Index p = 0; p < env.cones; ++p) {
    if (order[p] < 0 || order[p] >= env.cones) return false;
    const int shape = shape_of(env.kind(order[p]), env.cone_rows(order[p]));
    if (shape < last) return false;
    last = shape;
  }
  return true;
}

}  // namespace

PlanData make_plan(const BatchStructure& structure, const ParallelFor& parallel_for) {
  PlanData plan;
  plan.env_count = structure.env_count;
  plan.cone_count = structure.cone_count;
  plan.row_count = structure.row_count;
  plan.nonzero_count = structure.nonzero_count;
  plan_dense(structure, parallel_for, plan);
  const auto envs = static_cast<std::size_t>(structure.env_count);
  plan.dense_order.reserve(envs);
  plan.env_vertex_offsets.reserve(envs + 1);
  plan.env_color_offsets.reserve(envs + 1);
  plan.env_vertex_offsets.push_back(0);
  plan.env_color_offsets.push_back(0);
  SparsePlanner sparse;
  for (Offset e = 0; e < structure.env_count; ++e) {
    const EnvPath path = plan.path[static_cast<std::size_t>(e)];
    if (path == EnvPath::factor) {
      const EnvStructure env(structure, e);
      plan.most_dofs = larger_of(plan.most_dofs, static_cast<Index>(env.factor_entries() / env.rows));
    }
    if (path == EnvPath::sparse) sparse.append(EnvStructure(structure, e), plan);
    plan.env_vertex_offsets.push_back(static_cast<Offset>(plan.vertex_offsets.size()));
    plan.env_color_offsets.push_back(static_cast<Offset>(plan.color_offsets.size()));
  }
  order_environments(structure, plan);
  return plan;
}

bool fits(const PlanData& plan, const BatchStructure& structure, const ParallelFor& parallel_for) {
  if (plan.env_count != structure.env_count || plan.cone_count != structure.cone_count ||
      plan.row_count != structure.row_count || plan.nonzero_count != structure.nonzero_count)
    return false;
  const auto env_fits = [&](Offset e) {
    const EnvStructure env(structure, e);
    const auto index = static_cast<std::size_t>(e);
    const ConeCounts counts = count_cones(env);
    return plan.counts[index] == counts && plan.path[index] == env.path(counts) &&
           (plan.path[index] != EnvPath::dense || in_canonical_order(env, plan.cone_order.data() + env.first_cone));
  };
  std::vector<unsigned char> fitting(static_cast<std::size_t>(structure.env_count));
  parallel_for(structure.env_count, [&](Offset begin, Offset end) {
    for (Offset e = begin; e < end; ++e) fitting[static_cast<std::size_t>(e)] = env_fits(e) ? 1 : 0;
  });
  return std::find(fitting.begin(), fitting.end(), 0) == fitting.end();
}

}  // namespace stiction
