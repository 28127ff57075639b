#pragma once

/// \file
/// Which bodies touch, from step to step: islands, colours, drawings (docs/howto/contact_graph.md).

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "stiction/types.hpp"

namespace stiction {

/// The world: a body that is always there, never moves and is not counted.
inline constexpr Index kWorldBody = -1;

/// Role of a body in the graph.
enum class BodyRole : std::uint8_t {
  moving = 0,  ///< a vertex of the graph
  fixed = 1,   ///< never moves, like the world: it neither joins islands nor sets contacts in conflict
};

/// One contact of a simulation step.
struct GraphContact {
  std::uint64_t id = 0;       ///< names the contact across steps; unique among those present
  Index body_a = kWorldBody;  ///< either body may be the world or fixed, but not both
  Index body_b = kWorldBody;  ///< the other body

  bool operator==(const GraphContact&) const = default;
};

/// All contacts of one pair of bodies, as one vertex of the conflict graph.
struct GraphManifold {
  Index body_a = kWorldBody;  ///< the smaller index
  Index body_b = kWorldBody;  ///< the larger index
  Index contact_count = 0;    ///< weight of the edge, >= 1
  Index color = 0;            ///< 0, 1, ..

  bool operator==(const GraphManifold&) const = default;
};

/// Moving bodies that are joined by contacts, directly or through others; a body that touches none is an island of one.
struct GraphIsland {
  std::vector<Index> bodies;  ///< ascending; the first is the island's number
  Offset contact_count = 0;   ///< contacts between them and with fixed bodies

  bool operator==(const GraphIsland&) const = default;
};

/// Kind of a change, and the work it caused. The work depends on the route taken; the graph that results does not.
struct GraphChange {
  Offset added = 0;                ///< contacts that are new
  Offset removed = 0;              ///< contacts that are gone
  Offset moved = 0;                ///< contacts whose id stayed and whose pair of bodies is another
  Offset kept = 0;                 ///< contacts that stayed as they were; counted by update() alone
  Offset evaluated_manifolds = 0;  ///< manifolds whose colour was evaluated again
  Offset recolored_manifolds = 0;  ///< manifolds that were there and now have another colour
  Offset searched_edges = 0;       ///< edges followed to find out which islands fell apart
  Offset rebuilt_islands = 0;      ///< 1: so much fell apart that islands were found anew, from all edges
};

/// Numbers of a whole graph. Means over nothing are 0.
struct GraphStatistics {
  Offset moving_count = 0;              ///< n, vertices
  Offset fixed_count = 0;               ///< without the world
  Offset contact_count = 0;             ///< all contacts
  Offset manifold_count = 0;            ///< pairs of bodies in contact, fixed bodies included
  Offset edge_count = 0;                ///< e, pairs of moving bodies in contact
  double density = 0;                   ///< 2 e / n^2, the filled share of the adjacency matrix; its diagonal is empty
  Index min_degree = 0;                 ///< moving bodies that a moving body touches: least
  double mean_degree = 0;               ///< mean
  Index max_degree = 0;                 ///< most
  Offset island_count = 0;              ///< islands
  Offset largest_island = 0;            ///< moving bodies of the largest island
  double mean_contacts_per_island = 0;  ///< islands without contacts counted as well
  Offset max_contacts_per_island = 0;   ///< most
  Index color_count = 0;                ///< colours of the manifolds
};

/// Which bodies touch, kept from step to step: vertices are moving bodies, edges are the pairs that touch, weighted by
/// their number of contacts. Islands and a colouring of the manifolds are maintained under every change, in integers.
///
/// **The state depends on the contacts present, never on the changes that led there.** An island's number is its
/// smallest body. The colouring is the greedy one in a fixed order of priority, a scrambled form of the pair of
/// indices (docs/howto/contact_graph.md). Every manifold has the smallest colour that no manifold of higher priority
/// has with which it shares a moving body. A random order of greedy colouring: Jones and Plassmann (1993).
///
/// Costs below: d is the largest number of manifolds at a moving body, k the manifolds evaluated for colour
/// (GraphChange::evaluated_manifolds). For indices without a pattern that defeats the scrambling, a changed manifold
/// makes k <= e^(2d) on average whatever the size of the graph. In practice that is a few. The worst case is every
/// manifold of the island. Colour work is O(k (d + log k)). Hash tables make all bounds expected ones. Memory is
/// O(largest body index + most contacts ever present).
///
/// Functions throw before anything is changed. Const functions may run at the same time as each other. A graph that was
/// moved from may be assigned to or destroyed, no more.
class ContactGraph {
 public:
  /// A graph without bodies.
  ContactGraph();
  ContactGraph(const ContactGraph& other);
  ContactGraph(ContactGraph&& other) noexcept;
  ContactGraph& operator=(const ContactGraph& other);
  ContactGraph& operator=(ContactGraph&& other) noexcept;
  ~ContactGraph();

  /// Adds a body without contacts. Amortised O(1) while the largest index is of the order of the number of bodies:
  /// there is memory for every index up to it. \throws Error(invalid_argument) for a negative index or one present.
  void add_body(Index body, BodyRole role = BodyRole::moving);

  /// Removes a body and its contacts; the cost is that of removing them, searches bounded as in update(). \throws
  /// Error(invalid_argument) if there is no such body.
  GraphChange remove_body(Index body);

  /// Adds a contact. It costs O(1) if the pair touched already. Else it costs the colour work, and for two islands
  /// that become one O(s log n) with s the bodies of the smaller. \throws Error(invalid_argument) for an id that is
  /// present, a body that is not, or a body in contact with itself. Also for two bodies that both never move.
  GraphChange add_contact(const GraphContact& contact);

  /// Removes a contact. It costs O(1) if others of the pair remain. Else it costs the colour work, and two alternating
  /// searches from both bodies that end when they meet or one side is exhausted. If the island falls apart, that is
  /// O(manifolds of the side with fewer + s log n) with s the bodies of that side. If not, it is O(manifolds followed
  /// until the searches meet), which on one long cycle is all of them. \throws Error(invalid_argument) if there is no
  /// such id.
  GraphChange remove_contact(std::uint64_t id);

  /// Gives the contact of that id another pair of bodies: O(1) if the pair is the same, else remove and add. \throws
  /// Error(invalid_argument) as those do.
  GraphChange update_contact(const GraphContact& contact);

  /// Makes `contacts` the contacts present: other ids go, new ones come, the rest stay or move to another pair. To
  /// compare costs O(contacts before + contacts in the list), and the differences have the costs above. The searches
  /// together are bounded by O(n + manifolds + contacts removed), because after so many steps islands are found anew.
  /// Colours are settled once for all differences. The list's order does not matter. \throws Error(invalid_argument)
  /// as add_contact does, and for an id that occurs twice.
  GraphChange update(std::span<const GraphContact> contacts);

  /// Finds islands and colours from nothing but the contacts. O(n log n + manifolds (d + log manifolds)). Nothing that
  /// can be read changes: the result is compared with the maintained state.
  void rebuild();

  [[nodiscard]] bool has_body(Index body) const noexcept;           ///< O(1); the world is present
  [[nodiscard]] bool has_contact(std::uint64_t id) const noexcept;  ///< O(1)
  [[nodiscard]] BodyRole role(Index body) const;                    ///< O(1). \throws Error if not present
  [[nodiscard]] GraphContact contact(std::uint64_t id) const;       ///< O(1), as given. \throws Error if not present
  [[nodiscard]] Index color(std::uint64_t id) const;                ///< O(1), its manifold's. \throws as contact()
  [[nodiscard]] Index contact_count(Index body_a, Index body_b) const noexcept;  ///< O(1), 0: they do not touch

  /// Moving bodies that `body` touches. O(1). \throws Error(invalid_argument) if it is not present or is the world.
  [[nodiscard]] Index degree(Index body) const;

  /// The smallest body of the island of `body`, -1 if that never moves. O(1). \throws Error(invalid_argument) if it is
  /// not present.
  [[nodiscard]] Index island(Index body) const;

  [[nodiscard]] GraphStatistics statistics() const;            ///< O(1)
  [[nodiscard]] std::vector<Index> bodies() const;             ///< ascending, both roles. O(largest index)
  [[nodiscard]] std::vector<GraphContact> contacts() const;    ///< by id. O(contacts log contacts)
  [[nodiscard]] std::vector<GraphManifold> manifolds() const;  ///< by pair. O(manifolds log manifolds)
  [[nodiscard]] std::vector<GraphIsland> islands() const;      ///< by number. O(n + islands log islands)

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// The most bodies that an island may have where its spectrum is computed: the work is cubic.
inline constexpr Index kMaxSpectrumBodies = 512;

/// Computes the eigenvalues of the weighted Laplacian L = D - W of the moving bodies, ascending, one for each body.
/// W_ij is the number of contacts of i and j, D_ii the sum of row i. Contacts with fixed bodies have no part. As many
/// are zero (to rounding) as there are islands. Each island's matrix is made tridiagonal by Householder (1958)
/// reflections, whose eigenvalues are bisected with Sturm sequences (Givens 1954), O(s^3) for s bodies. \throws
/// Error(unsupported) for an island of more than kMaxSpectrumBodies.
std::vector<double> laplacian_spectrum(const ContactGraph& graph);

/// Writes the graph in the DOT language of Graphviz. Islands are boxed as clusters. A manifold is an edge in its
/// colour, its label and weight the number of contacts. Each contact with a fixed body ends in a separate small
/// square.
std::string to_dot(const ContactGraph& graph, const std::string& title = "contact graph");

/// Draws a picture that needs no other program. Islands are in boxes, laid out by stress (Gansner, Koren and
/// North 2004) up to 512 bodies and as a spiral beyond. Edges have their manifold's colour, wider for more contacts.
/// Contacts with fixed bodies are short lines to hatched ground. There is a legend, and the Laplacian spectrum unless
/// an island is too large for it. The same graph gives the same text.
std::string to_svg(const ContactGraph& graph, const std::string& title = "contact graph");

}  // namespace stiction
