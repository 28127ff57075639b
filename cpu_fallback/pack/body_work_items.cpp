#include "cpu_fallback/pack/body_work_items.hpp"

#include <algorithm>
#include <string_view>
#include <tuple>

#include "core/base/extents.hpp"

namespace stiction::cpu {

namespace {

/// An environment with fewer contacts is not worth a team: its colours end before the threads have met.
constexpr Index kTeamContacts = 4096;
/// Contacts that one thread takes at a time, one environment after the other.
constexpr Offset kRunContacts = 1024;
/// A pack that leaves the second-level cache is slower than its environments one by one.
constexpr Offset kLargestPackBytes = Offset{3} << 19;
/// Padding a pack may add to the work of its smallest member, until it fills its lanes kLongRun times and after.
constexpr double kLargestPadding = 1.6;
constexpr double kPaddingOfLongRuns = 1.1;
constexpr Offset kLongRun = 4;

Offset work_of(const PackShape& shape) {
  // A visit of a contact against what sweeps and looks at the residual do for each body.
  return 8 * Offset{shape.contacts} + Offset{shape.bodies};
}

PackShape join(const PackShape& a, const PackShape& b) {
  return {larger_of(a.contacts, b.contacts), larger_of(a.bodies, b.bodies)};
}

/// What environments are sorted by.
struct Shape {
  PackShape shape;
  std::size_t sides;  ///< hash of the bodies that the contacts are between
  Offset env;

  friend bool operator<(const Shape& a, const Shape& b) {
    return std::tuple(-a.shape.contacts, -a.shape.bodies, a.sides, a.env) <
           std::tuple(-b.shape.contacts, -b.shape.bodies, b.sides, b.env);
  }
};

std::size_t hash_of(const Index* sides, Index contacts) {
  return std::hash<std::string_view>()(
      {reinterpret_cast<const char*>(sides), 2 * static_cast<std::size_t>(contacts) * sizeof(Index)});
}

/// Runs of environments of like size, the largest first; those that no pack takes are left in `alone`.
class Packing {
 public:
  Packing(const BodyWorkItemRules& rules, std::vector<BodyWorkItem>& work, std::vector<Offset>& alone)
      : rules_(rules), work_(work), alone_(alone) {}

  void add(Offset env, const PackShape& shape) {
    if (!group_.empty() && !takes(shape)) close();
    shape_ = group_.empty() ? shape : join(shape_, shape);
    group_.push_back(env);
  }

  void close() {
    const auto size = static_cast<Offset>(group_.size());
    if (4 * size < rules_.pack_width || rules_.pack_bytes(shape_) > kLargestPackBytes) {
      alone_.insert(alone_.end(), group_.begin(), group_.end());
    } else {
      // Long runs keep lanes full; several per thread keep threads busy.
      const Offset pieces = bounded<Offset>(size / (4 * Offset{rules_.pack_width}), 1,
                                            rules_.threads == 1 ? 1 : 4 * Offset{rules_.threads});
      for (Offset piece = 0; piece < pieces; ++piece)
        work_.push_back(
            {{group_.begin() + size * piece / pieces, group_.begin() + size * (piece + 1) / pieces}, shape_, true});
    }
    group_.clear();
  }

 private:
  [[nodiscard]] bool takes(const PackShape& shape) const {
    const bool is_long = static_cast<Offset>(group_.size()) >= kLongRun * rules_.pack_width;
    const double most = is_long ? kPaddingOfLongRuns : kLargestPadding;
    const PackShape joined = join(shape_, shape);
    return static_cast<double>(work_of(joined)) <= most * static_cast<double>(work_of(shape)) &&
           rules_.pack_bytes(joined) <= kLargestPackBytes;
  }

  const BodyWorkItemRules& rules_;
  std::vector<BodyWorkItem>& work_;
  std::vector<Offset>& alone_;
  std::vector<Offset> group_;
  PackShape shape_;
};

}  // namespace

BodyWorkItems make_body_work_items(const BodyPlanData& plan, const Offset* env_body_offsets,
                                   const Offset* env_contact_offsets, const BodyWorkItemRules& rules) {
  BodyWorkItems deal;
  const auto kept = [&](Offset env) { return plan.kept[static_cast<std::size_t>(env)]; };
  for (Offset env = 0; env < plan.env_count(); ++env)
    if (kept(env) >= kTeamContacts) deal.large.push_back(env);
  // Many large environments fill the threads by themselves.
  if (rules.threads == 1 || deal.large.size() >= 4 * static_cast<std::size_t>(rules.threads)) deal.large.clear();

  std::vector<Shape> small;
  std::vector<Offset> alone;
  std::size_t next_large = 0;
  for (Offset env = 0; env < plan.env_count(); ++env) {
    if (next_large < deal.large.size() && deal.large[next_large] == env) {
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
  Packing packing(rules, deal.work, alone);
  for (const Shape& shape : small) packing.add(shape.env, shape.shape);
  packing.close();

  BodyWorkItem run;
  Offset contacts = 0;
  const auto close_run = [&] {
    if (!run.envs.empty()) deal.work.push_back(std::move(run));
    run = {};
    contacts = 0;
  };
  for (const Offset env : alone) {
    run.envs.push_back(env);
    contacts += kept(env) + 16;
    if (contacts >= kRunContacts) close_run();
  }
  close_run();
  return deal;
}

}  // namespace stiction::cpu
