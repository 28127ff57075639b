#include "cpu_fallback/thread_pool.hpp"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "core/base/fp_env.hpp"

namespace stiction::cpu {

int thread_count(int requested) {
  if (requested > 0) return requested;
  return static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
}

void parallel_for(int threads, int items, const std::function<void(int item, int worker)>& work) {
  std::atomic<int> next{0};
  std::mutex mutex;
  std::exception_ptr failure;
  const auto run = [&](int worker) {
    const ScopedFpEnv fp_env;
    try {
      for (int item = next.fetch_add(1); item < items; item = next.fetch_add(1)) work(item, worker);
    } catch (...) {
      next.store(items);
      const std::lock_guard lock(mutex);
      if (!failure) failure = std::current_exception();
    }
  };
  std::vector<std::thread> others;
  for (int worker = 1; worker < threads && worker < items; ++worker) others.emplace_back(run, worker);
  run(0);
  for (std::thread& thread : others) thread.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace stiction::cpu
