#include "core/graph/conflict_colors.hpp"

#include <algorithm>

namespace stiction::graph {
namespace {

/// Calls visit(neighbour slot) for every manifold that shares a moving body. Two pairs share at most one body, so none
/// is visited twice.
template <class Visit>
void for_each_conflict(const BodyGraph& graph, Index slot, Visit visit) {
  for (const Index body : graph.manifold(slot).body) {
    if (!graph.moves(body)) continue;
    for (const Index other : graph.body(body).manifolds) {
      if (other != slot) visit(other);
    }
  }
}

constexpr auto kLater = [](const auto& a, const auto& b) { return a.priority > b.priority; };

}  // namespace

void ConflictColors::set_color(Index slot, Index color) {
  Index& held = color_[at(slot)];
  if (held == color) return;
  if (held >= 0) used_.remove(held);
  if (color >= 0) used_.add(color);
  held = color;
}

void ConflictColors::wait(const BodyGraph& graph, Index slot) {
  if (waits_[at(slot)]) return;
  waits_[at(slot)] = true;
  queue_.push_back({graph.manifold(slot).priority, slot});
  std::push_heap(queue_.begin(), queue_.end(), kLater);
}

/// Only some of the manifolds after `slot` can change. They hold its new colour, or a colour above its old one, which
/// may be free now.
void ConflictColors::wait_for_change(const BodyGraph& graph, Index slot, Index before, Index after) {
  const std::uint64_t priority = graph.manifold(slot).priority;
  for_each_conflict(graph, slot, [&](Index other) {
    if (graph.manifold(other).priority < priority) return;
    const Index held = color_[at(other)];
    if (held == after || (before >= 0 && held > before)) wait(graph, other);
  });
}

void ConflictColors::manifold_added(Index slot) {
  if (at(slot) >= color_.size()) {
    color_.resize(at(slot) + 1, -1);
    waits_.resize(at(slot) + 1, false);
  }
  added_.push_back(slot);
}

void ConflictColors::manifold_removed(const BodyGraph& graph, Index slot) {
  const Index before = color_[at(slot)];
  set_color(slot, -1);
  if (before >= 0) wait_for_change(graph, slot, before, -2);
}

Index ConflictColors::smallest_free(const BodyGraph& graph, Index slot) {
  const std::uint64_t priority = graph.manifold(slot).priority;
  ++stamp_;
  for_each_conflict(graph, slot, [&](Index other) {
    const Index held = color_[at(other)];
    if (held < 0 || graph.manifold(other).priority > priority) return;
    if (at(held) >= taken_.size()) taken_.resize(at(held) + 1, 0);
    taken_[at(held)] = stamp_;
  });
  Index color = 0;
  while (at(color) < taken_.size() && taken_[at(color)] == stamp_) ++color;
  return color;
}

void ConflictColors::settle(const BodyGraph& graph, GraphChange& change) {
  for (const Index slot : added_) wait(graph, slot);
  added_.clear();
  while (!queue_.empty()) {
    std::pop_heap(queue_.begin(), queue_.end(), kLater);
    const Index slot = queue_.back().slot;
    queue_.pop_back();
    waits_[at(slot)] = false;
    if (graph.manifold(slot).contacts.empty()) continue;  // removed while it waited
    const Index before = color_[at(slot)];
    const Index after = smallest_free(graph, slot);
    ++change.evaluated_manifolds;
    if (before == after) continue;
    change.recolored_manifolds += before >= 0 ? 1 : 0;
    set_color(slot, after);
    wait_for_change(graph, slot, before, after);
  }
}

void ConflictColors::rebuild(const BodyGraph& graph) {
  std::vector<Waiting> order;
  for (Index slot = 0; slot < graph.manifold_end(); ++slot) {
    if (!graph.manifold(slot).contacts.empty()) order.push_back({graph.manifold(slot).priority, slot});
  }
  std::sort(order.begin(), order.end(), [](const Waiting& a, const Waiting& b) { return kLater(b, a); });
  used_.clear();
  std::fill(color_.begin(), color_.end(), -1);
  for (const Waiting& next : order) set_color(next.slot, smallest_free(graph, next.slot));
}

}  // namespace stiction::graph
