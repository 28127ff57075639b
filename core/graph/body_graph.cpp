#include "core/graph/body_graph.hpp"

namespace stiction::graph {

void BodyGraph::add_body(Index body, bool moves) {
  if (body >= body_end()) bodies_.resize(at(body) + 1);
  Body& added = bodies_[at(body)];
  added.present = true;
  added.moves = moves;
  if (moves) degrees_.add(0);
  ++(moves ? moving_count_ : fixed_count_);
}

void BodyGraph::remove_body(Index body) {
  Body& removed = bodies_[at(body)];
  if (removed.moves) degrees_.remove(0);
  --(removed.moves ? moving_count_ : fixed_count_);
  removed = Body{};
}

Index BodyGraph::find(Index a, Index b) const {
  const auto found = slot_of_pair_.find(pair_key(a, b));
  return found == slot_of_pair_.end() ? -1 : found->second;
}

void BodyGraph::set_degree(Body& body, Index degree) {
  degrees_.replace(body.degree, degree);
  body.degree = degree;
}

Index BodyGraph::add_manifold(Index a, Index b) {
  const std::uint64_t key = pair_key(a, b);
  Manifold added;
  added.body = a < b ? std::array{a, b} : std::array{b, a};
  added.priority = priority_of(key);
  const bool edge = is_edge(added);
  const Index slot = manifolds_.add(std::move(added));
  Manifold& m = manifolds_[slot];
  for (std::size_t end = 0; end < 2; ++end) {
    if (m.body[end] == kWorldBody) continue;
    Body& body = bodies_[at(m.body[end])];
    m.place[end] = static_cast<Index>(body.manifolds.size());
    body.manifolds.push_back(slot);
    if (edge) set_degree(body, body.degree + 1);
  }
  edge_count_ += edge ? 1 : 0;
  slot_of_pair_.emplace(key, slot);
  return slot;
}

void BodyGraph::remove_manifold(Index slot) {
  const Manifold& m = manifolds_[slot];
  const bool edge = is_edge(m);
  for (std::size_t end = 0; end < 2; ++end) {
    if (m.body[end] == kWorldBody) continue;
    Body& body = bodies_[at(m.body[end])];
    const Index last = body.manifolds.back();
    Manifold& moved = manifolds_[last];
    moved.place[moved.body[0] == m.body[end] ? 0 : 1] = m.place[end];
    body.manifolds[at(m.place[end])] = last;
    body.manifolds.pop_back();
    if (edge) set_degree(body, body.degree - 1);
  }
  edge_count_ -= edge ? 1 : 0;
  slot_of_pair_.erase(pair_key(m.body[0], m.body[1]));
  manifolds_.remove(slot);
}

}  // namespace stiction::graph
