#pragma once

#include <cstring>
#include <vector>

#include "stiction.h"
#include "tests/fuzz/require.hpp"

namespace stiction::fuzz {

/// Requires the promises of every call: a code of the list, never that of a fault of the library, and a text if it
/// failed.
inline bool succeeded(stiction_code code) {
  require(code >= STICTION_OK && code <= STICTION_UNSUPPORTED, stiction_last_error());
  require(code == STICTION_OK || stiction_last_error()[0] != '\0', "a call that failed has a text");
  return code == STICTION_OK;
}

/// Arrays that solves write to: exactly as long as the sound batch needs, filled with bytes that no solve
/// makes.
template <class Real>
struct Answers {
  static constexpr unsigned char kUnwritten = 0xa5;

  std::vector<std::vector<Real>> numbers;
  std::vector<stiction_status> status;

  Answers(const std::vector<std::size_t>& lengths, std::size_t envs) : status(envs) {
    for (const std::size_t length : lengths) numbers.emplace_back(length);
    for (auto& array : numbers) std::memset(array.data(), kUnwritten, array.size() * sizeof(Real));
    std::memset(status.data(), kUnwritten, envs * sizeof(stiction_status));
  }
  [[nodiscard]] bool untouched() const {
    const Answers fresh(lengths(), status.size());
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      if (!same_bits(std::span<const Real>(numbers[i]), std::span<const Real>(fresh.numbers[i]))) return false;
    }
    return std::memcmp(status.data(), fresh.status.data(), status.size() * sizeof(stiction_status)) == 0;
  }
  /// Returns true if environment `env`, of as many equal ones as there are records, has the same bits here and there.
  [[nodiscard]] bool same_in(const Answers& other, std::size_t env) const {
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      const std::size_t length = numbers[i].size() / status.size();
      if (std::memcmp(numbers[i].data() + env * length, other.numbers[i].data() + env * length,
                      length * sizeof(Real)) != 0) {
        return false;
      }
    }
    return std::memcmp(&status[env], &other.status[env], sizeof(stiction_status)) == 0;
  }
  /// Returns true if the numbers written to array `i` are finite. Environments whose offsets or columns are broken are
  /// left out: of those nothing else may have been written.
  [[nodiscard]] bool finite(std::size_t i) const {
    const std::size_t length = numbers[i].size() / status.size();
    for (std::size_t env = 0; env < status.size(); ++env) {
      if ((status[env].flags & STICTION_FLAG_BAD_STRUCTURE) != 0) continue;
      if (!all_finite(std::span<const Real>(numbers[i]).subspan(env * length, length))) return false;
    }
    return true;
  }

 private:
  [[nodiscard]] std::vector<std::size_t> lengths() const {
    std::vector<std::size_t> result;
    for (const auto& array : numbers) result.push_back(array.size());
    return result;
  }
};

}  // namespace stiction::fuzz
