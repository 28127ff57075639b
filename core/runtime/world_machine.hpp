#pragma once

#include <memory>
#include <span>

#include "core/base/world_job.hpp"

namespace stiction {

/// The stages of a world's step around its solve, on one machine; everything was checked before.
template <class Real>
class WorldMachine {
 public:
  virtual ~WorldMachine() = default;
  /// Makes the job's inputs of a solve, finds the contacts of every environment and says how many there are.
  virtual void find_contacts(const WorldJob<Real>& job, std::span<Offset> counts) = 0;
  /// Writes what was found last where the sink says.
  virtual void hand_over(const WorldJob<Real>& job, const ContactSink<Real>& sink) = 0;
  virtual void integrate(const WorldJob<Real>& job) = 0;
  virtual void motion(const WorldJob<Real>& job, std::span<WorldMotion> out) = 0;
};

template <class Real>
std::unique_ptr<WorldMachine<Real>> make_cpu_world(Offset env_count, int threads);

}  // namespace stiction
