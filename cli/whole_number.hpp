#pragma once

#include <CLI/CLI.hpp>
#include <charconv>
#include <string>

namespace stiction::cli {

/// A check of an option: a whole number of at least `least`. Numbers beyond 64 bits are refused here, for CLI11 would
/// take the largest number that they hold. In a header, as step_options.hpp is.
inline CLI::Validator whole_number(unsigned long long least = 0) {
  const auto check = [least](std::string& text) {
    const std::size_t sign = text.rfind('+', 0) == 0 ? 1 : 0;
    unsigned long long number = 0;
    const auto [end, error] = std::from_chars(text.data() + sign, text.data() + text.size(), number);
    if (error == std::errc::result_out_of_range) return text + " is more than 64 bits hold";
    if (error == std::errc() && end == text.data() + text.size() && number >= least) return std::string();
    return text + " is not a whole number of at least " + std::to_string(least);
  };
  return {check, least == 0 ? "NONNEGATIVE" : "POSITIVE"};
}

}  // namespace stiction::cli
