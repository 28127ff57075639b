#pragma once

#include <cstdint>
#include <vector>

#include "core/algorithm/rigid/consensus.hpp"
#include "distributed/solve/halo.hpp"

namespace stiction::distributed {

/// Messages between ranks while none waits: their copies' requests, and how many rounds they have made since all met.
/// Each rank knows the rounds of every other one, be it a neighbour or not.
class RoundLetters {
 public:
  /// `neighbours`: rows of six numbers that are sent to and taken from ranks.
  RoundLetters(Transport& transport, const std::vector<Neighbour>& neighbours);

  /// All have met: no rank has made a round, and letters from before are dropped.
  void begin();
  /// Sends rows to neighbours after a round, of which `made` were made. Others get a letter once it is enough of them.
  void send(Index made, const double* rows);
  /// Takes all letters that are here; the newest rows of each rank stay.
  void take(double* rows);
  /// Waits for a letter of a rank that has not made enough rounds; there must be one.
  void await(double* rows);
  /// Returns true if every other rank has made kConsensusRounds.
  [[nodiscard]] bool all_are_ready() const { return first_behind() < 0; }
  /// No letter is on its way any more. All ranks call it.
  void finish();

 private:
  struct Head {
    std::int64_t meeting, made;
  };
  struct Correspondent {
    const Neighbour* neighbour = nullptr;
    Index made = 0;
    std::int64_t sent = 0, taken = 0;
    std::vector<std::byte> out, in;
  };
  [[nodiscard]] int first_behind() const;
  void read(Correspondent& from, double* rows);

  Transport& transport_;
  std::vector<Correspondent> ranks_;
  std::int64_t meeting_ = 0;
};

}  // namespace stiction::distributed
