#pragma once

#include <functional>

namespace stiction::cpu {

/// Threads to use when `requested` are asked for; 0 asks for all cores.
int thread_count(int requested);

/// Runs work(item, worker) for every item in [0, items) on `threads` threads, the caller's among them, each taking the
/// next item when it is free. Items are independent and an environment never crosses threads, so who takes what reaches
/// no result. Every thread has the bodies' floating-point environment. The first exception is rethrown when all
/// stopped.
void parallel_for(int threads, int items, const std::function<void(int item, int worker)>& work);

}  // namespace stiction::cpu
