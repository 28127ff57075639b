#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "stiction/io.hpp"

/// Parts of a checkpoint's file, for the writer of a whole one and for ranks that write one together.
namespace stiction::io {

inline constexpr const char* kCheckpointFormat = "world-checkpoint";
inline constexpr std::int64_t kCheckpointVersion = 1;
inline constexpr std::size_t kCheckpointReals = 5;

/// f(name, numbers), for every array of real numbers, kCheckpointReals of them.
template <class World, class F>
void for_each_reals(World& world, F&& f) {
  f("position", world.position);
  f("orientation", world.orientation);
  f("twist", world.twist);
  f("wrench", world.wrench);
  f("impulse", world.impulse);
}

/// Writes the root's attributes by file.attribute(name, text or integer).
template <class File>
void put_attributes(File& file, const CheckpointHead& head, std::int64_t checksum) {
  file.attribute("format", kCheckpointFormat);
  file.attribute("version", kCheckpointVersion);
  file.attribute("numerics_epoch", std::int64_t{kNumericsEpoch});
  file.attribute("run", head.run);
  file.attribute("step", head.step);
  file.attribute("checksum", checksum);
}

/// Sums that make up the checksum. Hashes are sums over elements, so writers that each have some of them add up theirs.
struct CheckpointTotals {
  std::vector<Offset> contact_offsets;                   ///< of the whole                           (E + 1)
  std::uint64_t ids = 0;                                 ///< hash_of_ids() of all ids
  std::array<std::uint64_t, kCheckpointReals> sizes{};   ///< numbers in each array of for_each_reals()
  std::array<std::uint64_t, kCheckpointReals> hashes{};  ///< hash_bits() of each array
};

/// Returns the part of those contact ids in the checksum; `first`: ids before them in a file of that many environments.
std::uint64_t hash_of_ids(const CheckpointHead& head, std::size_t environments, std::span<const std::uint64_t> ids,
                          std::uint64_t first);
/// Returns the checksum of all that a file holds.
std::int64_t checksum_of(const CheckpointHead& head, const CheckpointTotals& totals);

/// Makes a complete file that lies beside a checkpoint the checkpoint, when it is on the disk. Parts of the one that
/// was there are removed. \throws Error(io)
void put_checkpoint_in_place(const std::filesystem::path& written, const std::filesystem::path& path);

}  // namespace stiction::io
