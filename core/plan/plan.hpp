#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/job/cone_counts.hpp"
#include "core/job/parallel_for.hpp"
#include "stiction/batch.hpp"
#include "stiction/types.hpp"

namespace stiction {

/// Everything decided in integers before a solve. Each environment's entries depend on its own structure alone.
/// Shared, so that a machine with separate memory can check that its copy is of this plan. "cone position" below is a
/// position in that environment's part of cone_order.
struct PlanData : std::enable_shared_from_this<PlanData> {
  Offset env_count = 0;
  Offset cone_count = 0;
  Offset row_count = 0;
  Offset nonzero_count = 0;
  std::vector<EnvPath> path;               ///<                                                       (env_count)
  std::vector<ConeCounts> counts;          ///<                                                       (env_count)
  std::vector<Index> cone_order;           ///< cones, environment-local: dense: canonical order; sparse: by colour,
                                           ///< then vertex                                           (cone_count)
  std::vector<Offset> env_vertex_offsets;  ///< where each environment's vertex_offsets begin         (env_count + 1)
  std::vector<Index> vertex_offsets;       ///< sparse: cone position where each vertex begins, closed by the cone
                                           ///< count; dense, empty: no entries
  std::vector<Offset> env_color_offsets;   ///< where each environment's color_offsets begin          (env_count + 1)
  std::vector<Index> color_offsets;        ///< sparse: vertex where each colour begins, closed by the vertex count
  std::vector<Index> color_count;          ///< sparse: colours; dense, empty: 0                      (env_count)
  std::vector<Offset> dense_order;         ///< dense environments, most expensive first, equal shapes together;
                                           ///< the order reaches speed only
  std::vector<Offset> sparse_order;        ///< sparse environments, most expensive first
  Index most_dofs = 0;                     ///< columns of the widest factor
  std::vector<Offset> factor_order;        ///< environments kept as factors, most expensive first
  std::vector<Index> block_places;         ///< of block_places(); empty without blocks               (cone_count)
  std::vector<Offset> sparse_nonzeros;     ///< room of each one's stored entries                     (sparse_order)
};

/// Plans a host batch whose structure is sound.
PlanData make_plan(const BatchStructure& structure, const ParallelFor& parallel_for = all_at_once);

/// Returns true if a plan was made for a structure like this host batch's, in time proportional to its cones. Sizes,
/// kinds and paths are compared, which memory safety needs. The sparsity pattern is not, and a plan for another
/// pattern may colour two coupled cones alike.
bool fits(const PlanData& plan, const BatchStructure& structure, const ParallelFor& parallel_for = all_at_once);

}  // namespace stiction
