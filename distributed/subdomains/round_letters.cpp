#include "distributed/subdomains/round_letters.hpp"

#include <cstring>

#include "distributed/transport/letters.hpp"

namespace stiction::distributed {

namespace {

constexpr std::size_t kRow = 6 * sizeof(double);

double* row6(double* rows, Index row) {
  return rows + 6 * static_cast<Offset>(row);
}

}  // namespace

RoundLetters::RoundLetters(Transport& transport, const std::vector<Neighbour>& neighbours)
    : transport_(transport), ranks_(static_cast<std::size_t>(transport.size())) {
  for (const Neighbour& neighbour : neighbours) ranks_[static_cast<std::size_t>(neighbour.rank)].neighbour = &neighbour;
  for (Correspondent& rank : ranks_) {
    const bool is_near = rank.neighbour != nullptr;
    rank.out.resize(sizeof(Head) + (is_near ? rank.neighbour->send.size() * kRow : 0));
    rank.in.resize(sizeof(Head) + (is_near ? rank.neighbour->receive.size() * kRow : 0));
  }
}

void RoundLetters::begin() {
  ++meeting_;
  for (Correspondent& rank : ranks_) rank.made = 0;
}

void RoundLetters::send(Index made, const double* rows) {
  const Head head{meeting_, made};
  std::vector<Outgoing> out;
  for (int other = 0; other < transport_.size(); ++other) {
    Correspondent& rank = ranks_[static_cast<std::size_t>(other)];
    if (other == transport_.rank() || (rank.neighbour == nullptr && made != kConsensusRounds)) continue;
    std::byte* to = rank.out.data();
    std::memcpy(to, &head, sizeof(head));
    to += sizeof(head);
    if (rank.neighbour != nullptr)
      for (const Index row : rank.neighbour->send) {
        std::memcpy(to, rows + 6 * static_cast<Offset>(row), kRow);
        to += kRow;
      }
    out.push_back({other, rank.out});
    ++rank.sent;
  }
  transport_.post(out);
}

void RoundLetters::read(Correspondent& from, double* rows) {
  ++from.taken;
  Head head;
  std::memcpy(&head, from.in.data(), sizeof(head));
  if (head.meeting != meeting_) return;
  from.made = static_cast<Index>(head.made);
  if (from.neighbour == nullptr) return;
  const std::byte* next = from.in.data() + sizeof(head);
  for (const Index row : from.neighbour->receive) {
    std::memcpy(row6(rows, row), next, kRow);
    next += kRow;
  }
}

void RoundLetters::take(double* rows) {
  for (int other = 0; other < transport_.size(); ++other) {
    Correspondent& rank = ranks_[static_cast<std::size_t>(other)];
    while (other != transport_.rank() && transport_.take({other, rank.in})) read(rank, rows);
  }
}

void RoundLetters::await(double* rows) {
  const int other = first_behind();
  Correspondent& rank = ranks_[static_cast<std::size_t>(other)];
  transport_.await({other, rank.in});
  read(rank, rows);
}

int RoundLetters::first_behind() const {
  for (int other = 0; other < transport_.size(); ++other)
    if (other != transport_.rank() && ranks_[static_cast<std::size_t>(other)].made < kConsensusRounds) return other;
  return -1;
}

void RoundLetters::finish() {
  std::vector<std::int64_t> sent;
  for (const Correspondent& rank : ranks_) sent.push_back(rank.sent);
  const std::vector<std::int64_t> all = gather_all(transport_, std::span<const std::int64_t>(sent));
  for (int other = 0; other < transport_.size(); ++other) {
    Correspondent& rank = ranks_[static_cast<std::size_t>(other)];
    const std::int64_t to_here =
        all[static_cast<std::size_t>(other) * ranks_.size() + static_cast<std::size_t>(transport_.rank())];
    for (; rank.taken < to_here; ++rank.taken) transport_.await({other, rank.in});
  }
  transport_.settle();
}

}  // namespace stiction::distributed
