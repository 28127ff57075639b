#include "core/plan/islands.hpp"

#include <numeric>
#include <utility>

#include "core/base/extents.hpp"

namespace stiction {
namespace {

/// Sets of cones; each is known by its smallest (Galler and Fischer 1964, halving paths as they are walked).
class ConeSets {
 public:
  void reset(Offset cones) {
    parent_.resize(at(cones));
    std::iota(parent_.begin(), parent_.end(), 0);
  }
  Index smallest(Index cone) {
    while (parent_[at(cone)] != cone) {
      parent_[at(cone)] = parent_[at(parent_[at(cone)])];
      cone = parent_[at(cone)];
    }
    return cone;
  }
  void unite(Index a, Index b) {
    a = smallest(a);
    b = smallest(b);
    if (a > b) std::swap(a, b);
    parent_[at(b)] = a;
  }

 private:
  std::vector<Index> parent_;
};

}  // namespace

Islands find_islands(const BatchStructure& batch) {
  Islands islands;
  islands.island.assign(at(batch.cone_count), 0);
  ConeSets sets;
  std::vector<Index> cone_of_row;
  for (Offset env = 0; env < batch.env_count; ++env) {
    const Offset first_cone = batch.env_cone_offsets[env];
    const Index cones = batch.env_cones(env);
    const Offset* const cone_rows = batch.cone_row_offsets + first_cone;
    const Index* const group = batch.cone_group == nullptr ? nullptr : batch.cone_group + first_cone;
    sets.reset(cones);
    cone_of_row.clear();
    for (Index c = 0; c < cones; ++c) cone_of_row.insert(cone_of_row.end(), at(cone_rows[c + 1] - cone_rows[c]), c);

    for (Index c = 0; c < cones; ++c) {
      if (group != nullptr && c > 0 && group[c] >= 0 && group[c] == group[c - 1]) sets.unite(c - 1, c);
      for (Offset row = cone_rows[c]; row < cone_rows[c + 1]; ++row) {
        const Index* const columns = batch.row_columns(row);
        for (Index k = 0; k < batch.row_entries(row); ++k) sets.unite(c, cone_of_row[at(columns[k])]);
      }
    }

    // A set's smallest cone is visited before the others, so their number is known when they need it.
    Index count = 0;
    for (Index c = 0; c < cones; ++c) {
      const Index first = sets.smallest(c);
      islands.island[at(first_cone + c)] = first == c ? count++ : islands.island[at(first_cone + first)];
    }
    islands.count.push_back(count);
  }
  return islands;
}

}  // namespace stiction
