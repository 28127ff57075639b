#include "distributed/transport/mpi_transport.hpp"

#include <mpi.h>
#include <sched.h>

#include <chrono>
#include <cstdlib>
#include <deque>
#include <limits>
#include <string>
#include <vector>

#include "distributed/transport/late.hpp"

namespace stiction::distributed {

namespace {

constexpr int kTag = 1;
constexpr int kLetterTag = 2;
constexpr int kRefusedTag = 3;

int count_of(std::size_t bytes) {
  if (bytes > static_cast<std::size_t>(std::numeric_limits<int>::max()))
    throw Error(ErrorCode::unsupported,
                "a message of " + std::to_string(bytes) + " bytes is more than MPI's counts hold: use more ranks");
  return static_cast<int>(bytes);
}

void check(int rank, int result, const char* what) {
  if (result == MPI_SUCCESS) return;
  char text[MPI_MAX_ERROR_STRING] = {};
  int length = 0;
  MPI_Error_string(result, text, &length);
  throw RankLost(
      text_of_loss(rank, std::string(what) + " failed: " + std::string(text, static_cast<std::size_t>(length))));
}

class MpiTransport final : public Transport {
 public:
  explicit MpiTransport(double deadline_seconds) : deadline_(deadline_of(deadline_seconds)) {
    // Not a copy of it: to make one, all ranks wait for each other, and for as long as it takes.
    MPI_Comm_set_errhandler(MPI_COMM_WORLD, MPI_ERRORS_RETURN);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
    MPI_Comm_size(MPI_COMM_WORLD, &size_);
  }
  [[nodiscard]] int rank() const override { return rank_; }
  [[nodiscard]] int size() const override { return size_; }

 private:
  void do_exchange(std::span<const Outgoing> out, std::span<const Incoming> in) override {
    requests_.assign(in.size() + out.size(), MPI_REQUEST_NULL);
    peers_.clear();
    for (const Incoming& message : in) {
      check(rank_,
            MPI_Irecv(message.bytes.data(), count_of(message.bytes.size()), MPI_BYTE, message.from, kTag,
                      MPI_COMM_WORLD, &requests_[peers_.size()]),
            "MPI_Irecv");
      peers_.push_back(message.from);
    }
    for (const Outgoing& message : out) {
      check(rank_,
            MPI_Isend(message.bytes.data(), count_of(message.bytes.size()), MPI_BYTE, message.to, kTag, MPI_COMM_WORLD,
                      &requests_[peers_.size()]),
            "MPI_Isend");
      peers_.push_back(message.to);
    }
    wait(requests_, peers_);
  }

  void do_all_gather(std::span<const std::byte> mine, std::span<std::byte> all) override {
    requests_.assign(1, MPI_REQUEST_NULL);
    peers_.clear();
    const int count = count_of(mine.size());
    check(rank_,
          MPI_Iallgather(mine.data(), count, MPI_BYTE, all.data(), count, MPI_BYTE, MPI_COMM_WORLD, requests_.data()),
          "MPI_Iallgather");
    wait(requests_, peers_);
  }

  void do_post(const Outgoing& letter) override {
    drop_sent();
    sent_.push_back({{letter.bytes.begin(), letter.bytes.end()}, MPI_REQUEST_NULL, letter.to});
    Sent& sent = sent_.back();
    check(rank_,
          MPI_Isend(sent.bytes.data(), count_of(sent.bytes.size()), MPI_BYTE, letter.to, kLetterTag, MPI_COMM_WORLD,
                    &sent.request),
          "MPI_Isend");
  }

  bool do_take(const Incoming& in) override {
    int is_here = 0;
    MPI_Status status;
    check(rank_, MPI_Iprobe(in.from, kLetterTag, MPI_COMM_WORLD, &is_here, &status), "MPI_Iprobe");
    if (is_here == 0) return false;
    int bytes = 0;
    MPI_Get_count(&status, MPI_BYTE, &bytes);
    const auto size = static_cast<std::size_t>(bytes);
    if (size != in.bytes.size()) throw RankLost(text_of_size(rank_, in.from, size, in.bytes.size()));
    requests_.assign(1, MPI_REQUEST_NULL);
    peers_.assign(1, in.from);
    check(rank_, MPI_Irecv(in.bytes.data(), bytes, MPI_BYTE, in.from, kLetterTag, MPI_COMM_WORLD, requests_.data()),
          "MPI_Irecv");
    wait(requests_, peers_);
    return true;
  }

  void do_await(const Incoming& in) override {
    until_deadline([&] { return do_take(in); }, [&] { return text_of_late(rank_, {in.from}); });
  }

  void do_settle() override {
    std::vector<MPI_Request> requests;
    std::vector<int> peers;
    for (const Sent& sent : sent_) {
      requests.push_back(sent.request);
      peers.push_back(sent.to);
    }
    wait(requests, peers);
    sent_.clear();
  }

  /// Letters that are on their way need their bytes no more.
  void drop_sent() {
    while (!sent_.empty()) {
      int done = 0;
      check(rank_, MPI_Test(&sent_.front().request, &done, MPI_STATUS_IGNORE), "a letter");
      if (done == 0) return;
      sent_.pop_front();
    }
  }

  void wait(std::vector<MPI_Request>& requests, const std::vector<int>& peers) {
    const auto are_done = [&] {
      int done = 0;
      check(rank_, MPI_Testall(static_cast<int>(requests.size()), requests.data(), &done, MPI_STATUSES_IGNORE),
            "a message");
      return done != 0;
    };
    until_deadline(are_done, [&] { return silent(requests, peers); });
  }

  /// MPI's own waits know no deadline. After some tries the core is given away: there may be more ranks than cores.
  template <class IsDone, class Text>
  void until_deadline(IsDone&& is_done, Text&& text) {
    constexpr int kTries = 200;
    const auto until = std::chrono::steady_clock::now() + deadline_;
    for (int tries = 0; !is_done(); ++tries) {
      if (tries < kTries) continue;
      if (std::chrono::steady_clock::now() > until) throw RankLost(text());
      sched_yield();
    }
  }

  /// The other ends of the messages that are still missing.
  [[nodiscard]] std::string silent(std::vector<MPI_Request>& requests, const std::vector<int>& peers) {
    int done = 0;
    std::vector<int> which(requests.size());
    MPI_Testsome(static_cast<int>(requests.size()), requests.data(), &done, which.data(), MPI_STATUSES_IGNORE);
    std::vector<int> ranks;
    for (std::size_t i = 0; i < peers.size(); ++i)
      if (requests[i] != MPI_REQUEST_NULL && (ranks.empty() || ranks.back() != peers[i])) ranks.push_back(peers[i]);
    return ranks.empty() ? text_of_loss(rank_, "some rank has not answered within the deadline")
                         : text_of_late(rank_, ranks);
  }

  std::chrono::steady_clock::duration deadline_;
  int rank_ = 0, size_ = 1;
  std::vector<MPI_Request> requests_;
  std::vector<int> peers_;  ///< of the requests, in their order; empty of a collective

  struct Sent {
    std::vector<std::byte> bytes;
    MPI_Request request;
    int to;
  };
  std::deque<Sent> sent_;  ///< letters, whose requests know where they are
};

}  // namespace

MpiSession::MpiSession(int* argc, char*** argv) {
  MPI_Init(argc, argv);
}
MpiSession::~MpiSession() {
  MPI_Finalize();
}

int mpi_rank() {
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  return rank;
}

std::unique_ptr<Transport> mpi_transport(double deadline_seconds) {
  return std::make_unique<MpiTransport>(deadline_seconds);
}

void mpi_say_refused() {
  int size = 0;
  MPI_Comm_size(MPI_COMM_WORLD, &size);
  const int rank = mpi_rank();
  std::vector<MPI_Request> requests(static_cast<std::size_t>(size - rank - 1), MPI_REQUEST_NULL);
  for (int other = rank + 1; other < size; ++other)
    MPI_Isend(nullptr, 0, MPI_BYTE, other, kRefusedTag, MPI_COMM_WORLD,
              &requests[static_cast<std::size_t>(other - rank - 1)]);
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(1);
  int done = 0;
  while (done == 0 && std::chrono::steady_clock::now() < end)
    MPI_Testall(static_cast<int>(requests.size()), requests.data(), &done, MPI_STATUSES_IGNORE);
}

bool mpi_is_refused() {
  int there = 0;
  MPI_Iprobe(MPI_ANY_SOURCE, kRefusedTag, MPI_COMM_WORLD, &there, MPI_STATUS_IGNORE);
  return there != 0;
}

void mpi_abort(int status) {
  MPI_Abort(MPI_COMM_WORLD, status);
  std::_Exit(status);
}

}  // namespace stiction::distributed
