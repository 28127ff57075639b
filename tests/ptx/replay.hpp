#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "tests/ptx/trace.hpp"

/// Replays traces of lanes as a GPU's warps execute them, in lock-step.
namespace stiction::ptx {

/// Kinds of memory that an access reaches.
enum class Memory : unsigned char { scratch, lists, input, output, stack, shared, parameters };
inline constexpr int kMemories = 7;

/// Addresses of one kind. All others are input.
struct Place {
  std::uint64_t begin, end;
  Memory memory;
};
template <class T>
Place place_of(const T* array, std::int64_t count, Memory memory) {
  const auto begin = reinterpret_cast<std::uint64_t>(array);
  return {begin, begin + static_cast<std::uint64_t>(count) * sizeof(T), memory};
}

/// Counts of issued instructions of warps.
struct Issued {
  std::uint64_t instructions = 0;
  std::uint64_t lanes = 0;  ///< the same, once for each lane that took part
  std::uint64_t barriers = 0;
  /// Sectors of 32 bytes by Memory; for shared memory, wavefronts, which take each of 32 banks of 4 bytes once.
  std::array<std::uint64_t, kMemories> memory{};
  std::map<std::string, std::uint64_t> by_function;  ///< instructions, by mangled name

  /// Share of lanes that took part in issued instructions.
  [[nodiscard]] double efficiency() const {
    return static_cast<double>(lanes) / 32.0 / static_cast<double>(instructions);
  }
  [[nodiscard]] std::uint64_t of(Memory kind) const { return memory[static_cast<std::size_t>(kind)]; }
};

/// Adds a launch. Lanes of a warp that are furthest behind go on: in the function that was called first, at the lowest
/// position. All that are there go together. A lane at an instruction that waits for a mask of lanes stays until
/// they wait, too.
/// \throws std::runtime_error if lanes wait for an event that never comes.
void replay(const TracedLaunch& launch, const std::vector<Place>& places, Issued& sum);

}  // namespace stiction::ptx
