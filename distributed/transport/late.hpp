#pragma once

#include <chrono>
#include <cstddef>
#include <string>
#include <vector>

namespace stiction::distributed {

/// The deadline of a transport. \throws Error(invalid_argument) unless it is a number of seconds above zero, at most
/// a day.
std::chrono::steady_clock::duration deadline_of(double seconds);

/// "rank 1: rank 0 has not answered within the deadline; ..."
std::string text_of_late(int rank, const std::vector<int>& silent);
/// "rank 1: WHY; ..."
std::string text_of_loss(int rank, const std::string& why);
std::string text_of_size(int rank, int from, std::size_t bytes, std::size_t expected);

}  // namespace stiction::distributed
