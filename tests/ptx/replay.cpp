#include "tests/ptx/replay.hpp"

#include <algorithm>
#include <bit>
#include <stdexcept>

namespace stiction::ptx {

namespace {

using u32 = std::uint32_t;
using u64 = std::uint64_t;

constexpr u32 kWarp = 32;
constexpr u64 kPayload = (u64{1} << 48U) - 1;
constexpr u64 kSector = 32;
constexpr u64 kBank = 4;

std::uint16_t kind_of(u64 event) {
  return static_cast<std::uint16_t>(event >> 48U);
}

template <class F>
void for_each_lane(u32 lanes, const F& f) {
  for (; lanes != 0; lanes &= lanes - 1) f(static_cast<u32>(std::countr_zero(lanes)));
}

/// A lane before a piece that it has not executed.
struct Cursor {
  const u64* first = nullptr;  ///< events in the piece
  const u64* piece = nullptr;  ///< the piece; where the trace ends, its end
  const u64* end = nullptr;
  std::vector<u32> place;  ///< positions of the calls that it is in, and of the piece; empty where the trace ends
  u32 mask = 0;            ///< of lanes that it waits for; 0: for none

  [[nodiscard]] bool has_ended() const { return piece == end; }
  [[nodiscard]] u32 number() const { return static_cast<u32>(*piece & kPayload); }
  /// Goes to the first piece from there on.
  void find(const u64* from, const TracedPiece* pieces) {
    for (first = piece = from; piece != end && kind_of(*piece) != kTracePiece; ++piece) {
      const std::uint16_t kind = kind_of(*piece);
      if (kind == kTraceCall) place.push_back(0);
      if (kind == kTraceReturn) place.pop_back();
      if (kind == kTraceCall || kind == kTraceReturn) first = piece + 1;
    }
    if (has_ended())
      place.clear();
    else
      place.back() = pieces[number()].position;
  }
};

/// One access of lanes that are together.
struct Access {
  u32 lanes = 0;
  u64 address[kWarp];
};

class Warp {
 public:
  Warp(const TracedLaunch& launch, std::size_t first, const std::vector<Place>& places, Issued& sum)
      : launch_(launch), lanes_(launch.lanes.data() + first), places_(places), sum_(sum) {
    for (u32 lane = 0; lane < kWarp; ++lane) {
      const std::vector<u64>& events = lanes_[lane].events;
      cursor_[lane].end = events.data() + events.size();
      cursor_[lane].place = {0};
      cursor_[lane].find(events.data(), launch.code->pieces);
    }
  }

  void run() {
    while (const u32 lanes = furthest_behind()) {
      execute(lanes);
      release();
    }
    for (const Cursor& cursor : cursor_)
      if (!cursor.has_ended()) throw std::runtime_error(launch_.kernel + ": lanes wait for what never comes");
    for (const auto& [function, instructions] : by_function_)
      sum_.by_function[launch_.code->functions[function]] += instructions;
  }

 private:
  /// Lanes at the lowest place among those that do not wait; 0 if there are none.
  [[nodiscard]] u32 furthest_behind() const {
    u32 lanes = 0;
    const Cursor* lowest = nullptr;
    for (u32 lane = 0; lane < kWarp; ++lane) {
      const Cursor& cursor = cursor_[lane];
      if (cursor.has_ended() || cursor.mask != 0) continue;
      if (lowest == nullptr || cursor.place < lowest->place) {
        lowest = &cursor;
        lanes = 0;
      }
      if (cursor.place == lowest->place) lanes |= 1U << lane;
    }
    return lanes;
  }

  /// Lanes go on that wait for lanes that all wait for them.
  void release() {
    u32 free = 0;
    for (u32 lane = 0; lane < kWarp; ++lane) {
      const u32 mask = cursor_[lane].mask;
      bool all = mask != 0;
      for_each_lane(mask, [&](u32 other) { all = all && (cursor_[other].mask == mask || cursor_[other].has_ended()); });
      free |= all ? 1U << lane : 0;
    }
    for_each_lane(free, [&](u32 lane) { cursor_[lane].mask = 0; });
  }

  /// Issues the instructions of the piece that lanes are before.
  void execute(u32 lanes) {
    const TracedPiece& piece = launch_.code->pieces[cursor_[std::countr_zero(lanes)].number()];
    sum_.instructions += piece.instructions;
    sum_.lanes += u64{piece.instructions} * static_cast<u64>(std::popcount(lanes));
    by_function_[piece.function] += piece.instructions;
    bool is_barrier = false;
    std::size_t accesses = 0;
    for_each_lane(lanes, [&](u32 lane) {
      Cursor& cursor = cursor_[lane];
      for (const u64* event = cursor.first; event != cursor.piece; ++event) {
        const std::uint16_t kind = kind_of(*event);
        if (kind == kTraceBarrier || kind == kTraceExchange) {
          is_barrier = kind == kTraceBarrier;
          cursor.mask = static_cast<u32>(*event);
          continue;
        }
        accesses = std::max<std::size_t>(accesses, kind + 1U);
        if (accesses_.size() < accesses) accesses_.resize(accesses);
        accesses_[kind].lanes |= 1U << lane;
        accesses_[kind].address[lane] = *event & kPayload;
      }
      cursor.find(cursor.piece + 1, launch_.code->pieces);
    });
    sum_.barriers += is_barrier ? 1 : 0;
    for (std::size_t k = 0; k < accesses; ++k)
      if (accesses_[k].lanes != 0) {
        count(accesses_[k], launch_.code->access_bytes[piece.access + k]);
        accesses_[k].lanes = 0;
      }
  }

  [[nodiscard]] Memory memory_of(u32 lane, u64 address) const {
    const LaneTrace& trace = lanes_[lane];
    if (address - trace.shared < launch_.shared_bytes) return Memory::shared;
    if (trace.stack - address < kStack) return Memory::stack;
    for (const auto& [begin, end] : launch_.parameters)
      if (address - begin < end - begin) return Memory::parameters;
    for (const Place& place : places_)
      if (address - place.begin < place.end - place.begin) return place.memory;
    return Memory::input;
  }

  void count(const Access& access, u32 bytes) {
    const u32 first = static_cast<u32>(std::countr_zero(access.lanes));
    const Memory memory = memory_of(first, access.address[first]);
    u64& sum = sum_.memory[static_cast<std::size_t>(memory)];
    if (memory == Memory::shared) {
      // As many lanes at once as take 128 bytes together.
      const u32 together = kWarp * 4 / std::max(bytes, 4U);
      for (u32 begin = 0; begin < kWarp; begin += together)
        sum += wavefronts(access, bytes, access.lanes & (~u32{0} >> (kWarp - together)) << begin);
      return;
    }
    touched_.clear();
    for_each_lane(access.lanes, [&](u32 lane) {
      const u64 address = access.address[lane];
      if (memory == Memory::stack) {
        // Words of stacks lie side by side, eight lanes' in a sector.
        const u64 depth = lanes_[lane].stack - address;
        for (u64 at = 0; at < bytes; at += kBank) touched_.push_back((depth - at + 3) / kBank * 4 + lane / 8);
      } else {
        for (u64 at = address / kSector; at <= (address + bytes - 1) / kSector; ++at) touched_.push_back(at);
      }
    });
    sum += distinct();
  }

  /// Times that the busiest bank is taken.
  u64 wavefronts(const Access& access, u32 bytes, u32 lanes) {
    touched_.clear();
    for_each_lane(lanes, [&](u32 lane) {
      const u64 offset = access.address[lane] - lanes_[lane].shared;
      for (u64 at = offset / kBank; at <= (offset + bytes - 1) / kBank; ++at) touched_.push_back(at);
    });
    distinct();
    u64 taken[kWarp] = {}, most = 0;
    for (const u64 word : touched_) most = std::max(most, ++taken[word % kWarp]);
    return most;
  }

  std::size_t distinct() {
    std::sort(touched_.begin(), touched_.end());
    touched_.erase(std::unique(touched_.begin(), touched_.end()), touched_.end());
    return touched_.size();
  }

  static constexpr u64 kStack = u64{1} << 20U;  ///< bytes of a lane's stack, at most

  const TracedLaunch& launch_;
  const LaneTrace* lanes_;
  const std::vector<Place>& places_;
  Issued& sum_;
  Cursor cursor_[kWarp];
  std::vector<Access> accesses_;
  std::vector<u64> touched_;
  std::map<u32, u64> by_function_;
};

}  // namespace

void replay(const TracedLaunch& launch, const std::vector<Place>& places, Issued& sum) {
  for (std::size_t first = 0; first < launch.lanes.size(); first += kWarp) Warp(launch, first, places, sum).run();
}

}  // namespace stiction::ptx
