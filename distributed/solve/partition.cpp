#include "distributed/solve/partition.hpp"

#include <algorithm>
#include <numeric>
#include <string>

#include "stiction/error.hpp"

namespace stiction::distributed {

namespace {

std::size_t at(Offset index) {
  return static_cast<std::size_t>(index);
}

void require_ranks(int ranks) {
  if (ranks < 1) throw Error(ErrorCode::invalid_argument, "ranks = " + std::to_string(ranks) + ": must be >= 1");
}

/// Contacts between two bodies, by body: lists of contacts in their order.
template <class Real>
class Neighbours {
 public:
  Neighbours(const BodyBatchView<Real>& batch, Offset env) : batch_(batch), first_(batch.env_body_offsets[env]) {
    const Offset begin = batch.env_contact_offsets[env], end = batch.env_contact_offsets[env + 1];
    begins_.assign(at(batch.env_body_offsets[env + 1] - first_) + 1, 0);
    const auto each_side = [&](auto&& f) {
      for (Offset c = begin; c < end; ++c)
        if (batch.body_a[c] >= 0 && batch.body_b[c] >= 0)
          for (const Index body : {batch.body_a[c], batch.body_b[c]}) f(body, c);
    };
    each_side([&](Index body, Offset) { ++begins_[at(body) + 1]; });
    std::partial_sum(begins_.begin(), begins_.end(), begins_.begin());
    contacts_.resize(at(begins_.back()));
    std::vector<Offset> next(begins_.begin(), begins_.end() - 1);
    each_side([&](Index body, Offset c) { contacts_[at(next[at(body)]++)] = c; });
  }
  [[nodiscard]] std::span<const Offset> of(Index body) const {
    return std::span(contacts_).subspan(at(begins_[at(body)]), at(begins_[at(body) + 1] - begins_[at(body)]));
  }

 private:
  const BodyBatchView<Real>& batch_;
  Offset first_;
  std::vector<Offset> begins_, contacts_;
};

/// Sets one group, which begins at a body, beside those before it.
template <class Real>
void place_group(const BodyBatchView<Real>& batch, const Neighbours<Real>& neighbours, Index seed,
                 std::span<Point> points, std::vector<char>& placed, double& right) {
  std::vector<Index> group{seed};
  placed[at(seed)] = 1;
  for (std::size_t next = 0; next < group.size(); ++next) {
    const Index body = group[next];
    for (const Offset c : neighbours.of(body)) {
      const bool is_a = batch.body_a[c] == body;
      const Index other = is_a ? batch.body_b[c] : batch.body_a[c];
      if (placed[at(other)] != 0) continue;
      placed[at(other)] = 1;
      group.push_back(other);
      for (Offset axis = 0; axis < 3; ++axis) {
        const double apart =
            static_cast<double>(batch.arm_a[3 * c + axis]) - static_cast<double>(batch.arm_b[3 * c + axis]);
        points[at(other)][at(axis)] = points[at(body)][at(axis)] + (is_a ? apart : -apart);
      }
    }
  }
  double low = points[at(seed)][0], high = low;
  for (const Index body : group) {
    low = std::min(low, points[at(body)][0]);
    high = std::max(high, points[at(body)][0]);
  }
  for (const Index body : group) points[at(body)][0] += right - low;
  right += high - low + 1;
}

/// Gives `count` ranks from `first` on to bodies, in place.
void split(std::span<const Point> points, std::span<Offset> bodies, int first, int count, std::vector<int>& owner) {
  if (count == 1 || bodies.empty()) {
    for (const Offset body : bodies) owner[at(body)] = first;
    return;
  }
  Point low = points[at(bodies.front())], high = low;
  for (const Offset body : bodies)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], points[at(body)][axis]);
      high[axis] = std::max(high[axis], points[at(body)][axis]);
    }
  std::size_t axis = 0;
  for (const std::size_t other : {std::size_t{1}, std::size_t{2}})
    if (high[other] - low[other] > high[axis] - low[axis]) axis = other;
  const int left = count / 2;
  const std::size_t share = bodies.size() * static_cast<std::size_t>(left) / static_cast<std::size_t>(count);
  std::sort(bodies.begin(), bodies.end(), [&](Offset a, Offset b) {
    const double x = points[at(a)][axis], y = points[at(b)][axis];
    return x != y ? x < y : a < b;
  });
  split(points, bodies.first(share), first, left, owner);
  split(points, bodies.subspan(share), first + left, count - left, owner);
}

}  // namespace

template <class Real>
std::vector<Point> centres_by_arms(const BodyBatchView<Real>& batch) {
  std::vector<Point> points(at(batch.body_count), Point{0, 0, 0});
  double right = 0;
  for (Offset env = 0; env < batch.env_count; ++env) {
    const Neighbours<Real> neighbours(batch, env);
    const Offset first = batch.env_body_offsets[env], count = batch.env_body_offsets[env + 1] - first;
    const std::span<Point> own = std::span(points).subspan(at(first), at(count));
    std::vector<char> placed(at(count), 0);
    for (Index body = 0; body < count; ++body) {
      if (neighbours.of(body).empty()) {
        // Side by side, a few of them would widen a tall scene, which should be cut along its height.
        if (body > 0) own[at(body)] = own[at(body - 1)];
      } else if (placed[at(body)] == 0) {
        place_group(batch, neighbours, body, own, placed, right);
      }
    }
  }
  return points;
}

std::vector<int> bisect(std::span<const Point> points, int ranks) {
  require_ranks(ranks);
  std::vector<int> owner(points.size(), 0);
  std::vector<Offset> bodies(points.size());
  std::iota(bodies.begin(), bodies.end(), Offset{0});
  split(points, bodies, 0, ranks, owner);
  return owner;
}

int random_owner(Offset body, int ranks, std::uint64_t seed) {
  std::uint64_t z = seed + (static_cast<std::uint64_t>(body) + 1) * 0x9e3779b97f4a7c15ULL;  // splitmix64
  z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27U)) * 0x94d049bb133111ebULL;
  return static_cast<int>((z ^ (z >> 31U)) % static_cast<std::uint64_t>(ranks));
}

std::vector<int> random_owners(Offset count, int ranks, std::uint64_t seed) {
  require_ranks(ranks);
  std::vector<int> owner(at(count));
  for (Offset body = 0; body < count; ++body) owner[at(body)] = random_owner(body, ranks, seed);
  return owner;
}

template std::vector<Point> centres_by_arms(const BodyBatchView<float>&);
template std::vector<Point> centres_by_arms(const BodyBatchView<double>&);

}  // namespace stiction::distributed
