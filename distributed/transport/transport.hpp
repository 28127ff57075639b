#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "stiction/error.hpp"

/// Messages of ranks, and how long they wait for them (docs/howto/ranks.md).
namespace stiction::distributed {

/// Bytes to a rank.
struct Outgoing {
  int to = 0;
  std::span<const std::byte> bytes;
};

/// Destination of a rank's bytes: as many as it sends.
struct Incoming {
  int from = 0;
  std::span<std::byte> bytes;
};

/// A rank did not answer in time, has ended, or sent something else than was expected.
class RankLost : public Error {
 public:
  explicit RankLost(const std::string& message) : Error(ErrorCode::device_failure, message) {}
};

/// Counts of one rank's messages and waits so far.
struct Traffic {
  std::int64_t exchanges = 0;  ///< with neighbours
  std::int64_t gathers = 0;    ///< with all ranks
  std::int64_t messages = 0;   ///< sent to neighbours, and letters
  std::int64_t bytes = 0;      ///< of those messages
  double waited = 0;           ///< in both, and for letters, until the last byte was there [s]
};

/// The ranks of a job, seen by one of them. Messages between two ranks arrive in the order they were sent, and so do
/// letters. Nothing waits longer than the transport's deadline: then RankLost is thrown, and the job is over.
class Transport {
 public:
  virtual ~Transport() = default;
  [[nodiscard]] virtual int rank() const = 0;
  [[nodiscard]] virtual int size() const = 0;

  /// Sends, and receives the letters it waits for. No rank sends to itself. \throws RankLost
  void exchange(std::span<const Outgoing> out, std::span<const Incoming> in);
  /// The bytes of every rank, one after the other; all ranks give as many. \throws RankLost
  void all_gather(std::span<const std::byte> mine, std::span<std::byte> all);

  /// Sends letters, which a rank takes when it looks for them, and does not wait. The bytes may change at once.
  /// Exchanges do not see letters. \throws RankLost
  void post(std::span<const Outgoing> out);
  /// Takes the oldest letter of a rank that is here and was not taken. Returns true if there was one. \throws RankLost
  bool take(const Incoming& in);
  /// Waits for a letter of a rank, and takes it. \throws RankLost
  void await(const Incoming& in);
  /// Waits until the letters of this rank are gone: once all were taken, nothing is left of them. \throws RankLost
  void settle();
  [[nodiscard]] const Traffic& traffic() const { return traffic_; }

 private:
  virtual void do_exchange(std::span<const Outgoing> out, std::span<const Incoming> in) = 0;
  virtual void do_all_gather(std::span<const std::byte> mine, std::span<std::byte> all) = 0;
  virtual void do_post(const Outgoing& letter) = 0;
  virtual bool do_take(const Incoming& in) = 0;
  virtual void do_await(const Incoming& in) = 0;
  virtual void do_settle() = 0;
  void count(std::span<const Outgoing> out);
  Traffic traffic_;
};

/// The only rank of a job of one.
std::unique_ptr<Transport> self_transport();

}  // namespace stiction::distributed
