#pragma once

#include <cstddef>

#include "core/job/body_job.hpp"

namespace stiction::cuda {

/// The body environments that one launch answers.
struct BodyQueue {
  const Offset* order;   ///< environments by class, the largest first          (env_count)
  Offset begin, end;     ///< this class in `order`
  Offset* work_counter;  ///< how many of them teams have taken
};

/// Arguments of a kernel that solves bodies by teams.
template <class Real>
struct BodiesArgs {
  BodyJob<Real> job;
  BodyQueue queue;
  std::byte* workspace;  ///< a slot for each team
  Offset slot_bytes;
};

/// Arguments of a kernel that solves bodies by lanes.
template <class Real>
struct BodyBundleArgs {
  BodyJob<Real> job;
  BodyQueue queue;
  Offset slot_elements;  ///< numbers of Real, those of double apart, that any environment of the class needs
};

}  // namespace stiction::cuda
