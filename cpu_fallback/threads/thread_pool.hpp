#pragma once

#include <functional>

#include "stiction/types.hpp"

namespace stiction::cpu {

/// Threads to use when `requested` are asked for; 0 asks for all cores.
int thread_count(int requested);

/// work(item, worker): `worker` is in [0, threads) and no other thread's while the call lasts.
using ItemWork = std::function<void(int item, int worker)>;

/// Runs work(item, worker) for every item in [0, items) on at most `threads` threads, including the caller's. Each
/// takes the next item when it is free. Items are independent and an environment never crosses threads, so the choice
/// of threads reaches no result. Every thread has the algorithms' floating-point environment. The first exception is
/// rethrown when all stopped.
void parallel_for(int threads, int items, const ItemWork& work);

/// Work in parts: a ParallelFor for work on environments that takes some ten nanoseconds each.
void parallel_for(int threads, Offset count, const std::function<void(Offset, Offset)>& work);

/// Threads that the items are dealt out to: the library's own, which sleep between calls, or oneTBB's.
enum class PoolKind : unsigned char { own, tbb };
bool has_pool(PoolKind kind);
/// Work by one of the two pools. \throws Error(unsupported) if the build has it not.
void parallel_for(PoolKind kind, int threads, int items, const ItemWork& work);
/// Which one parallel_for() takes from now on: oneTBB where the build has it. For tests.
void set_pool(PoolKind kind);

}  // namespace stiction::cpu
