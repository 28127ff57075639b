#include "core/plan/body_plan.hpp"
#include "core/plan/colored_body_plan.hpp"

#include <algorithm>
#include <bit>
#include <limits>
#include <numeric>
#include <span>

#include "core/base/extents.hpp"

namespace stiction {
namespace {

/// A body with more vertices than this keeps its colours as bits: its list would be read once for each of them.
constexpr Index kHubVertices = 64;

/// Body numbers of one environment, and nothing that is not an integer.
struct EnvContacts {
  Index bodies = 0, contacts = 0;
  const Index *a = nullptr, *b = nullptr;
  const std::uint8_t* kinematic = nullptr;

  [[nodiscard]] bool pushed(Index body) const { return body >= 0 && (kinematic == nullptr || kinematic[body] == 0); }
  [[nodiscard]] Index side(Index body) const {
    if (body < 0) return ~bodies;
    return pushed(body) ? body : ~body;
  }
  [[nodiscard]] bool same_pair(Index c, Index d) const {
    return (a[c] == a[d] && b[c] == b[d]) || (a[c] == b[d] && b[c] == a[d]);
  }
};

template <class Real>
EnvContacts contacts_of(const BodyBatchView<Real>& batch, Offset env) {
  const Offset body = batch.env_body_offsets[env];
  const Offset contact = batch.env_contact_offsets[env];
  return {static_cast<Index>(batch.env_body_offsets[env + 1] - body),
          static_cast<Index>(batch.env_contact_offsets[env + 1] - contact), batch.body_a + contact,
          batch.body_b + contact, batch.kinematic == nullptr ? nullptr : batch.kinematic + body};
}

/// Returns true if plans of two environments are made of the same: contacts between the same bodies.
bool are_alike(const EnvContacts& one, const EnvContacts& other) {
  const auto same = [](const auto* a, const auto* b, Index count) { return std::equal(a, a + count, b); };
  if (one.bodies != other.bodies || one.contacts != other.contacts) return false;
  if (!same(one.a, other.a, one.contacts) || !same(one.b, other.b, one.contacts)) return false;
  return one.kinematic == nullptr || same(one.kinematic, other.kinematic, one.bodies);
}

/// Destination of one environment's part of the plan.
struct EnvPlan {
  Index *kept, *contact_order, *sides, *vertex_offsets, *color_offsets, *color_count, *body_offsets, *body_contacts;

  /// Copies the plan of an environment for which are_alike() holds.
  void copy(const EnvPlan& other, Index bodies, Index contacts) const {
    *kept = *other.kept;
    *color_count = *other.color_count;
    std::copy_n(other.contact_order, contacts, contact_order);
    std::copy_n(other.sides, 2 * Offset{contacts}, sides);
    std::copy_n(other.vertex_offsets, contacts + 1, vertex_offsets);
    std::copy_n(other.color_offsets, contacts + 1, color_offsets);
    std::copy_n(other.body_offsets, bodies + 1, body_offsets);
    std::copy_n(other.body_contacts, 2 * Offset{contacts}, body_contacts);
  }
};

/// Plans environment after environment with the same memory.
class BodyPlanner {
 public:
  /// `chosen`: the contacts to solve, ascending.
  void plan(const EnvContacts& env, std::span<const Index> chosen, const EnvPlan& out) {
    write(env, chosen, choose_order(env, chosen, [this] { return color(); }), out);
  }

  /// First half of a plan: `give_colors` colours the vertices, and returns how many colours there are; so does this.
  template <class F>
  Index choose_order(const EnvContacts& env, std::span<const Index> chosen, F&& give_colors) {
    find_vertices(env, chosen);
    list_bodies(env);
    const Index colors = give_colors();
    sort_vertices(env, colors);
    return colors;
  }
  Index color_by(const ColorVertices& give) {
    color_.assign(at(vertex_count()), -1);
    return give(ends_, color_);
  }

  /// Second half.
  void write(const EnvContacts& env, std::span<const Index> chosen, Index colors, const EnvPlan& out) {
    *out.kept = static_cast<Index>(chosen.size());
    *out.color_count = colors;
    std::copy(color_begin_.begin(), color_begin_.end(), out.color_offsets);
    Index position = 0;
    Index vertex = 0;
    for (const Index v : order_) {
      out.vertex_offsets[vertex++] = position;
      for (Index k = begin_[at(v)]; k < begin_[at(v) + 1]; ++k, ++position) {
        const Index contact = chosen[at(k)];
        out.contact_order[position] = contact;
        out.sides[2 * Offset{position}] = env.side(env.a[contact]);
        out.sides[2 * Offset{position} + 1] = env.side(env.b[contact]);
      }
    }
    out.vertex_offsets[vertex] = position;
    std::fill(out.contact_order + position, out.contact_order + env.contacts, -1);
    write_bodies(env, position, out);
  }

 private:
  [[nodiscard]] Index vertex_count() const { return static_cast<Index>(begin_.size()) - 1; }
  [[nodiscard]] Index degree(Index body) const {
    return body < 0 ? 0 : body_begin_[at(body) + 1] - body_begin_[at(body)];
  }

  void find_vertices(const EnvContacts& env, std::span<const Index> chosen) {
    begin_.assign(1, 0);
    ends_.clear();
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      const auto position = static_cast<Index>(k);
      const bool goes_on =
          k > 0 && position - begin_.back() < kManifoldContacts && env.same_pair(chosen[k - 1], chosen[k]);
      if (goes_on) continue;
      if (k > 0) begin_.push_back(position);
      const Index a = env.a[chosen[k]], b = env.b[chosen[k]];
      const Index low = smaller_of(a, b), high = larger_of(a, b);
      ends_.push_back({env.pushed(low) ? low : -1, env.pushed(high) ? high : -1});
    }
    if (!chosen.empty()) begin_.push_back(static_cast<Index>(chosen.size()));
  }

  /// The vertices of each body that is pushed, ascending.
  void list_bodies(const EnvContacts& env) {
    body_begin_.assign(at(env.bodies) + 1, 0);
    for (const PushedBodies& ends : ends_)
      for (const Index body : {ends.low, ends.high})
        if (body >= 0) ++body_begin_[at(body) + 1];
    std::partial_sum(body_begin_.begin(), body_begin_.end(), body_begin_.begin());
    body_vertices_.resize(at(body_begin_.back()));
    next_.assign(body_begin_.begin(), body_begin_.end() - 1);
    for (Index v = 0; v < vertex_count(); ++v)
      for (const Index body : {ends_[at(v)].low, ends_[at(v)].high})
        if (body >= 0) body_vertices_[at(next_[at(body)]++)] = v;
    hub_.clear();
    hub_of_.assign(at(env.bodies), -1);
    for (Index body = 0; body < env.bodies; ++body)
      if (degree(body) > kHubVertices) {
        hub_of_[at(body)] = static_cast<Index>(hub_.size());
        hub_.emplace_back();
      }
  }

  /// order_: vertices by decreasing sum of their bodies' degrees, a counting sort.
  void sort_by_degree() {
    const auto weight = [&](Index v) { return degree(ends_[at(v)].low) + degree(ends_[at(v)].high); };
    Index largest = 0;
    for (Index v = 0; v < vertex_count(); ++v) largest = larger_of(largest, weight(v));
    next_.assign(at(largest) + 2, 0);
    for (Index v = 0; v < vertex_count(); ++v) ++next_[at(largest - weight(v)) + 1];
    std::partial_sum(next_.begin(), next_.end(), next_.begin());
    order_.resize(at(vertex_count()));
    for (Index v = 0; v < vertex_count(); ++v) order_[at(next_[at(largest - weight(v))]++)] = v;
  }

  Index color() {
    sort_by_degree();
    color_.assign(at(vertex_count()), -1);
    Index colors = 0;
    for (const Index v : order_) {
      taken_.assign(at(colors / 64) + 1, 0);
      for (const Index body : {ends_[at(v)].low, ends_[at(v)].high}) mark_taken(body);
      std::size_t word = 0;
      while (taken_[word] == ~std::uint64_t{0}) ++word;  // colour `colors` is free, and has a bit
      const auto color = static_cast<Index>(64 * word) + std::countr_one(taken_[word]);
      color_[at(v)] = color;
      colors = larger_of(colors, color + 1);
      for (const Index body : {ends_[at(v)].low, ends_[at(v)].high}) remember(body, color);
    }
    return colors;
  }

  void mark_taken(Index body) {
    if (body < 0) return;
    if (hub_of_[at(body)] >= 0) {
      const std::vector<std::uint64_t>& bits = hub_[at(hub_of_[at(body)])];
      for (std::size_t k = 0; k < bits.size(); ++k) taken_[k] |= bits[k];
      return;
    }
    for (Index k = body_begin_[at(body)]; k < body_begin_[at(body) + 1]; ++k) {
      const Index color = color_[at(body_vertices_[at(k)])];
      if (color >= 0) taken_[at(color / 64)] |= std::uint64_t{1} << (color % 64);
    }
  }

  void remember(Index body, Index color) {
    if (body < 0 || hub_of_[at(body)] < 0) return;
    std::vector<std::uint64_t>& bits = hub_[at(hub_of_[at(body)])];
    if (bits.size() <= at(color / 64)) bits.resize(at(color / 64) + 1, 0);
    bits[at(color / 64)] |= std::uint64_t{1} << (color % 64);
  }

  /// order_: vertices by colour, then lower pushed body, then index; color_begin_: where colours begin in it.
  void sort_vertices(const EnvContacts& env, Index colors) {
    by_body_.clear();
    for (Index body = 0; body < env.bodies; ++body)
      for (Index k = body_begin_[at(body)]; k < body_begin_[at(body) + 1]; ++k) {
        const PushedBodies& ends = ends_[at(body_vertices_[at(k)])];
        if ((ends.low >= 0 ? ends.low : ends.high) == body) by_body_.push_back(body_vertices_[at(k)]);
      }
    for (Index v = 0; v < vertex_count(); ++v)
      if (ends_[at(v)].low < 0 && ends_[at(v)].high < 0) by_body_.push_back(v);
    order_.resize(at(vertex_count()));
    color_begin_.assign(at(colors) + 1, 0);
    for (const Index color : color_) ++color_begin_[at(color) + 1];
    std::partial_sum(color_begin_.begin(), color_begin_.end(), color_begin_.begin());
    next_.assign(color_begin_.begin(), color_begin_.end() - 1);
    for (const Index v : by_body_) order_[at(next_[at(color_[at(v)])]++)] = v;
  }

  void write_bodies(const EnvContacts& env, Index kept, const EnvPlan& out) {
    std::fill(out.body_offsets, out.body_offsets + env.bodies + 1, 0);
    const auto for_each_push = [&](auto&& f) {
      for (Index p = 0; p < kept; ++p) {
        const Index a = out.sides[2 * Offset{p}], b = out.sides[2 * Offset{p} + 1];
        if (a >= 0) f(a, ~p);
        if (b >= 0) f(b, p);
      }
    };
    for_each_push([&](Index body, Index) { ++out.body_offsets[body + 1]; });
    std::partial_sum(out.body_offsets, out.body_offsets + env.bodies + 1, out.body_offsets);
    next_.assign(out.body_offsets, out.body_offsets + env.bodies);
    for_each_push([&](Index body, Index entry) { out.body_contacts[next_[at(body)]++] = entry; });
  }

  std::vector<Index> begin_;                     ///< first chosen contact of each vertex, closed
  std::vector<PushedBodies> ends_;               ///< (vertices)
  std::vector<Index> body_begin_;                ///< (bodies + 1)
  std::vector<Index> body_vertices_;             ///< vertices of each body
  std::vector<Index> hub_of_;                    ///< which hub a body is, -1: none  (bodies)
  std::vector<std::vector<std::uint64_t>> hub_;  ///< colours in use at each hub
  std::vector<std::uint64_t> taken_;             ///< colours in use at the vertex's bodies
  std::vector<Index> color_, order_, by_body_, color_begin_, next_;
};

/// The contacts an environment keeps, ascending.
template <class Real>
void choose_contacts(const Real* depth, Index contacts, Index capacity, std::vector<Index>& chosen) {
  chosen.resize(at(contacts));
  std::iota(chosen.begin(), chosen.end(), 0);
  if (capacity == 0 || contacts <= capacity) return;
  // A NaN goes first; its environment is refused anyway.
  const auto key = [&](Index c) { return depth[c] == depth[c] ? depth[c] : -std::numeric_limits<Real>::infinity(); };
  const auto deeper = [&](Index c, Index d) { return key(c) != key(d) ? key(c) > key(d) : c < d; };
  std::nth_element(chosen.begin(), chosen.begin() + capacity, chosen.end(), deeper);
  chosen.resize(at(capacity));
  std::sort(chosen.begin(), chosen.end());
}

template <class Real>
BodyPlanData room_for(const BodyBatchView<Real>& batch) {
  const auto envs = at(batch.env_count), bodies = at(batch.body_count), contacts = at(batch.contact_count);
  BodyPlanData plan;
  plan.env_body_offsets.assign(batch.env_body_offsets, batch.env_body_offsets + batch.env_count + 1);
  plan.env_contact_offsets.assign(batch.env_contact_offsets, batch.env_contact_offsets + batch.env_count + 1);
  plan.kept.resize(envs);
  plan.color_count.resize(envs);
  plan.contact_order.resize(contacts);
  plan.sides.resize(2 * contacts);
  plan.vertex_offsets.resize(contacts + envs);
  plan.color_offsets.resize(contacts + envs);
  plan.body_offsets.resize(bodies + envs);
  plan.body_contacts.resize(2 * contacts);
  return plan;
}

/// Returns the destination of the plan of an environment of that batch.
template <class Real>
EnvPlan part_of(BodyPlanData& plan, const BodyBatchView<Real>& batch, Offset e) {
  const Offset body = batch.env_body_offsets[e], contact = batch.env_contact_offsets[e];
  return EnvPlan{plan.kept.data() + e,
                 plan.contact_order.data() + contact,
                 plan.sides.data() + 2 * contact,
                 plan.vertex_offsets.data() + contact + e,
                 plan.color_offsets.data() + contact + e,
                 plan.color_count.data() + e,
                 plan.body_offsets.data() + body + e,
                 plan.body_contacts.data() + 2 * contact};
}

}  // namespace

template <class Real>
BodyPlanData make_body_plan(const BodyBatchView<Real>& batch, Index capacity, const ParallelFor& parallel_for) {
  BodyPlanData plan = room_for(batch);
  parallel_for(batch.env_count, [&](Offset begin, Offset end) {
    BodyPlanner planner;
    std::vector<Index> chosen;
    for (Offset e = begin; e < end; ++e) {
      const EnvContacts env = contacts_of(batch, e);
      const bool is_over = capacity > 0 && env.contacts > capacity;
      // Copies of one robot often touch alike; the contacts that each keeps of too many depend on depths.
      if (e > begin && !is_over && are_alike(contacts_of(batch, e - 1), env)) {
        part_of(plan, batch, e).copy(part_of(plan, batch, e - 1), env.bodies, env.contacts);
        continue;
      }
      choose_contacts(batch.depth + batch.env_contact_offsets[e], env.contacts, capacity, chosen);
      planner.plan(env, chosen, part_of(plan, batch, e));
    }
  });
  return plan;
}

template <class Real>
BodyPlanData make_body_plan(const BodyBatchView<Real>& batch, const ColorVertices& color) {
  BodyPlanData plan = room_for(batch);
  BodyPlanner planner;
  std::vector<Index> all;
  const EnvContacts env = contacts_of(batch, 0);
  choose_contacts(batch.depth, env.contacts, 0, all);
  const Index colors = planner.choose_order(env, all, [&] { return planner.color_by(color); });
  plan.color_offsets.resize(larger_of(plan.color_offsets.size(), at(colors) + 1));
  planner.write(env, all, colors, part_of(plan, batch, 0));
  return plan;
}

template <class Real>
bool fits(const BodyPlanData& plan, const BodyBatchView<Real>& batch) {
  const auto same = [&](const std::vector<Offset>& planned, const Offset* offsets) {
    return plan.env_count() == batch.env_count && std::equal(planned.begin(), planned.end(), offsets);
  };
  if (!same(plan.env_body_offsets, batch.env_body_offsets)) return false;
  if (!same(plan.env_contact_offsets, batch.env_contact_offsets)) return false;
  for (Offset e = 0; e < batch.env_count; ++e) {
    const EnvContacts env = contacts_of(batch, e);
    const Offset first = batch.env_contact_offsets[e];
    for (Index p = 0; p < plan.kept[at(e)]; ++p) {
      const Index contact = plan.contact_order[at(first + p)];
      if (plan.sides[at(2 * (first + p))] != env.side(env.a[contact])) return false;
      if (plan.sides[at(2 * (first + p) + 1)] != env.side(env.b[contact])) return false;
    }
  }
  return true;
}

template BodyPlanData make_body_plan(const BodyBatchView<float>&, Index, const ParallelFor&);
template BodyPlanData make_body_plan(const BodyBatchView<double>&, Index, const ParallelFor&);
template BodyPlanData make_body_plan(const BodyBatchView<float>&, const ColorVertices&);
template BodyPlanData make_body_plan(const BodyBatchView<double>&, const ColorVertices&);
template bool fits(const BodyPlanData&, const BodyBatchView<float>&);
template bool fits(const BodyPlanData&, const BodyBatchView<double>&);

}  // namespace stiction
