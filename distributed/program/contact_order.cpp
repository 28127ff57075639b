#include "distributed/program/contact_order.hpp"

#include <algorithm>
#include <limits>
#include <tuple>

#include "distributed/transport/letters.hpp"

namespace stiction::distributed {

namespace {

struct Key {
  std::int64_t env;
  std::uint64_t id;
};
constexpr Key kNone{std::numeric_limits<std::int64_t>::max(), 0};

bool operator<(const Key& a, const Key& b) {
  return std::tie(a.env, a.id) < std::tie(b.env, b.id);
}
Key key_of(const EndedContact& contact) {
  return {contact.env, contact.id};
}
bool comes_before(const EndedContact& a, const EndedContact& b) {
  return key_of(a) < key_of(b);
}

/// Returns the first keys of ranks 1, 2, ...: even steps through samples of all ranks (regular sampling: Shi and
/// Schaeffer 1992). They decide which rank writes a contact, and reach no number.
std::vector<Key> first_keys(Transport& transport, const std::vector<EndedContact>& sorted) {
  const auto ranks = static_cast<std::size_t>(transport.size());
  std::vector<Key> samples(ranks, kNone);
  for (std::size_t k = 0; k < ranks && !sorted.empty(); ++k) samples[k] = key_of(sorted[k * sorted.size() / ranks]);
  std::vector<Key> all = gather_all(transport, std::span<const Key>(samples));
  std::sort(all.begin(), all.end());
  all.erase(std::lower_bound(all.begin(), all.end(), kNone), all.end());
  std::vector<Key> first;
  for (std::size_t rank = 1; rank < ranks && !all.empty(); ++rank) first.push_back(all[rank * all.size() / ranks]);
  return first;
}

}  // namespace

std::vector<EndedContact> in_order_of_all(Transport& transport, std::vector<EndedContact> own) {
  std::sort(own.begin(), own.end(), comes_before);
  const std::vector<Key> first = first_keys(transport, own);
  std::vector<Letter> letters(static_cast<std::size_t>(transport.size()));
  for (const EndedContact& contact : own)
    letters[static_cast<std::size_t>(std::upper_bound(first.begin(), first.end(), key_of(contact)) - first.begin())]
        .put(contact);
  std::vector<EndedContact> mine;
  for (Letter& letter : exchange_with_all(transport, letters))
    while (!letter.at_end()) mine.push_back(letter.template take<EndedContact>());
  std::sort(mine.begin(), mine.end(), comes_before);
  const auto is_same = [](const EndedContact& a, const EndedContact& b) { return a.env == b.env && a.id == b.id; };
  mine.erase(std::unique(mine.begin(), mine.end(), is_same), mine.end());
  return mine;
}

}  // namespace stiction::distributed
