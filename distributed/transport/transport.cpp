#include "distributed/transport/transport.hpp"

#include <algorithm>
#include <chrono>

namespace stiction::distributed {

namespace {

/// Adds the time until it goes to a sum.
class Waiting {
 public:
  explicit Waiting(double& sum) : sum_(sum) {}
  ~Waiting() { sum_ += std::chrono::duration<double>(Clock::now() - start_).count(); }
  Waiting(const Waiting&) = delete;
  Waiting& operator=(const Waiting&) = delete;

 private:
  using Clock = std::chrono::steady_clock;
  double& sum_;
  Clock::time_point start_ = Clock::now();
};

class SelfTransport final : public Transport {
 public:
  [[nodiscard]] int rank() const override { return 0; }
  [[nodiscard]] int size() const override { return 1; }

 private:
  void do_exchange(std::span<const Outgoing>, std::span<const Incoming>) override {}
  void do_all_gather(std::span<const std::byte> mine, std::span<std::byte> all) override {
    std::copy(mine.begin(), mine.end(), all.begin());
  }
  void do_post(const Outgoing&) override {}
  bool do_take(const Incoming&) override { return false; }
  void do_await(const Incoming&) override {}
  void do_settle() override {}
};

}  // namespace

void Transport::exchange(std::span<const Outgoing> out, std::span<const Incoming> in) {
  ++traffic_.exchanges;
  count(out);
  const Waiting waiting(traffic_.waited);
  do_exchange(out, in);
}

void Transport::all_gather(std::span<const std::byte> mine, std::span<std::byte> all) {
  ++traffic_.gathers;
  const Waiting waiting(traffic_.waited);
  do_all_gather(mine, all);
}

void Transport::post(std::span<const Outgoing> out) {
  count(out);
  for (const Outgoing& letter : out) do_post(letter);
}

bool Transport::take(const Incoming& in) {
  return do_take(in);
}

void Transport::await(const Incoming& in) {
  const Waiting waiting(traffic_.waited);
  do_await(in);
}

void Transport::settle() {
  const Waiting waiting(traffic_.waited);
  do_settle();
}

void Transport::count(std::span<const Outgoing> out) {
  traffic_.messages += static_cast<std::int64_t>(out.size());
  for (const Outgoing& message : out) traffic_.bytes += static_cast<std::int64_t>(message.bytes.size());
}

std::unique_ptr<Transport> self_transport() {
  return std::make_unique<SelfTransport>();
}

}  // namespace stiction::distributed
