#include "distributed/program/give_up.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <thread>

#include "distributed/transport/mpi_transport.hpp"

namespace stiction::distributed {

// An abort of MPI took more than half a second on a busy machine, and another rank spoke meanwhile.
void give_up(int rank, const std::string& sentence, int status) {
  std::this_thread::sleep_for(std::chrono::seconds(rank < 16 ? rank : 16));
  fmt::print(stderr, "stiction-mpi: {}\n", sentence);
  std::fflush(stderr);
  mpi_abort(status);
}

void refuse(int rank, const std::string& sentence, int status) {
  using Clock = std::chrono::steady_clock;
  constexpr std::chrono::seconds kPatience{5}, kAbortTakes{60};
  const Clock::time_point begin = Clock::now();
  bool is_spoken_for = false;
  while (rank > 0 && Clock::now() - begin < (is_spoken_for ? kAbortTakes : kPatience)) {
    is_spoken_for = is_spoken_for || mpi_is_refused();
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  if (is_spoken_for) mpi_abort(status);
  mpi_say_refused();
  give_up(rank, sentence, status);
}

}  // namespace stiction::distributed
