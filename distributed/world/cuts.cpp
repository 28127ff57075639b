#include "distributed/world/cuts.hpp"

#include <bit>
#include <limits>

#include "distributed/transport/letters.hpp"

namespace stiction::distributed {

namespace {

constexpr unsigned kKeyBits = 64, kDigitBits = 4;
constexpr std::size_t kDigits = std::size_t{1} << kDigitBits;

/// Orders coordinates, and points of equal coordinate by number.
std::uint64_t key_of(double coordinate, Index number) {
  constexpr auto kMost = static_cast<double>(std::numeric_limits<float>::max());
  const double bounded = coordinate < -kMost ? -kMost : coordinate > kMost ? kMost : coordinate;
  const float x = bounded == bounded ? static_cast<float>(bounded) + 0.0F : 0.0F;  // of the two zeros one
  const auto bits = std::bit_cast<std::uint32_t>(x);
  const std::uint32_t ordered = (bits & 0x80000000U) != 0 ? ~bits : bits | 0x80000000U;
  return std::uint64_t{ordered} << 32U | static_cast<std::uint32_t>(number);
}

/// The coordinate that a key was made of.
float coordinate_of(std::uint64_t key) {
  const auto ordered = static_cast<std::uint32_t>(key >> 32U);
  return std::bit_cast<float>((ordered & 0x80000000U) != 0 ? ordered & 0x7fffffffU : ~ordered);
}

/// Extent of the points of a half, known to all ranks.
struct Extent {
  std::uint64_t low[3] = {~std::uint64_t{0}, ~std::uint64_t{0}, ~std::uint64_t{0}}, high[3] = {0, 0, 0};
  std::int64_t points = 0;

  void add(const Extent& other) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (other.low[axis] < low[axis]) low[axis] = other.low[axis];
      if (other.high[axis] > high[axis]) high[axis] = other.high[axis];
    }
    points += other.points;
  }
  [[nodiscard]] std::size_t longest() const {
    std::size_t longest = 0;
    float length = -1;
    for (std::size_t axis = 0; points > 0 && axis < 3; ++axis) {
      const float own = coordinate_of(high[axis]) - coordinate_of(low[axis]);
      if (own > length) {
        length = own;
        longest = axis;
      }
    }
    return longest;
  }
};

struct Histogram {
  std::int64_t count[kDigits] = {};
  void add(const Histogram& other) {
    for (std::size_t digit = 0; digit < kDigits; ++digit) count[digit] += other.count[digit];
  }
};

/// Every rank's sums, added: one for each half.
template <class T>
std::vector<T> sum_over_ranks(Transport& transport, const std::vector<T>& mine) {
  const std::vector<T> all = gather_all(transport, std::span<const T>(mine));
  std::vector<T> sum(mine.size());
  for (std::size_t k = 0; k < all.size(); ++k) sum[k % mine.size()].add(all[k]);
  return sum;
}

}  // namespace

template <class F>
void Cuts::for_each_point(const Level& level, F&& f) const {
  for (std::size_t point = 0; point < level.points.size(); ++point)
    if (level.node[point] >= level.begin && nodes_[level.node[point]].count > 1) f(point, level.node[point]);
}

Cuts::Cuts(Transport& transport, std::span<const Index> number, std::span<const Point> points)
    : nodes_{Node{0, transport.size()}} {
  Level level{0, number, points, std::vector<std::size_t>(points.size(), 0)};
  for (bool has_halves = transport.size() > 1; has_halves;) {
    const std::size_t end = nodes_.size();
    cut(transport, level);
    halve(level);
    level.begin = end;
    has_halves = false;
    for (std::size_t k = end; k < nodes_.size(); ++k) has_halves = has_halves || nodes_[k].count > 1;
  }
}

/// Finds axis and key of each node.
void Cuts::cut(Transport& transport, Level& level) {
  const std::size_t count = nodes_.size() - level.begin;
  const auto key = [&](std::size_t point, std::size_t axis) {
    return key_of(level.points[point][axis], level.number[point]);
  };
  std::vector<Extent> extents(count);
  for_each_point(level, [&](std::size_t point, std::size_t k) {
    Extent one;
    one.points = 1;
    for (std::size_t axis = 0; axis < 3; ++axis) one.low[axis] = one.high[axis] = key(point, axis);
    extents[k - level.begin].add(one);
  });
  extents = sum_over_ranks(transport, extents);
  std::vector<std::int64_t> before(count);  // points below the cut that are still to be passed
  for (std::size_t k = 0; k < count; ++k) {
    Node& node = nodes_[level.begin + k];
    node.axis = extents[k].longest();
    before[k] = extents[k].points * (node.count / 2) / node.count;
  }
  for (unsigned shift = kKeyBits; shift > 0;) {
    const unsigned above = shift;
    shift -= kDigitBits;
    std::vector<Histogram> digits(count);
    for_each_point(level, [&](std::size_t point, std::size_t k) {
      const std::uint64_t rest = key(point, nodes_[k].axis) ^ nodes_[k].key;  // of a key with the digits found so far
      if (above < kKeyBits && rest >> above != 0) return;
      ++digits[k - level.begin].count[rest >> shift & (kDigits - 1)];
    });
    digits = sum_over_ranks(transport, digits);
    for (std::size_t k = 0; k < count; ++k) {
      std::uint64_t digit = 0;
      while (digit + 1 < kDigits && digits[k].count[digit] <= before[k]) before[k] -= digits[k].count[digit++];
      nodes_[level.begin + k].key |= digit << shift;
    }
  }
}

/// Adds the next level, and moves points there.
void Cuts::halve(Level& level) {
  const std::size_t end = nodes_.size();
  for (std::size_t k = level.begin; k < end; ++k) {
    const Node node = nodes_[k];
    if (node.count == 1) continue;
    nodes_[k].lower = nodes_.size();
    nodes_.push_back(Node{node.first, node.count / 2});
    nodes_[k].upper = nodes_.size();
    nodes_.push_back(Node{node.first + node.count / 2, node.count - node.count / 2});
  }
  for_each_point(level, [&](std::size_t point, std::size_t k) {
    const std::uint64_t key = key_of(level.points[point][nodes_[k].axis], level.number[point]);
    level.node[point] = key < nodes_[k].key ? nodes_[k].lower : nodes_[k].upper;
  });
}

int Cuts::owner(Index number, const Point& point) const {
  std::size_t k = 0;
  while (nodes_[k].lower != 0)
    k = key_of(point[nodes_[k].axis], number) < nodes_[k].key ? nodes_[k].lower : nodes_[k].upper;
  return nodes_[k].first;
}

}  // namespace stiction::distributed
