#pragma once

#include <cstddef>

#include "core/base/body_job.hpp"

namespace stiction::cuda {

/// What a kernel that solves bodies is given: the job, and the environments it answers.
template <class Real>
struct BodiesArgs {
  BodyJob<Real> job;
  const Offset* order;   ///< environments by class, the largest first          (env_count)
  Offset begin, end;     ///< this class in `order`
  Offset* ticket;        ///< how many of them teams have taken
  std::byte* workspace;  ///< a slot for each team
  Offset slot_bytes;
};

}  // namespace stiction::cuda
