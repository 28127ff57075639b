#include "distributed/program/give_up.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <thread>

#include "distributed/transport/mpi_transport.hpp"

namespace stiction::distributed {

void give_up(int rank, const std::string& sentence, int status) {
  std::this_thread::sleep_for(std::chrono::milliseconds(250) * (rank < 16 ? rank : 16));
  fmt::print(stderr, "stiction-mpi: {}\n", sentence);
  std::fflush(stderr);
  mpi_abort(status);
}

}  // namespace stiction::distributed
