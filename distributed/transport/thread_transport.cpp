#include "distributed/transport/thread_transport.hpp"

#include <chrono>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <exception>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "distributed/transport/late.hpp"

namespace stiction::distributed {

namespace {

/// Letters on their way, and whether a rank has failed.
class Post {
 public:
  explicit Post(int ranks) : ranks_(ranks), boxes_(static_cast<std::size_t>(ranks) * static_cast<std::size_t>(ranks)) {}
  [[nodiscard]] int ranks() const { return ranks_; }

  void send(int from, int to, std::span<const std::byte> bytes) {
    const std::lock_guard lock(mutex_);
    box(from, to).emplace_back(bytes.begin(), bytes.end());
    arrived_.notify_all();
  }

  void receive(int from, int to, std::span<std::byte> bytes, std::chrono::steady_clock::time_point until) {
    std::unique_lock lock(mutex_);
    auto& letters = box(from, to);
    const bool came = arrived_.wait_until(lock, until, [&] { return !letters.empty() || failed_; });
    if (letters.empty()) throw RankLost(came ? text_of_loss(to, "another rank has failed") : text_of_late(to, {from}));
    const std::vector<std::byte> letter = std::move(letters.front());
    letters.pop_front();
    if (letter.size() != bytes.size()) throw RankLost(text_of_size(to, from, letter.size(), bytes.size()));
    if (!bytes.empty()) std::memcpy(bytes.data(), letter.data(), bytes.size());
  }

  void fail(std::exception_ptr why) {
    const std::lock_guard lock(mutex_);
    if (!failed_) why_ = std::move(why);
    failed_ = true;
    arrived_.notify_all();
  }
  [[nodiscard]] std::exception_ptr why() const { return why_; }

 private:
  std::deque<std::vector<std::byte>>& box(int from, int to) {
    return boxes_[static_cast<std::size_t>(from) * static_cast<std::size_t>(ranks_) + static_cast<std::size_t>(to)];
  }
  int ranks_;
  std::mutex mutex_;
  std::condition_variable arrived_;
  std::vector<std::deque<std::vector<std::byte>>> boxes_;
  bool failed_ = false;
  std::exception_ptr why_;
};

class ThreadTransport final : public Transport {
 public:
  ThreadTransport(Post& post, int rank, std::chrono::steady_clock::duration deadline)
      : post_(post), rank_(rank), deadline_(deadline) {}
  [[nodiscard]] int rank() const override { return rank_; }
  [[nodiscard]] int size() const override { return post_.ranks(); }

 private:
  void do_exchange(std::span<const Outgoing> out, std::span<const Incoming> in) override {
    for (const Outgoing& message : out) post_.send(rank_, message.to, message.bytes);
    const auto until = std::chrono::steady_clock::now() + deadline_;
    for (const Incoming& message : in) post_.receive(message.from, rank_, message.bytes, until);
  }
  void do_all_gather(std::span<const std::byte> mine, std::span<std::byte> all) override {
    std::vector<Outgoing> out;
    std::vector<Incoming> in;
    for (int other = 0; other < size(); ++other) {
      const auto part = all.subspan(static_cast<std::size_t>(other) * mine.size(), mine.size());
      if (other == rank_) {
        std::copy(mine.begin(), mine.end(), part.begin());
      } else {
        out.push_back({other, mine});
        in.push_back({other, part});
      }
    }
    do_exchange(out, in);
  }

  Post& post_;
  int rank_;
  std::chrono::steady_clock::duration deadline_;
};

}  // namespace

void run_thread_ranks(int ranks, double deadline_seconds, const std::function<void(Transport&)>& work) {
  if (ranks < 1) throw Error(ErrorCode::invalid_argument, "ranks = " + std::to_string(ranks) + ": must be >= 1");
  const auto deadline = deadline_of(deadline_seconds);
  Post post(ranks);
  const auto run = [&](int rank) {
    try {
      ThreadTransport transport(post, rank, deadline);
      work(transport);
    } catch (...) {
      post.fail(std::current_exception());
    }
  };
  std::vector<std::jthread> threads;
  for (int rank = 1; rank < ranks; ++rank) threads.emplace_back(run, rank);
  run(0);
  threads.clear();  // waits for them
  if (post.why()) std::rethrow_exception(post.why());
}

}  // namespace stiction::distributed
