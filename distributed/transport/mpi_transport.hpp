#pragma once

#include <memory>

#include "distributed/transport/transport.hpp"

namespace stiction::distributed {

/// MPI from here on until the object goes. One at a time.
class MpiSession {
 public:
  MpiSession(int* argc, char*** argv);
  ~MpiSession();
  MpiSession(const MpiSession&) = delete;
  MpiSession& operator=(const MpiSession&) = delete;
};

/// This process's rank, within a session.
int mpi_rank();

/// The ranks that mpirun has started, over host memory. \throws Error(invalid_argument) for a wrong deadline.
std::unique_ptr<Transport> mpi_transport(double deadline_seconds);

/// Tells all higher ranks that this one prints why the job ends. Waits a second at most until they can know.
void mpi_say_refused();

/// Returns true if a lower rank did so.
bool mpi_is_refused();

/// Ends all ranks at once with that exit status; they may be waiting, or stopped.
[[noreturn]] void mpi_abort(int status);

}  // namespace stiction::distributed
