#include "distributed/solve/halo.hpp"

#include <algorithm>
#include <cstring>

namespace stiction::distributed {

namespace {

constexpr std::size_t kNumbers = 6;  // of a twist

}  // namespace

Neighbour& neighbour_of(std::vector<Neighbour>& round, int rank) {
  const auto found =
      std::lower_bound(round.begin(), round.end(), rank, [](const Neighbour& n, int key) { return n.rank < key; });
  if (found != round.end() && found->rank == rank) return *found;
  return *round.insert(found, Neighbour{rank, {}, {}});
}

void Halo::share(Index round, float* rows, Index width) {
  share_rows(round, rows, width);
}
void Halo::share(Index round, double* rows, Index width) {
  share_rows(round, rows, width);
}

template <class T>
void Halo::share_rows(Index round, T* rows, Index width) {
  const std::vector<Neighbour>& neighbours = rounds_[static_cast<std::size_t>(round)];
  if (neighbours.empty()) return;
  constexpr std::size_t kBytes = kNumbers * sizeof(T);
  std::size_t send = 0, receive = 0;
  for (const Neighbour& neighbour : neighbours) {
    send += neighbour.send.size() * kBytes;
    receive += neighbour.receive.size() * kBytes;
  }
  sent_.resize(send);
  received_.resize(receive);
  const auto row = [&](Index local) { return rows + static_cast<Offset>(local) * width; };
  out_.clear();
  in_.clear();
  std::byte* to = sent_.data();
  std::byte* from = received_.data();
  for (const Neighbour& neighbour : neighbours) {
    const std::size_t out_bytes = neighbour.send.size() * kBytes, in_bytes = neighbour.receive.size() * kBytes;
    if (out_bytes > 0) out_.push_back({neighbour.rank, {to, out_bytes}});
    if (in_bytes > 0) in_.push_back({neighbour.rank, {from, in_bytes}});
    for (const Index local : neighbour.send) {
      std::memcpy(to, row(local), kBytes);
      to += kBytes;
    }
    from += in_bytes;
  }
  transport_.exchange(out_, in_);
  const std::byte* next = received_.data();
  for (const Neighbour& neighbour : neighbours)
    for (const Index local : neighbour.receive) {
      std::memcpy(row(local), next, kBytes);
      next += kBytes;
    }
}

const std::byte* Halo::gather(const void* mine, std::size_t bytes) {
  gathered_.resize(bytes * static_cast<std::size_t>(transport_.size()));
  transport_.all_gather({static_cast<const std::byte*>(mine), bytes}, gathered_);
  return gathered_.data();
}

int Halo::size() const {
  return transport_.size();
}

}  // namespace stiction::distributed
