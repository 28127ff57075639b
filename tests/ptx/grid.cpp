#include "tests/ptx/grid.hpp"

#include <boost/context/protected_fixedsize_stack.hpp>

#include <cstring>
#include <mutex>

#include "cuda/emulated/guarded_memory.hpp"
#include "stiction/error.hpp"
#include "tests/ptx/trace.hpp"

namespace stiction::ptx {

namespace {

constexpr u32 kWarp = 32;
constexpr std::size_t kStackBytes = std::size_t{1} << 20;
/// As an H200 has them; few multiprocessors, so that teams have several environments each.
constexpr std::size_t kBlockBytes = std::size_t{227} << 10;
constexpr int kProcessors = 3;
/// Turns in a row without anything else: the awaited number is never written.
constexpr u64 kMostTurns = 1U << 20;

cuda::DeviceFacts facts() {
  return {"PTX on the CPU", kProcessors, kBlockBytes, std::size_t{228} << 10};
}

/// Stacks that are used again, each with a page before it that nothing may touch.
class Stacks {
 public:
  boost::context::stack_context allocate() {
    auto& free = all();
    if (free.empty()) return boost::context::protected_fixedsize_stack(kStackBytes).allocate();
    const boost::context::stack_context stack = free.back();
    free.pop_back();
    return stack;
  }
  void deallocate(boost::context::stack_context& stack) noexcept { all().push_back(stack); }

 private:
  static std::vector<boost::context::stack_context>& all() {
    thread_local std::vector<boost::context::stack_context> free;
    return free;
  }
};

/// Fast memory of a block, filled with bytes that no program may rely on.
void* allocate_shared(std::size_t bytes) {
  void* const memory = cuda::allocate_guarded(bytes);
  if (memory == nullptr) throw Error(ErrorCode::out_of_memory, "PTX: no memory for a block's shared memory");
  std::memset(memory, 0x5a, bytes);
  return memory;
}

std::vector<TracedLaunch>*& recorded_launches() {
  static std::vector<TracedLaunch>* launches = nullptr;
  return launches;
}

/// Memory of a grid that is one team.
void* grid_memory() {
  static std::vector<std::max_align_t> memory(cuda::kGridBytes / sizeof(std::max_align_t) + 1);
  return memory.data();
}

}  // namespace

void record_traces(std::vector<TracedLaunch>* launches) {
  recorded_launches() = launches;
}

Grid::Grid(Kernel& kernel, const cuda::LaunchShape& shape)
    : kernel_(kernel),
      shape_(shape),
      grid_(cuda::launch_grid(shape, kernel.is_serial, facts(), grid_memory())),
      blocks_(static_cast<u32>(cuda::blocks_of(shape, grid_, kProcessors))),
      random_(0x9e3779b97f4a7c15U * (kernel.launches + 1)) {}

Grid::~Grid() {
  threads_.clear();
  for (void* const memory : shared_) cuda::release_guarded(memory, grid_.shared);
}

void Grid::start(const void* arguments) {
  const std::vector<std::size_t>& bytes = kernel_.parameter_bytes;
  const void* const given[] = {arguments, &grid_.shape};
  if (bytes.size() != 2 || bytes[1] != sizeof(grid_.shape))
    throw Error(ErrorCode::device_failure, std::string("PTX: ") + kernel_.name + " has other parameters than a launch");
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    parameters_.push_back(std::make_unique<unsigned char[]>(bytes[i]));
    std::memcpy(parameters_.back().get(), given[i], bytes[i]);
    parameter_.push_back(parameters_.back().get());
  }
  if (grid_.shared > kBlockBytes)
    throw Error(ErrorCode::device_failure, std::string("PTX: ") + kernel_.name + " asks for " +
                                               std::to_string(grid_.shared) + " bytes of shared memory, of " +
                                               std::to_string(kBlockBytes));
  if (static_cast<u32>(grid_.block) > kernel_.most_threads)
    throw Error(ErrorCode::device_failure, std::string("PTX: ") + kernel_.name + " is launched with " +
                                               std::to_string(grid_.block) + " threads a block and was compiled for " +
                                               std::to_string(kernel_.most_threads));
  for (u32 block = 0; block < blocks_; ++block) shared_.push_back(allocate_shared(grid_.shared));
  const auto block_size = static_cast<u32>(grid_.block);
  at_block_.assign(blocks_, 0);
  ended_.assign(blocks_, 0);
  threads_.resize(std::size_t{blocks_} * block_size);
  begin_trace(arguments);
  for (u32 i = 0; i < threads_.size(); ++i) {
    Thread& thread = threads_[i];
    const u32 block = i / block_size;
    thread.lane = {this,
                   i % block_size,
                   block,
                   block_size,
                   static_cast<u32>(grid_.width),
                   blocks_,
                   static_cast<unsigned char*>(shared_[block]),
                   0,
                   nullptr};
    if (traced_ != nullptr) {
      thread.lane.trace = &recorded_launches()->back().lanes[i];
      thread.lane.trace->shared = reinterpret_cast<u64>(shared_[block]);
    }
    thread.fiber = boost::context::fiber(std::allocator_arg, Stacks(), [this, &thread](boost::context::fiber&& caller) {
      scheduler_ = std::move(caller);
      if (traced_ != nullptr) {
        thread.lane.trace->stack = reinterpret_cast<u64>(__builtin_frame_address(0));
        traced_->enter(thread.lane, parameter_.data());
      } else {
        kernel_.enter(thread.lane, parameter_.data());
      }
      thread.wait.what = Waiting::end;
      return std::move(scheduler_);
    });
    make_ready(i);
  }
}

void Grid::begin_trace(const void* arguments) {
  std::vector<TracedLaunch>* const launches = recorded_launches();
  if (launches == nullptr) return;
  for (const TracedKernel& traced : traced_kernels())
    if (std::strcmp(traced.name, kernel_.name) == 0) traced_ = &traced;
  if (traced_ == nullptr) return;
  const auto* const bytes = static_cast<const unsigned char*>(arguments);
  TracedLaunch& launch = launches->emplace_back();
  launch.code = traced_->code;
  launch.kernel = kernel_.name;
  launch.arguments.assign(bytes, bytes + kernel_.parameter_bytes[0]);
  for (std::size_t i = 0; i < parameter_.size(); ++i) {
    launch.parameters[i][0] = reinterpret_cast<u64>(parameter_[i]);
    launch.parameters[i][1] = launch.parameters[i][0] + kernel_.parameter_bytes[i];
  }
  launch.shared_bytes = grid_.shared;
  launch.lanes.resize(threads_.size());
}

void Grid::run(const void* arguments) {
  static std::mutex one_at_a_time;
  const std::lock_guard lock(one_at_a_time);
  start(arguments);
  u64 left = threads_.size();
  while (left > 0) {
    if (ready_.empty()) report_deadlock();
    Thread& thread = threads_[next_ready()];
    resume(thread);
    if (!failure_.empty()) throw Error(ErrorCode::device_failure, failure_);
    turns_ = thread.wait.what == Waiting::turn ? turns_ + 1 : 0;
    if (turns_ > kMostTurns) fail(thread.lane, "waits for what no lane writes");
    left -= thread.wait.what == Waiting::end ? 1 : 0;
    release(thread);
  }
  for (const Thread& thread : threads_) kernel_.instructions += thread.lane.instructions;
}

void Grid::resume(Thread& thread) {
  thread.wait = {};
  running_ = &thread;
  thread.fiber = std::move(thread.fiber).resume();
  running_ = nullptr;
}

u32 Grid::wait(const Wait& wait) {
  Thread& thread = *running_;
  thread.wait = wait;
  scheduler_ = std::move(scheduler_).resume();
  return thread.received;
}

void Grid::fail(const Lane& lane, const std::string& what) {
  const std::string where = std::string("PTX: ") + kernel_.name + ", block " + std::to_string(lane.block) +
                            ", thread " + std::to_string(lane.thread) + " " + what;
  if (running_ == nullptr) throw Error(ErrorCode::device_failure, where);
  failure_ = where;
  for (;;) wait({Waiting::end, 0, 0, 0});
}

u32 Grid::next_ready() {
  random_ ^= random_ << 13U;
  random_ ^= random_ >> 7U;
  random_ ^= random_ << 17U;
  const std::size_t at = random_ % ready_.size();
  const u32 thread = ready_[at];
  ready_[at] = ready_.back();
  ready_.pop_back();
  return thread;
}

void Grid::release(Thread& thread) {
  switch (thread.wait.what) {
    case Waiting::nothing:
    case Waiting::turn:
      make_ready(static_cast<u32>(&thread - threads_.data()));
      return;
    case Waiting::end:
      ++ended_[thread.lane.block];
      return;
    case Waiting::block:
      if (++at_block_[thread.lane.block] == thread.lane.block_size) release_block(thread.lane.block);
      return;
    default:
      release_warp(thread);
  }
}

void Grid::release_block(u32 block) {
  at_block_[block] = 0;
  const auto size = static_cast<u32>(grid_.block);
  for (u32 i = block * size; i < (block + 1) * size; ++i) make_ready(i);
}

void Grid::release_warp(Thread& thread) {
  const u32 mask = thread.wait.mask, own = thread.lane.thread % kWarp;
  if ((mask >> own & 1U) == 0) fail(thread.lane, "is not in the mask of its own barrier");
  Thread* const warp = &thread - own;
  u32 joined = 0;
  for (u32 k = 0; k < kWarp; ++k) {
    if ((mask >> k & 1U) == 0) continue;
    const Waiting what = warp[k].wait.what;
    if (what == Waiting::end) fail(thread.lane, "waits for a lane that has ended");
    if (what == Waiting::nothing || what == Waiting::turn) return;
    if (what != thread.wait.what || warp[k].wait.mask != mask) return;
    joined = what == Waiting::any ? joined | warp[k].wait.value : joined + warp[k].wait.value;
  }
  const auto first = static_cast<u32>(warp - threads_.data());
  for (u32 k = 0; k < kWarp; ++k) {
    if ((mask >> k & 1U) == 0) continue;
    warp[k].received = joined;
    if (warp[k].wait.what != Waiting::shuffle) continue;
    if ((mask >> warp[k].wait.from & 1U) == 0) fail(warp[k].lane, "takes the value of a lane outside of its mask");
    warp[k].received = warp[warp[k].wait.from].wait.value;
  }
  for (u32 k = 0; k < kWarp; ++k) {
    if ((mask >> k & 1U) == 0) continue;
    warp[k].wait.what = Waiting::nothing;
    make_ready(first + k);
  }
}

void Grid::report_deadlock() const {
  for (const Thread& thread : threads_)
    if (thread.wait.what != Waiting::end)
      throw Error(ErrorCode::device_failure,
                  std::string("PTX: ") + kernel_.name + ", block " + std::to_string(thread.lane.block) + ", thread " +
                      std::to_string(thread.lane.thread) + " waits at a barrier that others never reach");
  throw Error(ErrorCode::device_failure, std::string("PTX: ") + kernel_.name + " ended with lanes left");
}

}  // namespace stiction::ptx
