#pragma once

#include <string>

namespace stiction::distributed {

/// One sentence of one rank, from any thread: the lowest that can still speak is the first, and ends the others.
[[noreturn]] void give_up(int rank, const std::string& sentence, int status);

/// Gives up for a reason that all ranks find alike, as a file of another run. A rank waits some seconds for a lower
/// one that speaks for it, however slow either is. MPI's thread alone may call it.
[[noreturn]] void refuse(int rank, const std::string& sentence, int status);

}  // namespace stiction::distributed
