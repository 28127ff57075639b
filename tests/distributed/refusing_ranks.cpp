#include <chrono>
#include <cstdlib>
#include <string>
#include <thread>

#include "distributed/program/give_up.hpp"
#include "distributed/transport/mpi_transport.hpp"

/// Ranks that come to one error after a while each, under mpirun: refusing_ranks MILLISECONDS of each rank...
int main(int argc, char** argv) {
  namespace distributed = stiction::distributed;
  distributed::MpiSession session(&argc, &argv);
  const int rank = distributed::mpi_rank();
  if (rank + 1 < argc) std::this_thread::sleep_for(std::chrono::milliseconds(std::atoi(argv[rank + 1])));
  distributed::refuse(rank, "rank " + std::to_string(rank) + " refuses", 2);
}
