#include "distributed/transport/letters.hpp"

#include <cstdint>

namespace stiction::distributed {

namespace {

void exchange_known(Transport& transport, std::span<const int> ranks, const std::vector<Letter>& out,
                    std::vector<Letter>& in) {
  std::vector<Outgoing> outgoing;
  std::vector<Incoming> incoming;
  for (std::size_t k = 0; k < ranks.size(); ++k) {
    if (out[k].size() > 0) outgoing.push_back({ranks[k], out[k].bytes()});
    if (in[k].size() > 0) incoming.push_back({ranks[k], in[k].bytes()});
  }
  if (!outgoing.empty() || !incoming.empty()) transport.exchange(outgoing, incoming);
}

}  // namespace

std::vector<Letter> exchange_with_all(Transport& transport, const std::vector<Letter>& out) {
  const auto count = static_cast<std::size_t>(transport.size());
  const auto rank = static_cast<std::size_t>(transport.rank());
  std::vector<std::uint64_t> sizes;
  for (const Letter& letter : out) sizes.push_back(letter.size());
  const std::vector<std::uint64_t> all = gather_all(transport, std::span<const std::uint64_t>(sizes));
  std::vector<Letter> in(count);
  std::vector<int> ranks;
  std::vector<Letter> letters, answers;
  for (std::size_t other = 0; other < count; ++other) {
    if (other == rank) continue;
    ranks.push_back(static_cast<int>(other));
    letters.push_back(out[other]);
    answers.emplace_back(all[other * count + rank]);
  }
  exchange_known(transport, ranks, letters, answers);
  for (std::size_t k = 0; k < ranks.size(); ++k) in[static_cast<std::size_t>(ranks[k])] = std::move(answers[k]);
  in[rank] = out[rank];
  return in;
}

std::vector<Letter> exchange_with(Transport& transport, std::span<const int> ranks, const std::vector<Letter>& out) {
  std::vector<std::uint64_t> sizes(out.size()), theirs(out.size());
  std::vector<Outgoing> outgoing;
  std::vector<Incoming> incoming;
  for (std::size_t k = 0; k < out.size(); ++k) {
    sizes[k] = out[k].size();
    outgoing.push_back({ranks[k], std::as_bytes(std::span(&sizes[k], 1))});
    incoming.push_back({ranks[k], std::as_writable_bytes(std::span(&theirs[k], 1))});
  }
  if (!outgoing.empty()) transport.exchange(outgoing, incoming);
  std::vector<Letter> in;
  for (const std::uint64_t size : theirs) in.emplace_back(size);
  exchange_known(transport, ranks, out, in);
  return in;
}

}  // namespace stiction::distributed
