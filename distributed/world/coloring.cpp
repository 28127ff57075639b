#include "distributed/world/coloring.hpp"

#include <algorithm>
#include <bit>
#include <numeric>
#include <utility>
#include <vector>

#include "distributed/transport/letters.hpp"

namespace stiction::distributed {

namespace {

std::size_t at(Index place) {
  return static_cast<std::size_t>(place);
}

/// Colours in use at a body.
class ColorSet {
 public:
  void add(Index color) {
    if (at(color) / 64 >= words_.size()) words_.resize(at(color) / 64 + 1, 0);
    words_[at(color) / 64] |= std::uint64_t{1} << static_cast<unsigned>(color % 64);
  }
  void add(const ColorSet& other) {
    if (words_.size() < other.words_.size()) words_.resize(other.words_.size(), 0);
    for (std::size_t k = 0; k < other.words_.size(); ++k) words_[k] |= other.words_[k];
  }
  [[nodiscard]] Index smallest_free() const {
    Index color = 0;
    for (const std::uint64_t word : words_) {
      if (word != ~std::uint64_t{0}) return color + std::countr_one(word);
      color += 64;
    }
    return color;
  }
  void put(Letter& letter) const {
    letter.put(static_cast<std::uint32_t>(words_.size()));
    for (const std::uint64_t word : words_) letter.put(word);
  }
  static ColorSet take(Letter& letter) {
    ColorSet set;
    set.words_.resize(letter.take<std::uint32_t>());
    for (std::uint64_t& word : set.words_) word = letter.take<std::uint64_t>();
    return set;
  }

 private:
  std::vector<std::uint64_t> words_;
};

/// The vertices that this rank shares with another, in the whole's order, and their colours by others.
struct Border {
  int rank = 0;
  std::vector<Index> vertices;
  std::size_t sent = 0, received = 0;
  Letter letter;

  [[nodiscard]] bool is_done() const { return sent == vertices.size() && received == vertices.size(); }
};

class Coloring {
 public:
  Coloring(Transport& transport, const PieceBodies& bodies, std::span<const PushedBodies> vertices,
           std::span<Index> colors)
      : transport_(transport), bodies_(bodies), vertices_(vertices), colors_(colors) {
    std::fill(colors.begin(), colors.end(), -1);
    find_borders();
    sort_by_degree();
    list_by_body();
  }

  Index run(std::int64_t& waves) {
    color_what_can_be();
    while (!borders_.empty()) {
      ++waves;
      exchange_sets();
      std::erase_if(borders_, [](const Border& border) { return border.is_done(); });
      color_what_can_be();
    }
    Index count = 0;
    for (const Index color : colors_) count = std::max(count, color + 1);
    for (const Index other : gather(transport_, count)) count = std::max(count, other);
    return count;
  }

 private:
  [[nodiscard]] Index vertex_count() const { return static_cast<Index>(vertices_.size()); }
  /// The end of a vertex that is another rank's, or -1.
  [[nodiscard]] Index foreign_end(Index v) const {
    for (const Index body : {vertices_[at(v)].low, vertices_[at(v)].high})
      if (body >= 0 && !bodies_.owns(body)) return body;
    return -1;
  }
  template <class F>
  void for_each_own_end(Index v, F&& f) const {
    for (const Index body : {vertices_[at(v)].low, vertices_[at(v)].high})
      if (body >= 0 && bodies_.owns(body)) f(body);
  }
  Border* border_of(int rank) {
    for (Border& border : borders_)
      if (border.rank == rank) return &border;
    return nullptr;
  }

  void find_borders() {
    shared_place_.assign(vertices_.size(), 0);
    for (Index v = 0; v < vertex_count(); ++v) {
      const Index foreign = foreign_end(v);
      if (foreign < 0) continue;
      const int rank = bodies_.owner[at(foreign)];
      if (border_of(rank) == nullptr) borders_.emplace_back().rank = rank;
      Border& border = *border_of(rank);
      shared_place_[at(v)] = border.vertices.size();
      border.vertices.push_back(v);
    }
    std::sort(borders_.begin(), borders_.end(), [](const Border& a, const Border& b) { return a.rank < b.rank; });
  }

  /// order_: by decreasing sum of the bodies' degrees, then by place, as make_body_plan() has it.
  void sort_by_degree() {
    std::vector<Index> degree(bodies_.body.size(), 0);
    for (Index v = 0; v < vertex_count(); ++v) for_each_own_end(v, [&](Index body) { ++degree[at(body)]; });
    std::vector<std::vector<Index>> sent(borders_.size()), received(borders_.size());
    std::vector<Outgoing> out;
    std::vector<Incoming> in;
    for (std::size_t k = 0; k < borders_.size(); ++k) {
      for (const Index v : borders_[k].vertices)
        for_each_own_end(v, [&](Index body) { sent[k].push_back(degree[at(body)]); });
      received[k].resize(sent[k].size());
      out.push_back({borders_[k].rank, std::as_bytes(std::span(sent[k]))});
      in.push_back({borders_[k].rank, std::as_writable_bytes(std::span(received[k]))});
    }
    if (!out.empty()) transport_.exchange(out, in);
    for (std::size_t k = 0; k < borders_.size(); ++k)
      for (std::size_t j = 0; j < received[k].size(); ++j)
        degree[at(foreign_end(borders_[k].vertices[j]))] = received[k][j];
    const auto weight = [&](Index v) {
      const auto of = [&](Index body) { return body < 0 ? 0 : degree[at(body)]; };
      return of(vertices_[at(v)].low) + of(vertices_[at(v)].high);
    };
    order_.resize(vertices_.size());
    std::iota(order_.begin(), order_.end(), 0);
    std::stable_sort(order_.begin(), order_.end(), [&](Index a, Index b) { return weight(a) > weight(b); });
  }

  /// The vertices of each body of this rank's, in that order.
  void list_by_body() {
    next_.assign(bodies_.body.size() + 1, 0);
    for (Index v = 0; v < vertex_count(); ++v) for_each_own_end(v, [&](Index body) { ++next_[at(body) + 1]; });
    std::partial_sum(next_.begin(), next_.end(), next_.begin());
    end_.assign(next_.begin() + 1, next_.end());
    next_.pop_back();
    list_.resize(end_.empty() ? 0 : at(end_.back()));
    std::vector<Index> write = next_;
    for (const Index v : order_) for_each_own_end(v, [&](Index body) { list_[at(write[at(body)]++)] = v; });
    used_.resize(bodies_.body.size());
    foreign_.resize(vertices_.size());
    is_known_.assign(vertices_.size(), 0);
    is_sent_.assign(vertices_.size(), 0);
    for (Index body = 0; body < static_cast<Index>(bodies_.body.size()); ++body) ready_.push_back(body);
  }

  /// Returns true if all before a vertex have their colours at that body of this rank's.
  [[nodiscard]] bool is_next(Index body, Index v) const {
    return next_[at(body)] < end_[at(body)] && list_[at(next_[at(body)])] == v;
  }

  void color_what_can_be() {
    while (!ready_.empty()) {
      const Index body = ready_.back();
      ready_.pop_back();
      while (next_[at(body)] < end_[at(body)] && color_next(list_[at(next_[at(body)])])) {
      }
    }
  }

  /// A vertex that is the next one at a body: gives it its colour, unless it has to wait.
  bool color_next(Index v) {
    bool is_ready = true;
    for_each_own_end(v, [&](Index body) { is_ready = is_ready && is_next(body, v); });
    if (!is_ready) return false;
    const Index foreign = foreign_end(v);
    if (foreign >= 0) {
      tell(v, bodies_.owner[at(foreign)]);
      if (is_known_[at(v)] == 0) return false;
    }
    ColorSet used = foreign_[at(v)];
    for_each_own_end(v, [&](Index body) { used.add(used_[at(body)]); });
    const Index color = used.smallest_free();
    colors_[at(v)] = color;
    for_each_own_end(v, [&](Index body) {
      used_[at(body)].add(color);
      ++next_[at(body)];
      ready_.push_back(body);
    });
    return true;
  }

  void tell(Index v, int rank) {
    if (is_sent_[at(v)] != 0) return;
    is_sent_[at(v)] = 1;
    Border& border = *border_of(rank);
    ++border.sent;
    border.letter.put(static_cast<std::uint32_t>(shared_place_[at(v)]));
    for_each_own_end(v, [&](Index body) { used_[at(body)].put(border.letter); });
  }

  void exchange_sets() {
    std::vector<int> ranks;
    std::vector<Letter> out;
    for (Border& border : borders_) {
      ranks.push_back(border.rank);
      out.push_back(std::exchange(border.letter, Letter()));
    }
    std::vector<Letter> in = exchange_with(transport_, ranks, out);
    for (std::size_t k = 0; k < in.size(); ++k)
      while (!in[k].at_end()) {
        const Index v = borders_[k].vertices[in[k].take<std::uint32_t>()];
        foreign_[at(v)] = ColorSet::take(in[k]);
        is_known_[at(v)] = 1;
        ++borders_[k].received;
        for_each_own_end(v, [&](Index body) { ready_.push_back(body); });
      }
  }

  Transport& transport_;
  const PieceBodies& bodies_;
  std::span<const PushedBodies> vertices_;
  std::span<Index> colors_;
  std::vector<Border> borders_;            ///< by rank
  std::vector<std::size_t> shared_place_;  ///< of each vertex in its border
  std::vector<Index> order_;               ///< vertices
  std::vector<Index> next_, end_, list_;   ///< vertices of each body in their order, and the first without a colour
  std::vector<ColorSet> used_;             ///< at each body
  std::vector<ColorSet> foreign_;          ///< of each vertex: in use at its end that is another rank's
  std::vector<char> is_known_, is_sent_;   ///< of each vertex: those came, those of this rank's end went
  std::vector<Index> ready_;               ///< bodies whose next vertex may have become free
};

}  // namespace

Index color_over_ranks(Transport& transport, const PieceBodies& bodies, std::span<const PushedBodies> vertices,
                       std::span<Index> colors, std::int64_t& waves) {
  return Coloring(transport, bodies, vertices, colors).run(waves);
}

}  // namespace stiction::distributed
