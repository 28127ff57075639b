#include "core/plan/block_places.hpp"

#include <algorithm>

#include "core/base/extents.hpp"
#include "core/job/cone_blocks.hpp"
#include "core/job/cone_counts.hpp"

namespace stiction {

namespace {

/// One environment of a batch. Cones count from its own zero.
class PlacesOfEnv {
 public:
  /// `blocks`: each cone's block, by the block's first cone.
  PlacesOfEnv(const BatchStructure& batch, Offset env, const Index* blocks, Index* places)
      : batch_(batch), env_(env), first_cone_(batch.env_cone_offsets[env]), blocks_(blocks), places_(places) {}

  void write() { is_dense() ? write_windows() : write_vertices(); }

 private:
  [[nodiscard]] int shape(Index cone) const {
    const Offset c = first_cone_ + cone;
    return shape_of(batch_.cone_kind[c],
                    static_cast<Index>(batch_.cone_row_offsets[c + 1] - batch_.cone_row_offsets[c]));
  }
  [[nodiscard]] Index block(Index cone) const { return blocks_[cone] < 0 ? cone : blocks_[cone]; }

  [[nodiscard]] bool is_dense() const {
    const ConeKind* const kinds = batch_.cone_kind + first_cone_;
    const ConeKind* const end = kinds + batch_.env_cones(env_);
    Offset entries = 0;
    for (Index row = 0; row < batch_.env_rows(env_); ++row)
      entries += batch_.row_entries(batch_.env_row_offsets[env_] + row);
    return choose_path(batch_.env_rows(env_), entries, std::find(kinds, end, ConeKind::semidefinite) != end) ==
           EnvPath::dense;
  }

  /// Blocks in the order of their first cones, each one's cones in theirs.
  void write_vertices() {
    cones_.resize(at(batch_.env_cones(env_)));
    for (std::size_t c = 0; c < cones_.size(); ++c) cones_[c] = static_cast<Index>(c);
    std::stable_sort(cones_.begin(), cones_.end(), [&](Index a, Index b) { return block(a) < block(b); });
    for (std::size_t p = 0; p < cones_.size(); ++p)
      places_[cones_[p]] = block_place(static_cast<Index>(p), p == 0 || block(cones_[p]) != block(cones_[p - 1]));
  }

  /// Writes cones by their shapes. Each shape fills windows of as many cones as a block has room for. Blocks go into
  /// windows whole, the largest that has room first, and are split where none has.
  void write_windows() {
    Index place = 0;
    for (int k = 0; k < kConeShapes; ++k) {
      list_blocks(k);
      const Index most = kMostBlockRows / shape_rows(k);
      Index room = most;
      while (!lists_.empty()) {
        const auto fits = std::find_if(lists_.begin(), lists_.end(), [&](const std::vector<Index>& cones) {
          return static_cast<Index>(cones.size()) <= room;
        });
        std::vector<Index>& list = fits == lists_.end() ? lists_.back() : *fits;
        const auto taken = smaller_of(static_cast<Index>(list.size()), room);
        for (Index c = 0; c < taken; ++c) places_[list[at(c)]] = block_place(place++, c == 0 && room == most);
        room = room == taken ? most : room - taken;
        list.erase(list.begin(), list.begin() + taken);
        if (list.empty()) lists_.erase(fits);
      }
    }
  }

  /// The blocks' cones of one shape, the largest lists first, of equal ones in the order of their first cones.
  void list_blocks(int of_shape) {
    lists_.clear();
    cones_.clear();
    for (Index c = 0; c < batch_.env_cones(env_); ++c)
      if (shape(c) == of_shape) cones_.push_back(c);
    std::stable_sort(cones_.begin(), cones_.end(), [&](Index a, Index b) { return block(a) < block(b); });
    for (std::size_t k = 0; k < cones_.size(); ++k) {
      if (k == 0 || block(cones_[k]) != block(cones_[k - 1])) lists_.emplace_back();
      lists_.back().push_back(cones_[k]);
    }
    std::stable_sort(lists_.begin(), lists_.end(), [](const auto& a, const auto& b) { return a.size() > b.size(); });
  }

  const BatchStructure& batch_;
  Offset env_, first_cone_;
  const Index* blocks_;
  Index* places_;
  std::vector<Index> cones_;
  std::vector<std::vector<Index>> lists_;
};

}  // namespace

std::vector<Index> block_places(const BatchStructure& batch, const std::vector<Index>& blocks,
                                const ParallelFor& parallel_for) {
  std::vector<Index> places(blocks.size());
  parallel_for(batch.env_count, [&](Offset begin, Offset end) {
    for (Offset env = begin; env < end; ++env) {
      const Offset first = batch.env_cone_offsets[env];
      PlacesOfEnv(batch, env, blocks.data() + first, places.data() + first).write();
    }
  });
  return places;
}

}  // namespace stiction
