#pragma once

#include <memory>
#include <vector>

#include "cli/step_checkpoint.hpp"
#include "cli/step_world.hpp"
#include "distributed/program/commands.hpp"
#include "distributed/program/rank_report.hpp"
#include "distributed/program/rank_state_file.hpp"
#include "distributed/world/rank_world.hpp"

namespace stiction::distributed {

/// A scene's environments, each of them over all ranks. Every rank calls the same functions in the same order.
template <class Real>
class RankSteppedWorld final : public cli::SteppedWorld {
 public:
  RankSteppedWorld(Transport& transport, const StepJobArguments& arguments, const scenes::WorldScene& scene,
                   const WorldOptions& options);

  std::int64_t resume() override;
  void step() override;
  std::vector<WorldMotion> motion() override;
  std::vector<cli::EnvSeen> see() override;
  void write_states(std::int64_t step) override;
  void close_states() override;
  void write_checkpoint(std::int64_t step) override;
  WorldSeconds seconds() override;
  std::uint64_t hash() override;

  /// Returns the work of each rank, by rank; all ranks get it.
  std::vector<StepRankReport> reports();

 private:
  using World = RankWorld<Real>;
  void start(Offset env);
  void go_on(Offset env, const BodyRange& share, const io::CheckpointShare& file);
  [[nodiscard]] WorldCheckpoint<Real> part_by_number() const;
  void write_checkpoint_part(const std::filesystem::path& path, const io::CheckpointFile& file);
  BodyList<Real> by_number(const World& world, Impulses<Real>* impulses) const;

  Transport& transport_;
  const StepJobArguments& arguments_;
  WorldOptions options_;
  WorldModel<Real> whole_;
  std::vector<std::unique_ptr<World>> worlds_;
  cli::StepCheckpoint checkpoint_;
  bool is_in_parts_;  ///< checkpoints of this job
  std::unique_ptr<RankStateFile> states_;
};

}  // namespace stiction::distributed
