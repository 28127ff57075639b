#pragma once

#include "core/job/size_class.hpp"
#include "core/job/solve_job.hpp"

namespace stiction::cuda {

/// The environments that one launch answers, and memory to solve them in. They are a class in the order of execution,
/// as the scheduler leaves them on the device.
template <class Real>
struct WorkQueue {
  const Offset* order;        ///< environments by sort key                                  (env_count)
  const Offset* class_begin;  ///< position in `order` where each class begins               (kSizeClasses + 1)
  Offset* work_counter;       ///< per class, how many pieces of work teams have taken       (kSizeClasses)
  SizeClass size_class;       ///< the one that is answered
  Real* workspace;            ///< null: the system lies in the team's shared memory
  Offset slot_elements;       ///< numbers of workspace of a team, or of one slot of a bundle
};

/// Arguments of a solving kernel: its batch, and its share of it.
template <class Real>
struct QueuedJob {
  SolveJob<Real> job;
  WorkQueue<Real> queue;
};

}  // namespace stiction::cuda
