#include "distributed/transport/thread_transport.hpp"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <exception>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "distributed/transport/late.hpp"

namespace stiction::distributed {

namespace {

using Deadline = std::chrono::steady_clock::time_point;

std::size_t at(int rank) {
  return static_cast<std::size_t>(rank);
}

enum class Kind : std::uint8_t { message, letter };

struct Sent {
  double arrives = 0;  ///< by the receiver's clock [s]
  std::vector<std::byte> bytes;
};
using Box = std::deque<Sent>;

/// Messages on their way, the ranks' clocks, and a flag for a rank that has failed.
class Post {
 public:
  /// Without a latency all sent letters are there, and clocks do not matter.
  Post(int ranks, std::optional<double> latency)
      : latency_(latency), boxes_(2 * at(ranks) * at(ranks)), ranks_(at(ranks)) {}
  [[nodiscard]] int ranks() const { return static_cast<int>(ranks_.size()); }

  void send(Kind kind, int from, int to, std::span<const std::byte> bytes) {
    const std::lock_guard lock(mutex_);
    box(kind, from, to).push_back({ranks_[at(from)].clock + latency_.value_or(0), {bytes.begin(), bytes.end()}});
    changed_.notify_all();
  }

  void receive(Kind kind, int to, const Incoming& in, Deadline until) {
    std::unique_lock lock(mutex_);
    Box& sent = box(kind, in.from, to);
    Rank& own = ranks_[at(to)];
    own.waits_for = &sent;
    changed_.notify_all();
    const bool came = changed_.wait_until(lock, until, [&] { return !sent.empty() || failed_; });
    own.waits_for = nullptr;
    if (sent.empty()) throw RankLost(came ? failure(to) : text_of_late(to, {in.from}));
    own.clock = std::max(own.clock, sent.front().arrives);
    changed_.notify_all();
    open_first(sent, to, in);
  }

  /// The first letter, if it is there by the taker's clock.
  bool take(int to, const Incoming& in, Deadline until) {
    std::unique_lock lock(mutex_);
    Box& sent = box(Kind::letter, in.from, to);
    if (latency_ && !changed_.wait_until(lock, until, [&] { return failed_ || is_known(to); }))
      throw RankLost(text_of_loss(to, "the clock of another rank has stopped"));
    if (failed_) throw RankLost(failure(to));
    if (sent.empty() || !is_before(sent.front().arrives, in.from, to)) return false;
    open_first(sent, to, in);
    return true;
  }

  void advance(int rank, double seconds) {
    const std::lock_guard lock(mutex_);
    ranks_[at(rank)].clock += seconds;
    changed_.notify_all();
  }
  [[nodiscard]] double clock(int rank) {
    const std::lock_guard lock(mutex_);
    return ranks_[at(rank)].clock;
  }
  void end(int rank) {
    const std::lock_guard lock(mutex_);
    ranks_[at(rank)].has_ended = true;
    changed_.notify_all();
  }

  void fail(std::exception_ptr why) {
    const std::lock_guard lock(mutex_);
    if (!failed_) why_ = std::move(why);
    failed_ = true;
    changed_.notify_all();
  }
  [[nodiscard]] std::exception_ptr why() const { return why_; }

 private:
  struct Rank {
    double clock = 0;  ///< [s]
    const Box* waits_for = nullptr;
    bool has_ended = false;
  };

  static std::string failure(int rank) { return text_of_loss(rank, "another rank has failed"); }

  static void open_first(Box& sent, int to, const Incoming& in) {
    const std::vector<std::byte> bytes = std::move(sent.front().bytes);
    sent.pop_front();
    if (bytes.size() != in.bytes.size()) throw RankLost(text_of_size(to, in.from, bytes.size(), in.bytes.size()));
    if (!bytes.empty()) std::memcpy(in.bytes.data(), bytes.data(), bytes.size());
  }

  /// Returns true if a rank's message of that time of arrival comes before another rank's now. At equal times, the
  /// lower rank is first: so one of two ranks always goes on.
  [[nodiscard]] bool is_before(double arrives, int from, int to) const {
    const double now = ranks_[at(to)].clock;
    return !latency_ || arrives < now || (arrives == now && from < to);
  }

  /// True if all that may arrive at a rank by its clock has been sent: every other rank's next letter comes later.
  [[nodiscard]] bool is_known(int to) const {
    for (int other = 0; other < ranks(); ++other) {
      const Rank& rank = ranks_[at(other)];
      // A rank that waits for an unsent letter goes on after its sender, a rank of this loop or the one that asks.
      if (other == to || rank.has_ended || (rank.waits_for != nullptr && rank.waits_for->empty())) continue;
      const double goes_on =
          rank.waits_for == nullptr ? rank.clock : std::max(rank.clock, rank.waits_for->front().arrives);
      if (is_before(goes_on + *latency_, other, to)) return false;
    }
    return true;
  }

  Box& box(Kind kind, int from, int to) {
    return boxes_[(at(from) * ranks_.size() + at(to)) * 2 + (kind == Kind::letter ? 1 : 0)];
  }

  std::optional<double> latency_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Box> boxes_;
  std::vector<Rank> ranks_;
  bool failed_ = false;
  std::exception_ptr why_;
};

class ThreadTransport final : public ClockedTransport {
 public:
  ThreadTransport(Post& post, int rank, std::chrono::steady_clock::duration deadline)
      : post_(post), rank_(rank), deadline_(deadline) {}
  [[nodiscard]] int rank() const override { return rank_; }
  [[nodiscard]] int size() const override { return post_.ranks(); }
  void advance(double seconds) override { post_.advance(rank_, seconds); }
  [[nodiscard]] double seconds() const override { return post_.clock(rank_); }

 private:
  void do_exchange(std::span<const Outgoing> out, std::span<const Incoming> in) override {
    for (const Outgoing& message : out) post_.send(Kind::message, rank_, message.to, message.bytes);
    const Deadline until = deadline();
    for (const Incoming& message : in) post_.receive(Kind::message, rank_, message, until);
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
  void do_post(const Outgoing& letter) override { post_.send(Kind::letter, rank_, letter.to, letter.bytes); }
  bool do_take(const Incoming& in) override { return post_.take(rank_, in, deadline()); }
  void do_await(const Incoming& in) override { post_.receive(Kind::letter, rank_, in, deadline()); }
  void do_settle() override {}

  [[nodiscard]] Deadline deadline() const { return std::chrono::steady_clock::now() + deadline_; }

  Post& post_;
  int rank_;
  std::chrono::steady_clock::duration deadline_;
};

void run_ranks(int ranks, double deadline_seconds, std::optional<double> latency,
               const std::function<void(ClockedTransport&)>& work) {
  if (ranks < 1) throw Error(ErrorCode::invalid_argument, "ranks = " + std::to_string(ranks) + ": must be >= 1");
  const auto deadline = deadline_of(deadline_seconds);
  Post post(ranks, latency);
  const auto run = [&](int rank) {
    try {
      ThreadTransport transport(post, rank, deadline);
      work(transport);
    } catch (...) {
      post.fail(std::current_exception());
    }
    post.end(rank);
  };
  std::vector<std::jthread> threads;
  for (int rank = 1; rank < ranks; ++rank) threads.emplace_back(run, rank);
  run(0);
  threads.clear();  // waits for them
  if (post.why()) std::rethrow_exception(post.why());
}

}  // namespace

void run_thread_ranks(int ranks, double deadline_seconds, const std::function<void(Transport&)>& work) {
  run_ranks(ranks, deadline_seconds, std::nullopt, work);
}

void run_clocked_ranks(int ranks, double deadline_seconds, double latency,
                       const std::function<void(ClockedTransport&)>& work) {
  if (!(latency >= 0))
    throw Error(ErrorCode::invalid_argument, "latency = " + std::to_string(latency) + ": expected seconds, 0 or more");
  run_ranks(ranks, deadline_seconds, latency, work);
}

}  // namespace stiction::distributed
