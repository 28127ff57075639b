#include "cpu_fallback/pack/work_items.hpp"

#include <algorithm>
#include <span>
#include <string_view>
#include <tuple>
#include <utility>

#include "core/base/extents.hpp"

namespace stiction::cpu {

namespace {

/// A pack whose matrix, or whose bodies and contacts, leave the second-level cache is slower than its environments one
/// by one.
constexpr Offset kMostMatrixBytes = Offset{1} << 20;
constexpr Offset kMostBodyBytes = Offset{3} << 19;
/// Padding a pack may add to the work of its smallest member.
constexpr double kLargestPadding = 1.6;
/// Padding once a run fills its packs several times over, so that little is lost by beginning another.
constexpr double kPaddingOfLongRuns = 1.1;
constexpr Offset kLongRun = 4;
/// An environment with fewer contacts is not worth a team: its colours end before the threads have met.
constexpr Index kTeamContacts = 4096;
/// Contacts that one thread takes at a time, one environment of bodies after the other.
constexpr Offset kRunContacts = 1024;

/// The slots that two environments need to share a pack.
ConeCounts join(const ConeCounts& a, const ConeCounts& b) {
  ConeCounts both;
  both.free = larger_of(a.free, b.free);
  both.unilateral = larger_of(a.unilateral, b.unilateral);
  both.box = larger_of(a.box, b.box);
  for (Index m = 2; m <= kMaxConeRows; ++m) both.friction[m] = larger_of(a.friction[m], b.friction[m]);
  both.box_friction = larger_of(a.box_friction, b.box_friction);
  return both;
}
PackShape join(const PackShape& a, const PackShape& b) {
  return {larger_of(a.contacts, b.contacts), larger_of(a.bodies, b.bodies)};
}

/// Returns the work of one iteration.
Offset work_of(const ConeCounts& counts) {
  const Offset rows = row_count(counts);
  // A cone's own step weighs like some thirty matrix entries.
  return rows * rows + 30 * Offset{cone_count(counts)};
}
Offset work_of(const PackShape& shape) {
  // Cost of a contact's visit against that of each body in sweeps and residuals.
  return 8 * Offset{shape.contacts} + Offset{shape.bodies};
}

/// Makes runs for packs of environments that come in the order of their sizes, the largest first. `alone` is given
/// those that no pack takes.
template <class Shape>
class PackGroups {
 public:
  using Alone = std::function<void(std::span<const Offset>)>;

  PackGroups(const WorkItemRules<Shape>& rules, Offset most_bytes, std::vector<WorkItem<Shape>>& items, Alone alone)
      : rules_(rules), most_bytes_(most_bytes), items_(items), alone_(std::move(alone)) {}

  void add(Offset env, const Shape& shape) {
    if (!group_.empty() && !takes(shape)) close();
    if (group_.empty()) {
      shape_ = shape;
      is_packable_ = is_packable(shape);
    } else if (!(shape == shape_)) {
      shape_ = join(shape_, shape);
    }
    group_.push_back(env);
  }

  void close() {
    const auto size = static_cast<Offset>(group_.size());
    // A pack costs as much however few are in it, and the narrowest takes longer over one than that takes by itself.
    if (!is_packable_ || size == 1 || 4 * size < rules_.pack_width) {
      if (size > 0) alone_(group_);
    } else {
      // Long runs keep lanes full; several per thread keep threads busy.
      const Offset pieces = bounded<Offset>(size / (4 * Offset{rules_.pack_width}), 1,
                                            rules_.threads == 1 ? 1 : 4 * Offset{rules_.threads});
      for (Offset piece = 0; piece < pieces; ++piece)
        items_.push_back(
            {{group_.begin() + size * piece / pieces, group_.begin() + size * (piece + 1) / pieces}, shape_, true});
    }
    group_.clear();
  }

 private:
  [[nodiscard]] bool is_packable(const Shape& shape) const {
    return rules_.pack_width > 1 && rules_.pack_bytes(shape) <= most_bytes_;
  }

  [[nodiscard]] bool takes(const Shape& shape) const {
    if (!is_packable_) return false;
    if (shape == shape_) return true;  // as most are: no padding
    const bool is_long = static_cast<Offset>(group_.size()) >= kLongRun * rules_.pack_width;
    const double most = is_long ? kPaddingOfLongRuns : kLargestPadding;
    const Shape joined = join(shape_, shape);
    return static_cast<double>(work_of(joined)) <= most * static_cast<double>(work_of(shape)) && is_packable(joined);
  }

  const WorkItemRules<Shape>& rules_;
  Offset most_bytes_;
  std::vector<WorkItem<Shape>>& items_;
  Alone alone_;
  std::vector<Offset> group_;
  Shape shape_{};
  bool is_packable_ = false;
};

/// Keys by which environments of bodies are sorted.
struct SortedBodies {
  PackShape shape;
  std::size_t sides;  ///< hash of the bodies that the contacts are between
  Offset env;

  friend bool operator<(const SortedBodies& a, const SortedBodies& b) {
    return std::tuple(-a.shape.contacts, -a.shape.bodies, a.sides, a.env) <
           std::tuple(-b.shape.contacts, -b.shape.bodies, b.sides, b.env);
  }
};

std::size_t hash_of(const Index* sides, Index contacts) {
  return std::hash<std::string_view>()(
      {reinterpret_cast<const char*>(sides), 2 * static_cast<std::size_t>(contacts) * sizeof(Index)});
}

}  // namespace

std::vector<WorkItem<ConeCounts>> make_work_items(const PlanData& plan, const std::function<bool(Offset)>& takes,
                                                  const WorkItemRules<ConeCounts>& rules) {
  std::vector<WorkItem<ConeCounts>> items;
  for (const auto* order : {&plan.factor_order, &plan.sparse_order})
    for (const Offset env : *order)
      if (takes(env)) items.push_back({{env}, {}, false});

  PackGroups<ConeCounts> groups(rules, kMostMatrixBytes, items, [&](std::span<const Offset> envs) {
    items.push_back({{envs.begin(), envs.end()}, {}, false});
  });
  for (const Offset env : plan.dense_order)
    if (takes(env)) groups.add(env, plan.counts[static_cast<std::size_t>(env)]);
  groups.close();

  std::vector<Offset> empty;
  for (Offset env = 0; env < plan.env_count; ++env)
    if (plan.path[static_cast<std::size_t>(env)] == EnvPath::empty && takes(env)) empty.push_back(env);
  if (!empty.empty()) items.push_back({std::move(empty), {}, false});
  return items;
}

BodyWorkItems make_work_items(const BodyPlanData& plan, const Offset* env_body_offsets,
                              const Offset* env_contact_offsets, const WorkItemRules<PackShape>& rules) {
  BodyWorkItems result;
  const auto kept = [&](Offset env) { return plan.kept[static_cast<std::size_t>(env)]; };
  for (Offset env = 0; env < plan.env_count(); ++env)
    if (kept(env) >= kTeamContacts) result.large.push_back(env);
  // Many large environments fill the threads by themselves.
  if (rules.threads == 1 || result.large.size() >= 4 * static_cast<std::size_t>(rules.threads)) result.large.clear();

  std::vector<SortedBodies> small;
  std::vector<Offset> alone;
  std::size_t next_large = 0;
  for (Offset env = 0; env < plan.env_count(); ++env) {
    if (next_large < result.large.size() && result.large[next_large] == env) {
      ++next_large;
    } else if (rules.pack_width == 1 || kept(env) == 0) {
      alone.push_back(env);
    } else {
      const auto bodies = static_cast<Index>(env_body_offsets[env + 1] - env_body_offsets[env]);
      const Index* const sides = plan.sides.data() + 2 * env_contact_offsets[env];
      small.push_back({{kept(env), bodies}, hash_of(sides, kept(env)), env});
    }
  }
  // Environments that are all alike, as in most training loops, need no sorting: this part is one thread's.
  if (!std::is_sorted(small.begin(), small.end())) std::sort(small.begin(), small.end());
  PackGroups<PackShape> groups(rules, kMostBodyBytes, result.items, [&](std::span<const Offset> envs) {
    alone.insert(alone.end(), envs.begin(), envs.end());
  });
  for (const SortedBodies& next : small) groups.add(next.env, next.shape);
  groups.close();

  WorkItem<PackShape> item;
  Offset contacts = 0;
  const auto close_item = [&] {
    if (!item.envs.empty()) result.items.push_back(std::move(item));
    item = {};
    contacts = 0;
  };
  for (const Offset env : alone) {
    item.envs.push_back(env);
    contacts += kept(env) + 16;
    if (contacts >= kRunContacts) close_item();
  }
  close_item();
  return result;
}

}  // namespace stiction::cpu
