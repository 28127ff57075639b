#pragma once

#include <cstddef>

#include "stiction/types.hpp"

namespace stiction::cuda {

/// A program compiled for one device. The meaning of `entry` is that device's own.
struct KernelRef {
  const char* name;
  const void* entry;
  std::size_t argument_bytes;
};

/// Lanes that work as one team and how many such teams have something to do. A device may run fewer teams at once than
/// asked for, so a program takes its items by TeamId: none is ever left out.
struct LaunchShape {
  Offset teams = 0;              ///< teams there is work for
  int lanes = 1;                 ///< lanes of a team: 1, 4, 8, 16, 32, or a multiple of 32 up to kMostLanes
  std::size_t shared_bytes = 0;  ///< fast memory of a team
  bool whole_device = false;     ///< one team of every block of `lanes` lanes that the device runs at once
};

inline constexpr int kWarp = 32;          ///< lanes that run in lock-step
inline constexpr int kMostLanes = 256;    ///< of a team within one block
inline constexpr int kTeamThreads = 128;  ///< of a block at most whose teams are smaller

/// A launch as a device takes it. Blocks of a whole device might wait for one that never runs while others hold
/// multiprocessors: one block is the team there.
inline LaunchShape shape_on(const LaunchShape& shape, bool is_whole) {
  LaunchShape own = shape;
  if (!shape.whole_device || is_whole) return own;
  own.whole_device = false;
  own.teams = shape.teams > 0 ? 1 : 0;
  return own;
}

/// Fast memory that a team keeps for itself, beside that of a launch [bytes].
inline constexpr std::size_t kTeamBytes = 768;
/// Bytes of fast memory in the alignment of its contents.
inline constexpr std::size_t in_shared(std::size_t bytes) {
  return (bytes + 15) / 16 * 16;
}
/// Fast memory of the smallest block of a launch whose teams have so much each. No block is smaller than a warp, whose
/// teams share it.
inline constexpr std::size_t least_block_bytes(int lanes, std::size_t shared_bytes) {
  return static_cast<std::size_t>(lanes < kWarp ? kWarp / lanes : 1) * (kTeamBytes + in_shared(shared_bytes));
}

/// Which of the launch's teams this is. A program is a type
///
///     struct P {
///       using Args = ...;                     // trivially copyable, at most 4 kB
///       static constexpr bool kSerial = ...;  // lanes == 1 always
///       static constexpr int kThreads = ...;  // if there: of a block at most, a multiple of its lanes
///       template <Team TeamT> static STICTION_HD void run(TeamT& team, const TeamId& id, const Args& args);
///     };
///
/// whose run() is called once by every lane of every team. `team` is a Team (core/team/team.hpp) that also has two
/// functions, whose result is the same on every lane. `fetch(counter, count = 1)` is the counter's value before it grew
/// by count, and `total(integer)` is the sum over the lanes.
struct TeamId {
  Offset index;  ///< this team, 0 <= index < count
  Offset count;  ///< teams that run
  void* shared;  ///< LaunchShape::shared_bytes of fast memory, not initialised
};

}  // namespace stiction::cuda
