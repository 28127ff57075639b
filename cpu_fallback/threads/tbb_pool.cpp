#include <pthread.h>
#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>
#include <tbb/task_arena.h>

#include <atomic>
#include <new>

#include "core/base/extents.hpp"
#include "core/base/fp_env.hpp"
#include "cpu_fallback/threads/pools.hpp"

namespace stiction::cpu {

namespace {

std::atomic<bool> was_used{false};

/// Before a fork, waits until oneTBB's workers have ended; the next call makes new ones. A worker on its way to sleep
/// may hold a lock of oneTBB's. In the child it is held for good, and the child's exit waits for it. In a program that
/// knows oneTBB alone, 4 of 6000 children never ended, and none of 6000 with this. While another thread is at work
/// there, nothing is waited for.
void end_workers() {
  if (!was_used) return;
  tbb::task_scheduler_handle workers{tbb::attach{}};
  tbb::finalize(workers, std::nothrow);
}

[[maybe_unused]] const int kForkIsPrepared = pthread_atfork(end_workers, nullptr, nullptr);

}  // namespace

void tbb_parallel_for(int threads, int items, const ItemWork& work) {
  was_used = true;
  // In an arena of its own the caller takes no work of others while it waits, and indices stay below `threads`.
  // oneTBB writes a warning to the standard error when it is asked for more than it may have.
  const auto allowed = tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism);
  tbb::task_arena arena(smaller_of(threads, static_cast<int>(allowed)));
  arena.execute([&] {
    tbb::parallel_for(
        tbb::blocked_range<int>(0, items, 1),
        [&](const tbb::blocked_range<int>& range) {
          const ScopedFpEnv fp_env;
          const int worker = tbb::this_task_arena::current_thread_index();
          for (int item = range.begin(); item != range.end(); ++item) work(item, worker);
        },
        tbb::simple_partitioner());
  });
}

}  // namespace stiction::cpu
