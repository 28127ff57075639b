#pragma once

#include "core/job/env_features.hpp"
#include "core/job/plan_view.hpp"
#include "core/job/size_class.hpp"
#include "stiction/batch_structure.hpp"
#include "stiction/status.hpp"

namespace stiction::cuda {

/// A plan that is made on the device: PlanView's arrays, and the order in which environments are taken. Room for
/// vertices and colours lies where an environment's cones do, one more than there are cones.
struct PlanArrays {
  EnvPath* path;               ///<                                                                (envs)
  ConeCounts* counts;          ///<                                                                (envs)
  Index* cone_order;           ///<                                                                (cones)
  Offset* env_vertex_offsets;  ///< where an environment's vertex and colour offsets begin         (envs)
  Index* vertex_offsets;       ///<                                                                (cones + envs)
  Index* color_offsets;        ///<                                                                (cones + envs)
  Index* color_count;          ///<                                                                (envs)
  std::uint32_t* flags;        ///< kFlagBadStructure, kFlagOverCapacity                                 (envs)
  std::uint8_t* key;           ///< sort_key()                                                     (envs)
  Offset* order;               ///< environments by key, equal keys by index                       (envs)
  Offset* key_begin;           ///< place in `order` where each key begins                         (kSortKeys + 1)
  Offset* class_begin;         ///< the same of each class                                         (kSizeClasses + 1)
  Offset* work_counter;        ///< per class, pieces of work taken                                (kSizeClasses)
  Index* sort_scratch;         ///< null: in fast memory                        (count_sort_scratch)
  Index* graph_scratch;        ///< of each team that colours or finds islands                     (teams * slot)
  Offset graph_slot;           ///< integers of it for one team

  [[nodiscard]] PlanView view() const {
    return {path,          counts,     cone_order, env_vertex_offsets, vertex_offsets, env_vertex_offsets,
            color_offsets, color_count};
  }
};

/// Arrays that the fallback chain keeps of its environments from stage to stage (docs/math/auto.md).
struct ChainArrays {
  EnvFeatures* features;   ///< features for the choice of their stages                            (envs)
  std::uint8_t* assigned;  ///< the turn that each takes                                           (envs)
};

/// Arguments of sorting environments into classes.
struct SortArgs {
  Offset env_count;
  PlanArrays plan;
  int turn;                 ///< of the fallback chain; 0: every environment has its key already
  ChainArrays chain;        ///< read and written by later turns
  const EnvStatus* status;  ///< of the turns before                                               (envs)
  ClassLimits limits;       ///< of the dense classes under the stage's solver
};

/// Arguments of finding islands.
struct IslandArgs {
  BatchStructure batch;
  Index* island;  ///<                                                                             (cones)
  Index* count;   ///<                                                                             (envs)
  Index most_rows;
  Offset most_nonzeros;
  Index* scratch;  ///< of each team                                                                (teams * slot)
  Offset slot;
};

/// Arguments of the scheduler's kernels.
struct PlanArgs {
  BatchStructure batch;
  PlanArrays plan;
  Index most_rows;       ///< of an environment; a larger one is flagged kFlagOverCapacity
  Index most_dofs;       ///< the same of the columns of its factor, if it has one
  Offset most_nonzeros;  ///< the same of its stored entries, if it is sparse
  bool may_be_sparse;    ///< whether there is room for sparse environments at all
  ClassLimits limits;    ///< of the dense classes
};

}  // namespace stiction::cuda
