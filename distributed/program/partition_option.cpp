#include "distributed/program/partition_option.hpp"

#include <fmt/format.h>

#include <charconv>
#include <string_view>

#include "stiction/error.hpp"

namespace stiction::distributed {

std::optional<std::uint64_t> partition_seed(const std::string& text) {
  if (text == "bisection") return std::nullopt;
  constexpr std::string_view kRandom = "random:";
  std::uint64_t seed = 0;
  if (text.starts_with(kRandom)) {
    const char* const begin = text.data() + kRandom.size();
    const char* const end = text.data() + text.size();
    const auto [rest, error] = std::from_chars(begin, end, seed);
    if (error == std::errc{} && rest == end) return seed;
  }
  throw Error(ErrorCode::invalid_argument, fmt::format("--partition {}: expected bisection or random:SEED", text));
}

}  // namespace stiction::distributed
