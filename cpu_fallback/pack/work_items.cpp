#include "cpu_fallback/pack/work_items.hpp"

#include <algorithm>
#include <iterator>
#include <span>

#include "core/base/extents.hpp"

namespace stiction::cpu {

namespace {

/// A pack whose matrix leaves the second-level cache is slower than its environments one by one.
constexpr Offset kLargestPackBytes = Offset{1} << 20;
/// Padding a pack may add to the work of its smallest member.
constexpr double kLargestPadding = 1.6;
/// Padding once a run fills its packs several times over, so that little is lost by beginning another.
constexpr double kPaddingOfLongRuns = 1.1;
constexpr Offset kLongRun = 4;

ConeCounts join(const ConeCounts& a, const ConeCounts& b) {
  ConeCounts both;
  both.free = larger_of(a.free, b.free);
  both.unilateral = larger_of(a.unilateral, b.unilateral);
  both.box = larger_of(a.box, b.box);
  for (Index m = 2; m <= kMaxConeRows; ++m) both.friction[m] = larger_of(a.friction[m], b.friction[m]);
  return both;
}

Offset work(const ConeCounts& counts) {
  const Offset rows = row_count(counts);
  // A cone's own step weighs like some thirty matrix entries.
  return rows * rows + 30 * Offset{cone_count(counts)};
}

}  // namespace

std::vector<WorkItem> make_work_items(const PlanData& plan, const std::function<bool(Offset)>& takes, int pack_width,
                                      std::size_t scalar_bytes, int threads) {
  std::vector<WorkItem> items;
  const auto one_by_one = [&](std::span<const Offset> envs) {
    constexpr std::size_t kRun = 8;
    for (std::size_t begin = 0; begin < envs.size(); begin += kRun) {
      const auto run = envs.subspan(begin, smaller_of(kRun, envs.size() - begin));
      items.push_back({{run.begin(), run.end()}, {}, false});
    }
  };
  for (const auto* order : {&plan.factor_order, &plan.sparse_order})
    for (const Offset env : *order)
      if (takes(env)) items.push_back({{env}, {}, false});

  const auto packable = [&](const ConeCounts& counts) {
    const Offset rows = row_count(counts);
    return pack_width > 1 && rows * rows * pack_width * static_cast<Offset>(scalar_bytes) <= kLargestPackBytes;
  };
  const auto counts_of = [&](Offset env) -> const ConeCounts& { return plan.counts[static_cast<std::size_t>(env)]; };
  std::vector<Offset> order;
  order.reserve(plan.dense_order.size());
  std::copy_if(plan.dense_order.begin(), plan.dense_order.end(), std::back_inserter(order), takes);
  std::size_t begin = 0;
  while (begin < order.size()) {
    ConeCounts slots = counts_of(order[begin]);
    std::size_t end = begin + 1;
    const bool is_packable = packable(slots);
    while (is_packable && end < order.size()) {
      if (counts_of(order[end]) == slots) {  // as most are: no padding
        ++end;
        continue;
      }
      const ConeCounts joined = join(slots, counts_of(order[end]));
      const bool is_long = end - begin >= static_cast<std::size_t>(kLongRun * pack_width);
      const double most = is_long ? kPaddingOfLongRuns : kLargestPadding;
      if (static_cast<double>(work(joined)) > most * static_cast<double>(work(counts_of(order[end])))) break;
      if (!packable(joined)) break;
      slots = joined;
      ++end;
    }
    const std::span<const Offset> group = std::span(order).subspan(begin, end - begin);
    const auto size = group.size();
    // A pack costs as much however few are in it, and the narrowest takes longer over one than that takes by itself.
    if (!is_packable || size == 1 || 4 * size < static_cast<std::size_t>(pack_width)) {
      one_by_one(group);
    } else {
      // Long runs keep lanes full; several per thread keep threads busy.
      const std::size_t pieces = bounded<std::size_t>(size / static_cast<std::size_t>(4 * pack_width), 1,
                                                      threads == 1 ? 1 : static_cast<std::size_t>(4 * threads));
      for (std::size_t piece = 0; piece < pieces; ++piece) {
        const auto first = static_cast<std::ptrdiff_t>(size * piece / pieces);
        const auto last = static_cast<std::ptrdiff_t>(size * (piece + 1) / pieces);
        items.push_back({{group.begin() + first, group.begin() + last}, slots, true});
      }
    }
    begin = end;
  }
  std::vector<Offset> empty;
  for (Offset env = 0; env < plan.env_count; ++env)
    if (plan.path[static_cast<std::size_t>(env)] == EnvPath::empty && takes(env)) empty.push_back(env);
  if (!empty.empty()) items.push_back({std::move(empty), {}, false});
  return items;
}

}  // namespace stiction::cpu
