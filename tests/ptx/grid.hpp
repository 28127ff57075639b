#pragma once

#include <boost/context/fiber.hpp>

#include <memory>
#include <string>
#include <vector>

#include "cuda/native/launch_grid.hpp"
#include "tests/ptx/lane.hpp"

namespace stiction::ptx {

/// Event that a lane waits for.
enum class Waiting : unsigned char {
  nothing,
  turn,     ///< that others have run
  block,    ///< bar.sync
  warp,     ///< bar.warp.sync
  shuffle,  ///< shfl.sync
  any,      ///< redux.sync.or
  sum,      ///< redux.sync.add
  end,      ///< the lane has ended
};
struct Wait {
  Waiting what = Waiting::nothing;
  u32 mask = 0;
  u32 value = 0;  ///< that the lane brings
  u32 from = 0;   ///< lane whose value it takes
};

/// The blocks of one launch, all at once, lane by lane in an order that a seed decides. Lanes change places at
/// barriers only, so that a write without a barrier is seen by some lanes and not by others.
class Grid {
 public:
  Grid(Kernel& kernel, const cuda::LaunchShape& shape);
  ~Grid();
  Grid(const Grid&) = delete;
  Grid& operator=(const Grid&) = delete;

  /// Runs every lane to its end. \throws Error(device_failure)
  void run(const void* arguments);

  /// Called by the lane that runs: lets others run until it need not wait; returns the exchanged value.
  u32 wait(const Wait& wait);
  [[noreturn]] void fail(const Lane& lane, const std::string& what);
  [[nodiscard]] u64 barrier_address() const { return shape_.whole_device ? reinterpret_cast<u64>(barrier_) : 0; }

 private:
  struct Thread {
    Lane lane;
    boost::context::fiber fiber;
    Wait wait;
    u32 received = 0;
  };

  void start(const void* arguments);
  /// Begins a trace of the launch, if it is to leave one.
  void begin_trace(const void* arguments);
  void resume(Thread& thread);
  /// Releases lanes that wait with `thread`, if they are all here.
  void release(Thread& thread);
  void release_block(u32 block);
  void release_warp(Thread& thread);
  void make_ready(u32 thread) { ready_.push_back(thread); }
  u32 next_ready();
  [[noreturn]] void report_deadlock() const;

  Kernel& kernel_;
  const TracedKernel* traced_ = nullptr;  ///< executed in its place
  cuda::LaunchShape shape_;
  cuda::LaunchGrid grid_;
  u32 blocks_ = 0;
  std::vector<Thread> threads_;
  std::vector<u32> ready_;     ///< threads that need not wait
  std::vector<u32> at_block_;  ///< threads of each block at its barrier
  std::vector<u32> ended_;     ///< of each block
  std::vector<std::unique_ptr<unsigned char[]>> parameters_;
  std::vector<unsigned char*> parameter_;
  std::vector<void*> shared_;  ///< fast memory of each block
  boost::context::fiber scheduler_;
  Thread* running_ = nullptr;
  std::string failure_;
  u64 random_;
  u64 turns_ = 0;  ///< given since anything else happened
  alignas(16) u32 barrier_[4] = {};
};

}  // namespace stiction::ptx
