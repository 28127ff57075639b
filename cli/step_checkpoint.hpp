#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "cli/commands.hpp"
#include "stiction/io.hpp"
#include "stiction/world.hpp"

namespace stiction::cli {

/// State of a run of `stiction step`, in a file that a run with the same arguments goes on from.
class StepCheckpoint {
 public:
  /// `options` and `arguments` determine the run's bits. Without arguments.checkpoint nothing is read or
  /// written.
  StepCheckpoint(const StepArguments& arguments, const WorldOptions& options);

  /// Puts the world at the file's state, if it is there. Returns how many steps were made. \throws Error(bad_file) for
  /// a file of another run, or beyond the steps that are asked for.
  template <class Real>
  [[nodiscard]] std::int64_t resume(World<Real>& world) const;

  /// Reads the file's data of some bodies of each environment, if it is there. \throws as resume
  [[nodiscard]] std::optional<io::CheckpointShare> read(io::CheckpointBodies bodies) const;

  /// Null without arguments.checkpoint.
  [[nodiscard]] const std::filesystem::path* path() const;
  /// Returns true if the file is to be written after that step.
  [[nodiscard]] bool is_due(std::int64_t step) const;
  /// Writes the file after that step, if it is its turn.
  template <class Real>
  void after(std::int64_t step, const World<Real>& world) const;
  /// A file of that step.
  template <class Real>
  [[nodiscard]] io::CheckpointFile file_of(std::int64_t step, const WorldCheckpoint<Real>& world) const;

 private:
  /// Called before anything else of the file is read, so that a file of another run is named as such.
  void check() const;
  [[nodiscard]] bool is_there() const;

  const StepArguments& arguments_;
  std::string run_;
};

/// Exact where `To` holds the numbers.
template <class To, class From>
WorldCheckpoint<To> converted(const WorldCheckpoint<From>& from);

}  // namespace stiction::cli
