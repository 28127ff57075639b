#pragma once

#include <cstdint>
#include <string>

#include "stiction/world.hpp"
#include "tools/cli/commands.hpp"

namespace stiction::cli {

/// Where a run of `stiction step` stands, in a file that a run with the same arguments goes on from.
class StepCheckpoint {
 public:
  /// `options` and `arguments` say what reaches the run's bits. Without arguments.checkpoint nothing is read or
  /// written.
  StepCheckpoint(const StepArguments& arguments, const WorldOptions& options);

  /// Puts the world where the file says, if it is there. Returns how many steps were made. \throws Error(bad_file) for
  /// a file of another run, or beyond the steps that are asked for.
  template <class Real>
  [[nodiscard]] std::int64_t resume(World<Real>& world) const;

  /// Writes the file after that step, if it is its turn.
  template <class Real>
  void after(std::int64_t step, const World<Real>& world) const;

 private:
  const StepArguments& arguments_;
  std::string run_;
};

}  // namespace stiction::cli
