#pragma once

#include <cstdint>
#include <vector>

#include "distributed/transport/transport.hpp"

namespace stiction::distributed {

/// End state of a contact.
struct EndedContact {
  std::int64_t env;
  std::uint64_t id;
  double impulse[3];
};

/// Puts the contacts of all ranks in order, by environment and id, each once. A rank gets a range of that order, behind
/// those of the ranks before it. Two ranks may know the same contact, and then know the same of it. \throws RankLost
std::vector<EndedContact> in_order_of_all(Transport& transport, std::vector<EndedContact> own);

}  // namespace stiction::distributed
