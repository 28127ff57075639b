#include "distributed/transport/late.hpp"

#include "stiction/error.hpp"

namespace stiction::distributed {

std::chrono::steady_clock::duration deadline_of(double seconds) {
  constexpr double kDay = 86400;
  if (!(seconds > 0 && seconds <= kDay))
    throw Error(ErrorCode::invalid_argument,
                "deadline = " + std::to_string(seconds) + ": expected seconds above 0, at most 86400");
  return std::chrono::duration_cast<std::chrono::steady_clock::duration>(std::chrono::duration<double>(seconds));
}

std::string text_of_loss(int rank, const std::string& why) {
  return "rank " + std::to_string(rank) + ": " + why + "; the job ends here, start it again";
}

std::string text_of_late(int rank, const std::vector<int>& silent) {
  std::string names;
  for (const int other : silent) names += (names.empty() ? "" : ", ") + std::to_string(other);
  return text_of_loss(rank, (silent.size() == 1 ? "rank " : "ranks ") + names +
                                (silent.size() == 1 ? " has" : " have") + " not answered within the deadline");
}

std::string text_of_size(int rank, int from, std::size_t bytes, std::size_t expected) {
  return text_of_loss(rank, "rank " + std::to_string(from) + " sent " + std::to_string(bytes) + " bytes, expected " +
                                std::to_string(expected));
}

}  // namespace stiction::distributed
