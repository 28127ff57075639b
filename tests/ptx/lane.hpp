#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "cuda/emulated/emulated_launch.hpp"

/// Executes PTX that tools/ptx_to_cpp.py has translated: CUDA's threads as fibers of one thread of the CPU.
namespace stiction::ptx {

using u8 = std::uint8_t;
using u16 = std::uint16_t;
using u32 = std::uint32_t;
using u64 = std::uint64_t;
using i8 = std::int8_t;
using i16 = std::int16_t;
using i32 = std::int32_t;
using i64 = std::int64_t;
using b8 = u8;
using b16 = u16;
using b32 = u32;
using b64 = u64;

class Grid;
struct LaneTrace;
struct TracedCode;
struct TracedLaunch;

/// A thread of CUDA. Interface to translated code; the rest is its grid's.
struct Lane {
  Grid* grid = nullptr;
  u32 thread = 0;  ///< in its block
  u32 block = 0;
  u32 block_size = 0;
  u32 width = 1;  ///< first dimension of its block
  u32 blocks = 0;
  unsigned char* shared = nullptr;  ///< fast memory of its block
  u64 instructions = 0;             ///< executed
  LaneTrace* trace = nullptr;       ///< that it leaves, if its code was translated so

  /// Calls of code that leaves a trace. A piece is executed. A function is entered, or left. An access of the piece
  /// reaches an address, which is returned.
  void trace_piece(u32 number) const;
  void trace_call(bool enters) const;
  [[nodiscard]] u64 trace_access(u16 number, u64 address) const;

  void count(unsigned executed) { instructions += executed; }

  [[nodiscard]] u64 shared_address(u64 offset) const { return reinterpret_cast<u64>(shared) + offset; }
  [[nodiscard]] u64 shared_offset(u64 address) const { return address - reinterpret_cast<u64>(shared); }
  /// Returns the block's dynamic shared memory, in the space of shared memory.
  [[nodiscard]] static u64 shared_symbol() { return 0; }
  /// Half of the address of a cooperative grid's barrier; 0 where the launch is none.
  [[nodiscard]] u32 grid_word(int half) const;

  /// Waits until every thread of the block waits here.
  void meet_block();
  /// Waits until every lane of `mask` waits here with the same mask.
  void meet_warp(u32 mask);
  u32 shuffle_bfly(u32 value, u32 distance, u32 bounds, u32 mask);
  u32 shuffle_idx(u32 value, u32 source, u32 bounds, u32 mask);
  u32 reduce_or(u32 value, u32 mask);
  u32 reduce_add(u32 value, u32 mask);
  /// Lets others run: this lane reads a number that one of them is to write.
  void spin();
  [[noreturn]] void leave();
  [[noreturn]] void trap();
};

/// One kernel, translated.
struct Kernel {
  const char* name;  ///< mangled
  void (*enter)(Lane& lane, unsigned char** parameters);
  cuda::EmulatedKernel emulated;  ///< the kernel as the emulated device takes one
  std::vector<std::size_t> parameter_bytes;
  u32 most_threads;        ///< of a block: the compiled limit
  bool is_serial = false;  ///< each lane is a team
  u64 launches = 0;
  u64 instructions = 0;  ///< executed by all lanes
};

/// Runs a launch as CudaApi would shape it. A misaligned address ends the process with a message, one outside of an
/// allocation by a signal. \throws Error(device_failure) that names the lane and its fault: a barrier that others
/// never reach, a mask without the lane, a trap. A launch with more shared memory than there is does, too.
void launch(Kernel& kernel, const cuda::EmulatedLaunch& shape, const void* arguments);

/// A kernel translated once more, so that its lanes leave traces.
struct TracedKernel {
  const char* name;  ///< mangled
  void (*enter)(Lane& lane, unsigned char** parameters);
  const TracedCode* code;
};
std::vector<TracedKernel>& traced_kernels();
struct RegisteredTrace {
  explicit RegisteredTrace(const TracedKernel& kernel) { traced_kernels().push_back(kernel); }
};
/// Records launches of traced kernels in `launches` from now on, in place of the others; null: records none.
void record_traces(std::vector<TracedLaunch>* launches);

/// Every kernel that was translated.
std::vector<Kernel*>& kernels();
struct Registered {
  explicit Registered(Kernel& kernel) { kernels().push_back(&kernel); }
};

}  // namespace stiction::ptx
