#include <pthread.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

#include "core/base/extents.hpp"
#include "core/base/fp_env.hpp"
#include "cpu_fallback/threads/pools.hpp"

namespace stiction::cpu {

namespace {

/// One call of parallel_for(), which lives until its caller has seen the last helper leave.
class Call {
 public:
  Call(int threads, int items, const ItemWork& work)
      : open_seats(smaller_of(threads, items) - 1), items_(items), work_(work) {}

  void run(int worker) {
    const ScopedFpEnv fp_env;
    try {
      for (int item = next_.fetch_add(1); item < items_; item = next_.fetch_add(1)) work_(item, worker);
    } catch (...) {
      next_.store(items_);
      const std::lock_guard lock(mutex_);
      if (!failure_) failure_ = std::current_exception();
    }
  }
  void rethrow() const {
    if (failure_) std::rethrow_exception(failure_);
  }

  int open_seats;     // guarded by the pool: how many helpers may still join
  int next_seat = 1;  // guarded by the pool
  int helping = 0;    // guarded by the pool: helpers that joined and have not left

 private:
  const int items_;
  const ItemWork& work_;
  std::atomic<int> next_{0};
  std::mutex mutex_;
  std::exception_ptr failure_;
};

/// Threads that sleep between calls. A call never waits for a helper to come: its own thread does the rest. Calls from
/// several threads, and from within items, hence proceed with however many helpers are free.
class Pool {
 public:
  Pool() = default;
  Pool(const Pool&) = delete;
  Pool& operator=(const Pool&) = delete;
  ~Pool() {
    {
      const std::lock_guard lock(mutex_);
      stop_ = true;
    }
    wake_.notify_all();
    for (std::thread& helper : helpers_) helper.join();
  }

  void run(Call& call) {
    {
      const std::lock_guard lock(mutex_);
      hire(static_cast<std::size_t>(call.open_seats));
      calls_.push_back(&call);
    }
    wake_.notify_all();
    call.run(0);
    std::unique_lock lock(mutex_);
    calls_.erase(std::find(calls_.begin(), calls_.end(), &call));
    left_.wait(lock, [&] { return call.helping == 0; });
  }

 private:
  void hire(std::size_t wanted) {
    try {
      while (helpers_.size() < wanted) helpers_.emplace_back([this] { help(); });
    } catch (const std::system_error&) {
      // Fewer helpers: no result depends on that.
    }
  }

  Call* call_with_a_seat() {
    const auto found =
        std::find_if(calls_.begin(), calls_.end(), [](const Call* call) { return call->open_seats > 0; });
    return found == calls_.end() ? nullptr : *found;
  }

  void help() {
    std::unique_lock lock(mutex_);
    for (;;) {
      Call* call = nullptr;
      wake_.wait(lock, [&] { return stop_ || (call = call_with_a_seat()) != nullptr; });
      if (stop_) return;
      --call->open_seats;
      ++call->helping;
      const int worker = call->next_seat++;
      lock.unlock();
      call->run(worker);
      lock.lock();
      if (--call->helping == 0) left_.notify_all();
    }
  }

  std::mutex mutex_;
  std::condition_variable wake_, left_;
  std::vector<std::thread> helpers_;
  std::vector<Call*> calls_;  ///< under way, the oldest first
  bool stop_ = false;
};

/// The process's pool, made by the first call that needs one. A child of fork() has none of its parent's helpers, and
/// the parent's pool may be locked for good. The child therefore leaves that pool untouched and makes another.
class ProcessPool {
 public:
  ProcessPool() noexcept {
    pthread_atfork(nullptr, nullptr, [] { abandoned_ = current_.exchange(nullptr); });
  }
  ~ProcessPool() { delete current_.exchange(nullptr); }
  ProcessPool(const ProcessPool&) = delete;
  ProcessPool& operator=(const ProcessPool&) = delete;

  static Pool& get() {
    if (Pool* pool = current_.load()) return *pool;
    auto made = std::make_unique<Pool>();
    Pool* expected = nullptr;
    if (current_.compare_exchange_strong(expected, made.get())) return *made.release();
    return *expected;
  }

 private:
  static inline std::atomic<Pool*> current_{nullptr};
  static inline Pool* abandoned_ = nullptr;  ///< kept in sight of leak checkers
};

const ProcessPool process_pool;

}  // namespace

void own_parallel_for(int threads, int items, const ItemWork& work) {
  Call call(threads, items, work);
  ProcessPool::get().run(call);
  call.rethrow();
}

}  // namespace stiction::cpu
