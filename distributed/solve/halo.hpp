#pragma once

#include <cstddef>
#include <vector>

#include "distributed/transport/transport.hpp"
#include "stiction/types.hpp"

namespace stiction::distributed {

/// Messages between two ranks in a round: rows by local number, in the order of the bodies' own.
struct Neighbour {
  int rank = 0;
  std::vector<Index> send, receive;
};

/// The rounds of a piece: one before each colour, one after the last, one of all ghosts. A round without neighbours
/// is no exchange.
using Rounds = std::vector<std::vector<Neighbour>>;

/// Returns a rank's part of a round, in order of ranks.
Neighbour& neighbour_of(std::vector<Neighbour>& round, int rank);

/// Carries out rounds over a transport. Not a template of an instruction set: kernels of each call it.
class Halo {
 public:
  Halo(Transport& transport, const Rounds& rounds) : transport_(transport), rounds_(rounds) {}

  /// Sends and takes the first six numbers of each of the round's rows, which are `width` numbers apart.
  void share(Index round, float* rows, Index width);
  void share(Index round, double* rows, Index width);

  /// `bytes` of every rank, one after the other; valid until the next call.
  const std::byte* gather(const void* mine, std::size_t bytes);
  [[nodiscard]] int size() const;

 private:
  template <class T>
  void share_rows(Index round, T* rows, Index width);

  Transport& transport_;
  const Rounds& rounds_;
  std::vector<std::byte> sent_, received_, gathered_;
  std::vector<Outgoing> out_;
  std::vector<Incoming> in_;
};

}  // namespace stiction::distributed
