#pragma once

#include "core/job/size_class.hpp"
#include "core/job/solve_job.hpp"

namespace stiction::cuda {

/// Environments in the order of execution, as the scheduler leaves them on the device.
struct ClassQueue {
  const Offset* order;        ///< environments by sort key                                  (env_count)
  const Offset* class_begin;  ///< position in `order` where each class begins               (kSizeClasses + 1)
  Offset* work_counter;       ///< per class, how many pieces of work teams have taken       (kSizeClasses)
};

/// What a solving kernel is given: the job, and the class of environments that it answers.
template <class Real>
struct SolveArgs {
  SolveJob<Real> job;
  ClassQueue queue;
  SizeClass size_class;
  Real* workspace;       ///< null: the system lies in the team's shared memory
  Offset slot_elements;  ///< numbers of workspace of a team, or of one slot of a bundle
};

}  // namespace stiction::cuda
