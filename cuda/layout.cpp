#include "cuda/layout.hpp"

#include <algorithm>
#include <span>

#include "core/body/dense_system.hpp"
#include "core/body/sparse_system.hpp"

namespace stiction::cuda {

namespace {

constexpr Offset round_up(Offset value) {
  return (value + kWarp - 1) / kWarp * kWarp;
}

/// Appends launches, each of environments of one team and width whose workspaces lie side by side.
class LayoutBuilder {
 public:
  LayoutBuilder(Layout& layout, const LayoutRules& rules) : layout_(layout), rules_(rules) {}

  void open(Team team, int width) {
    layout_.launches.push_back(
        {team, width, static_cast<Offset>(layout_.envs.size()), 0, static_cast<Offset>(layout_.offsets.size())});
    cursor_ = 0;
  }

  /// Environments that share one workspace of `elements` numbers.
  void add(std::span<const Offset> envs, Offset elements) {
    const LaunchSpan& current = layout_.launches.back();
    if (cursor_ > 0 && cursor_ + elements > rules_.workspace_limit) open(current.team, current.width);
    layout_.offsets.push_back(cursor_);
    layout_.envs.insert(layout_.envs.end(), envs.begin(), envs.end());
    layout_.launches.back().env_count += static_cast<Offset>(envs.size());
    cursor_ += round_up(elements);
    layout_.workspace = std::max(layout_.workspace, cursor_);
  }

 private:
  Layout& layout_;
  const LayoutRules& rules_;
  Offset cursor_ = 0;
};

}  // namespace

int block_width(Index rows) {
  int width = kWarp;
  while (width < kWidestBlock && width < rows) width *= 2;
  return width;
}

Layout make_layout(const PlanData& plan, const LayoutRules& rules) {
  const auto counts = [&](Offset env) -> const ConeCounts& { return plan.counts[static_cast<std::size_t>(env)]; };
  Layout layout;
  LayoutBuilder builder(layout, rules);

  // Sparse environments are the most expensive: first, so that none is left to run alone at the end.
  for (int width = kWidestBlock; width >= kWarp; width /= 2) {
    bool opened = false;
    for (std::size_t k = 0; k < plan.sparse_order.size(); ++k) {
      const Offset env = plan.sparse_order[k];
      if (block_width(row_count(counts(env))) != width) continue;
      if (!opened) builder.open(Team::sparse_blocks, width);
      opened = true;
      builder.add({&env, 1}, SparseSystem<float>::elements(row_count(counts(env)), cone_count(counts(env)),
                                                           plan.sparse_nonzeros[k], rules.method_vectors));
    }
  }

  // dense_order falls in rows, so equal widths are neighbours and what threads take comes last.
  std::size_t next = 0;
  int width = 0;
  for (; next < plan.dense_order.size(); ++next) {
    const Offset env = plan.dense_order[next];
    const Index rows = row_count(counts(env));
    if (rows <= rules.thread_rows) break;
    if (block_width(rows) != width) builder.open(Team::dense_blocks, width = block_width(rows));
    builder.add({&env, 1}, DenseSystem<float>::elements(counts(env), rules.method_vectors));
  }

  // Empty environments only have a status to write; any thread can.
  std::vector<Offset> small(plan.dense_order.begin() + static_cast<std::ptrdiff_t>(next), plan.dense_order.end());
  for (Offset env = 0; env < plan.env_count; ++env)
    if (plan.path[static_cast<std::size_t>(env)] == EnvPath::empty) small.push_back(env);
  if (!small.empty()) builder.open(Team::threads, kThreadsWidth);
  for (std::size_t begin = 0; begin < small.size(); begin += kWarp) {
    const std::span<const Offset> warp(&small[begin], std::min<std::size_t>(kWarp, small.size() - begin));
    Offset largest = 0;
    for (const Offset env : warp)
      largest = std::max(largest, DenseSystem<float>::elements(counts(env), rules.method_vectors));
    builder.add(warp, kWarp * largest);
  }
  return layout;
}

}  // namespace stiction::cuda
