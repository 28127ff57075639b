#pragma once

#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "core/graph/slots.hpp"
#include "core/graph/tally.hpp"
#include "stiction/contact_graph.hpp"

namespace stiction::graph {

struct Body {
  bool present = false;
  bool moves = false;
  Index degree = 0;              ///< manifolds with another moving body
  std::vector<Index> manifolds;  ///< slots, in no order that matters
};

struct Manifold {
  std::array<Index, 2> body{kWorldBody, kWorldBody};  ///< the smaller index first
  std::array<Index, 2> place{-1, -1};                 ///< position in each body's list
  std::uint64_t priority = 0;                         ///< the smaller goes first; no two manifolds share one
  std::vector<Index> contacts;                        ///< slots; empty: the slot is free
};

/// The pair in one word, the smaller index in the upper half; the world is the largest word of its half.
inline std::uint64_t pair_key(Index a, Index b) {
  const auto word = [](Index i) { return static_cast<std::uint64_t>(static_cast<std::uint32_t>(i)); };
  return a < b ? word(a) << 32 | word(b) : word(b) << 32 | word(a);
}

/// Place of a pair in the order of priority: the finaliser of SplitMix64 (Steele, Lea and Flood 2014). It is one to
/// one, so there are no ties, and neighbours in index are strangers in the order.
inline std::uint64_t priority_of(std::uint64_t key) {
  std::uint64_t x = key + 0x9e3779b97f4a7c15U;
  x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9U;
  x = (x ^ x >> 27) * 0x94d049bb133111ebU;
  return x ^ x >> 31;
}

/// Bodies and manifolds, which are neighbours, and nothing derived but degrees.
class BodyGraph {
 public:
  void add_body(Index body, bool moves);
  /// The body must have no manifold left.
  void remove_body(Index body);
  /// Slot of the manifold of the pair, -1: they do not touch.
  [[nodiscard]] Index find(Index a, Index b) const;
  Index add_manifold(Index a, Index b);
  /// The manifold must have no contact left.
  void remove_manifold(Index slot);

  [[nodiscard]] bool present(Index body) const {
    return body == kWorldBody || (body >= 0 && body < body_end() && bodies_[at(body)].present);
  }
  [[nodiscard]] bool moves(Index body) const { return body >= 0 && bodies_[at(body)].moves; }
  [[nodiscard]] Index body_end() const { return static_cast<Index>(bodies_.size()); }
  [[nodiscard]] const Body& body(Index index) const { return bodies_[at(index)]; }
  [[nodiscard]] Manifold& manifold(Index slot) { return manifolds_[slot]; }
  [[nodiscard]] const Manifold& manifold(Index slot) const { return manifolds_[slot]; }
  [[nodiscard]] Index manifold_end() const { return manifolds_.end(); }
  [[nodiscard]] Offset manifold_count() const { return manifolds_.count(); }
  [[nodiscard]] Offset moving_count() const { return moving_count_; }
  [[nodiscard]] Offset fixed_count() const { return fixed_count_; }
  [[nodiscard]] Offset edge_count() const { return edge_count_; }
  [[nodiscard]] const Tally& degrees() const { return degrees_; }

  /// Returns true if both bodies move.
  [[nodiscard]] bool is_edge(const Manifold& m) const { return moves(m.body[0]) && moves(m.body[1]); }
  /// The body across from `body`.
  [[nodiscard]] static Index across(const Manifold& m, Index body) { return m.body[0] == body ? m.body[1] : m.body[0]; }
  /// The moving body that accounts for the manifold's contacts.
  [[nodiscard]] Index owner(const Manifold& m) const { return moves(m.body[0]) ? m.body[0] : m.body[1]; }

 private:
  void set_degree(Body& body, Index degree);

  std::vector<Body> bodies_;
  Slots<Manifold> manifolds_;
  std::unordered_map<std::uint64_t, Index> slot_of_pair_;
  Tally degrees_;
  Offset moving_count_ = 0, fixed_count_ = 0, edge_count_ = 0;
};

}  // namespace stiction::graph
