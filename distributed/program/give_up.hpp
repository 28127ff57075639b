#pragma once

#include <string>

namespace stiction::distributed {

/// One sentence of one rank: the lowest that can still speak is the first, and ends the others.
[[noreturn]] void give_up(int rank, const std::string& sentence, int status);

}  // namespace stiction::distributed
