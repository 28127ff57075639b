#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "distributed/solve/solve_over_ranks.hpp"
#include "distributed/world/bodies.hpp"
#include "distributed/world/cuts.hpp"
#include "distributed/world/neighbourhood.hpp"

namespace stiction::distributed {

/// Messages of one rank in all steps beside the solves.
struct StepTraffic {
  WorldSeconds seconds;          ///< detection is with ghosts and migration; `solve` is RankReport's [s]
  std::int64_t near_bodies = 0;  ///< bodies that it looked for contacts among in the last step, its own and ghosts
  std::int64_t migrated = 0;     ///< bodies that came to it, but for those it began with
  std::int64_t waves = 0;        ///< exchanges of colours
  std::int64_t exchanges = 0, gathers = 0, messages = 0, bytes = 0;
};

/// One environment of a World over ranks, with its bits. A rank holds the bodies that it owns, and ghosts while a step
/// lasts. It finds the contacts of its bodies, colours them together with the others, and moves its bodies
/// (docs/howto/ranks.md). Calls are made by all ranks together; those that throw RankLost are documented there.
template <class Real>
class RankWorld {
 public:
  /// `whole` and `options` are those of a World, and must outlive this. `random`: draws owners from this seed instead
  /// of cutting space. \throws Error as World for options out of range, and as solve_over_ranks
  RankWorld(Transport& transport, const WorldModelView<Real>& whole, const WorldOptions& options,
            std::optional<std::uint64_t> random = {});

  /// Bodies that this rank is to be given first: a share of their numbers.
  [[nodiscard]] BodyRange first_share() const;
  /// Puts the bodies of first_share() where they are, in order, and sets the final impulses of their contacts. Then
  /// ranks share them out anew. \throws RankLost; Error(invalid_argument) for an id without has_pair()
  void put(BodyList<Real> bodies, Impulses<Real> last = {});
  /// A step. \throws RankLost; Error(out_of_memory) as World
  void step();

  [[nodiscard]] Transport& transport() const { return transport_; }
  [[nodiscard]] const BodyList<Real>& bodies() const { return own_; }          ///< that this rank owns
  [[nodiscard]] const Impulses<Real>& impulses() const { return last_; }       ///< of the last step's contacts of them
  [[nodiscard]] const StepPiece<Real>* piece() const { return piece_.get(); }  ///< of the last step; null before it
  [[nodiscard]] EnvStatus status() const { return status_; }  ///< of the last solve, alike on all ranks
  [[nodiscard]] WorldMotion motion() const;                   ///< of this rank's bodies
  [[nodiscard]] const RankReport& solve_report() const { return report_; }
  [[nodiscard]] const StepTraffic& step_traffic() const { return step_traffic_; }
  /// Returns true if an id is of a pair of shapes of this scene.
  [[nodiscard]] bool has_pair(std::uint64_t contact_id) const;
  /// The id's bodies, -1 for the world. The id is one of those.
  [[nodiscard]] ShapePair pair_of(std::uint64_t contact_id) const;

 private:
  void cut_space();
  void share_out();
  [[nodiscard]] int owner_of(std::size_t k) const;
  void take(BodyList<Real> bodies, Impulses<Real> last);
  void solve();
  void integrate(const std::vector<Real>& twist);

  Transport& transport_;
  const WorldModelView<Real>& whole_;
  const WorldOptions& options_;
  std::optional<std::uint64_t> random_;
  Cuts cuts_;
  std::int64_t steps_ = 0;
  bool is_uneven_ = false;  ///< a rank has many more bodies than others
  BodyList<Real> own_;
  std::unique_ptr<PartOfWorld<Real>> part_;  ///< the same bodies as kernels have them
  Impulses<Real> last_;
  std::unique_ptr<StepPiece<Real>> piece_;
  EnvStatus status_{};
  RankReport report_;
  StepTraffic step_traffic_;
};

}  // namespace stiction::distributed
