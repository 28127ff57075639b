#include "core/plan/newton_plan.hpp"

#include <algorithm>
#include <numeric>

#include "core/base/extents.hpp"
#include "core/job/block_pattern.hpp"
#include "core/plan/block_factor_plan.hpp"
#include "core/plan/block_tables.hpp"
#include "core/plan/multigrid_plan.hpp"
#include "core/plan/ordering.hpp"
#include "core/plan/sparse_inverse_plan.hpp"

namespace stiction {
namespace {

/// One environment's body graph, in order of position: a pair for every contact of two bodies that are pushed.
class BodyGraph {
 public:
  BodyGraph(const BodyPlanData& plan, Offset env) {
    const Offset body = plan.env_body_offsets[at(env)], contact = plan.env_contact_offsets[at(env)];
    bodies_ = static_cast<Index>(plan.env_body_offsets[at(env) + 1] - body);
    offsets_ = plan.body_offsets.data() + body + env;
    entries_ = plan.body_contacts.data() + 2 * contact;
    sides_ = plan.sides.data() + 2 * contact;
  }

  void append(std::vector<Index>& stream) {
    list_blocks();
    append_blocks(stream);
    append_levels(stream);
  }

 private:
  /// A contact of a body: the other body if it is pushed, else the body itself.
  struct Touch {
    Index other, entry;
  };
  [[nodiscard]] Touch touch(Index body, Index k) const {
    const Index entry = entries_[k];
    const Index other = entry >= 0 ? sides_[2 * Offset{entry}] : sides_[2 * Offset{~entry} + 1];
    return {other >= 0 ? other : body, entry};
  }

  void list_blocks() {
    row_offsets_.assign(1, 0);
    columns_.clear();
    block_offsets_.assign(1, 0);
    block_contacts_.clear();
    std::vector<Touch> touches;
    for (Index body = 0; body < bodies_; ++body) {
      touches.clear();
      for (Index k = offsets_[body]; k < offsets_[body + 1]; ++k) {
        const Touch one = touch(body, k);
        if (one.other != body) touches.push_back(one);
        touches.push_back({body, one.entry});
      }
      std::stable_sort(touches.begin(), touches.end(),
                       [](const Touch& a, const Touch& b) { return a.other < b.other; });
      if (touches.empty()) add_block(body);
      for (std::size_t k = 0; k < touches.size(); ++k) {
        if (k == 0 || touches[k].other != touches[k - 1].other) add_block(touches[k].other);
        block_contacts_.push_back(touches[k].entry);
        ++block_offsets_.back();
      }
      row_offsets_.push_back(static_cast<Index>(columns_.size()));
    }
  }
  void add_block(Index column) {
    columns_.push_back(column);
    block_offsets_.push_back(block_offsets_.back());
  }

  void append_blocks(std::vector<Index>& stream) const {
    append_pattern(stream, bodies_, row_offsets_, columns_);
    for (Index row = 0; row < bodies_; ++row)
      for (Index k = row_offsets_[at(row)]; k < row_offsets_[at(row) + 1]; ++k) {
        const auto first = columns_.begin() + row_offsets_[at(columns_[at(k)])];
        const auto last = columns_.begin() + row_offsets_[at(columns_[at(k)]) + 1];
        stream.push_back(static_cast<Index>(std::lower_bound(first, last, row) - columns_.begin()));
      }
    append_table(stream, block_offsets_);
    append_table(stream, block_contacts_);
  }

  /// Breadth first from the lowest body of every island. The link is the contact of the lowest position with the body
  /// that was first to reach it.
  void append_levels(std::vector<Index>& stream) const {
    std::vector<Index> level(at(bodies_), -1), link(at(bodies_), 0), queue;
    Index levels = 0;
    for (Index root = 0; root < bodies_; ++root) {
      if (level[at(root)] >= 0) continue;
      level[at(root)] = 0;
      queue.assign(1, root);
      for (std::size_t next = 0; next < queue.size(); ++next) {
        const Index body = queue[next];
        levels = larger_of(levels, level[at(body)] + 1);
        for (Index k = offsets_[body]; k < offsets_[body + 1]; ++k) {
          const Touch one = touch(body, k);
          if (level[at(one.other)] >= 0) continue;
          level[at(one.other)] = level[at(body)] + 1;
          link[at(one.other)] = ~one.entry;  // the other body is on the contact's other side
          queue.push_back(one.other);
        }
      }
    }
    std::vector<Index> begin(at(levels) + 1, 0);
    for (const Index l : level) ++begin[at(l) + 1];
    std::partial_sum(begin.begin(), begin.end(), begin.begin());
    stream.push_back(levels);
    append_table(stream, begin);
    std::vector<Index> order(at(bodies_));
    for (Index body = 0; body < bodies_; ++body) order[at(begin[at(level[at(body)])]++)] = body;
    append_table(stream, order);
    for (const Index body : order) stream.push_back(link[at(body)]);
  }

  Index bodies_ = 0;
  const Index *offsets_, *entries_, *sides_;
  std::vector<Index> row_offsets_, columns_, block_offsets_, block_contacts_;
};

/// Appends data that the preconditioner needs, from the pattern that the environment's stream begins with.
void append_preconditioner(std::vector<Index>& stream, Offset begin, const BodySpaceOptions& space) {
  // The stream is about to grow: the pattern is read from a copy.
  const Index* next = stream.data() + begin;
  take_pattern(next);
  const std::vector<Index> integers(stream.begin() + begin, stream.begin() + (next - stream.data()));
  next = integers.data();
  const BlockPattern pattern = take_pattern(next);
  switch (space.preconditioner) {
    case BodyPreconditioner::diagonal:
    case BodyPreconditioner::block_diagonal:
      return;
    case BodyPreconditioner::incomplete_cholesky:
      return append_block_factor(stream, pattern, order_rows(pattern, space.ordering), Fill::none);
    case BodyPreconditioner::sparse_inverse:
      return append_sparse_inverse(stream, pattern);
    case BodyPreconditioner::factor:
      return append_block_factor(stream, pattern, order_rows(pattern, space.ordering), Fill::complete);
    case BodyPreconditioner::multigrid:
      return append_multigrid(stream, pattern, space.multigrid.prolongation);
  }
}

}  // namespace

void add_newton_plan(BodyPlanData& plan, const BodySpaceOptions& space) {
  plan.newton_stream.clear();
  plan.newton_offsets.assign(1, 0);
  plan.space = space;
  plan.has_newton = true;
  for (Offset env = 0; env < plan.env_count(); ++env) {
    BodyGraph(plan, env).append(plan.newton_stream);
    append_preconditioner(plan.newton_stream, plan.newton_offsets.back(), space);
    plan.newton_offsets.push_back(static_cast<Offset>(plan.newton_stream.size()));
  }
}

}  // namespace stiction
