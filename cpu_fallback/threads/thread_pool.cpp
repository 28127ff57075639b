#include "cpu_fallback/threads/thread_pool.hpp"

#include <pthread.h>

#include <atomic>
#include <thread>

#include "core/base/extents.hpp"
#include "core/base/fp_env.hpp"
#include "cpu_fallback/threads/pools.hpp"
#include "cpu_fallback/threads/section.hpp"
#include "stiction/error.hpp"

namespace stiction::cpu {

namespace {

#ifdef STICTION_HAS_TBB
constexpr bool kHasTbb = true;
#else
constexpr bool kHasTbb = false;
#endif

std::atomic<PoolKind> chosen{kHasTbb ? PoolKind::tbb : PoolKind::own};

/// oneTBB's workers do not follow a fork() and it makes no new ones.
[[maybe_unused]] const int kForkIsHandled = pthread_atfork(nullptr, nullptr, [] { chosen = PoolKind::own; });

void require(PoolKind kind) {
  if (!has_pool(kind))
    throw Error(ErrorCode::unsupported, "this build has no oneTBB: configure with STICTION_ENABLE_TBB=ON");
}

void share_out([[maybe_unused]] PoolKind kind, int threads, int items, const ItemWork& work) {
  if (threads <= 1 || items == 1) {
    const ScopedFpEnv fp_env;
    for (int item = 0; item < items; ++item) work(item, 0);
    return;
  }
#ifdef STICTION_HAS_TBB
  if (kind == PoolKind::tbb) return tbb_parallel_for(threads, items, work);
#endif
  own_parallel_for(threads, items, work);
}

}  // namespace

int thread_count(int requested) {
  if (requested > 0) return requested;
  // Asked once: the C library may open a file to count them, which takes longer than a small solve.
  static const int cores = static_cast<int>(larger_of(1U, std::thread::hardware_concurrency()));
  return cores;
}

bool has_pool(PoolKind kind) {
  return kind == PoolKind::own || kHasTbb;
}

void set_pool(PoolKind kind) {
  require(kind);
  chosen = kind;
}

void parallel_for(PoolKind kind, int threads, int items, const ItemWork& work) {
  require(kind);
  if (items <= 0) return;
  ThreadMeter* const meter = Section::meter();
  if (meter == nullptr) return share_out(kind, threads, items, work);
  Section section(*meter, threads);
  share_out(kind, threads, items, [&](int item, int worker) {
    const Section::Clock::time_point start = Section::Clock::now();
    work(item, worker);
    section.worked(worker, start);
  });
}

void parallel_for(int threads, int items, const ItemWork& work) {
  parallel_for(chosen, threads, items, work);
}

void parallel_for(int threads, Offset count, const std::function<void(Offset, Offset)>& work) {
  // Waking a thread takes as long as looking at some hundred environments.
  constexpr Offset kPart = 512;
  const auto parts = static_cast<int>((count + kPart - 1) / kPart);
  parallel_for(threads, parts, [&](int part, int) {
    const Offset begin = part * kPart;
    work(begin, smaller_of(begin + kPart, count));
  });
}

}  // namespace stiction::cpu
