#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <stdexcept>
#include <string>
#include <thread>

#include "distributed/transport/thread_transport.hpp"

namespace stiction::distributed {
namespace {

using ::testing::HasSubstr;

template <class F>
std::string message_of(F&& f) {
  try {
    f();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "nothing was thrown";
}

std::span<const std::byte> bytes_of(const int& value) {
  return std::as_bytes(std::span(&value, 1));
}
std::span<std::byte> room_of(int& value) {
  return std::as_writable_bytes(std::span(&value, 1));
}

TEST(Transport, GathersInTheOrderOfRanks) {
  std::array<std::array<int, 4>, 4> seen{};
  run_thread_ranks(4, 60, [&](Transport& transport) {
    const int mine = 10 * transport.rank();
    auto& all = seen[static_cast<std::size_t>(transport.rank())];
    transport.all_gather(bytes_of(mine), std::as_writable_bytes(std::span(all)));
  });
  for (const auto& all : seen) EXPECT_THAT(all, ::testing::ElementsAre(0, 10, 20, 30));
}

TEST(Transport, MessagesOfAPairKeepTheirOrder) {
  run_thread_ranks(2, 60, [&](Transport& transport) {
    const int other = 1 - transport.rank();
    for (int i = 0; i < 100; ++i) {
      const int sent = 1000 * transport.rank() + i;
      int received = -1;
      const Outgoing out{other, bytes_of(sent)};
      const Incoming in{other, room_of(received)};
      transport.exchange({&out, 1}, {&in, 1});
      EXPECT_EQ(received, 1000 * other + i);
    }
    EXPECT_EQ(transport.traffic().exchanges, 100);
    EXPECT_EQ(transport.traffic().messages, 100);
    EXPECT_EQ(transport.traffic().bytes, 400);
  });
}

TEST(Transport, ARankAloneTalksToItself) {
  const auto transport = self_transport();
  EXPECT_EQ(transport->rank(), 0);
  EXPECT_EQ(transport->size(), 1);
  int all = 0;
  transport->all_gather(bytes_of(7), room_of(all));
  EXPECT_EQ(all, 7);
}

TEST(Transport, ARankThatIsSilentIsNamed) {
  const std::string message = message_of([] {
    run_thread_ranks(3, 0.2, [](Transport& transport) {
      if (transport.rank() == 2) return;  // leaves without a word
      int all[3] = {};
      transport.all_gather(bytes_of(1), std::as_writable_bytes(std::span(all)));
    });
  });
  EXPECT_THAT(message, HasSubstr("rank 2 has not answered within the deadline"));
}

TEST(Transport, TheFirstFailureIsThrownAndNobodyWaitsForTheDeadline) {
  std::atomic<int> ended{0};
  const std::string message = message_of([&] {
    run_thread_ranks(3, 3600, [&](Transport& transport) {
      if (transport.rank() == 1) throw std::runtime_error("rank 1 has no more paper");
      int all[3] = {};
      try {
        transport.all_gather(bytes_of(1), std::as_writable_bytes(std::span(all)));
      } catch (const RankLost&) {
        ++ended;
        throw;
      }
    });
  });
  EXPECT_EQ(message, "rank 1 has no more paper");
  EXPECT_EQ(ended, 2);
}

TEST(Transport, AMessageOfAnotherSizeIsRefused) {
  const std::string message = message_of([] {
    run_thread_ranks(2, 60, [](Transport& transport) {
      if (transport.rank() == 0) {
        const int sent = 1;
        const Outgoing out{1, bytes_of(sent)};
        transport.exchange({&out, 1}, {});
      } else {
        std::array<int, 2> room{};
        const Incoming in{0, std::as_writable_bytes(std::span(room))};
        transport.exchange({}, {&in, 1});
      }
    });
  });
  EXPECT_THAT(message, HasSubstr("rank 0 sent 4 bytes, expected 8"));
}

/// Letters are taken one by one in their order, and no exchange sees them.
TEST(Transport, LettersWaitUntilTheyAreTaken) {
  run_thread_ranks(2, 60, [&](Transport& transport) {
    const int other = 1 - transport.rank();
    for (int i = 0; i < 3; ++i) {
      const int sent = 10 * transport.rank() + i;
      const Outgoing letter{other, bytes_of(sent)};
      transport.post({&letter, 1});
    }
    const int sent = 77;
    int received = 0;
    const Outgoing out{other, bytes_of(sent)};
    const Incoming in{other, room_of(received)};
    transport.exchange({&out, 1}, {&in, 1});
    EXPECT_EQ(received, 77);
    for (int i = 0; i < 2; ++i) {
      EXPECT_TRUE(transport.take(in));  // sent before the message that has come
      EXPECT_EQ(received, 10 * other + i);
    }
    transport.await(in);
    EXPECT_EQ(received, 10 * other + 2);
    EXPECT_FALSE(transport.take(in));
    transport.settle();
    EXPECT_EQ(transport.traffic().messages, 4);
    EXPECT_EQ(transport.traffic().bytes, 16);
    EXPECT_EQ(transport.traffic().exchanges, 1);
  });
}

TEST(Transport, ALetterThatDoesNotComeIsWaitedForUntilTheDeadline) {
  EXPECT_THAT(message_of([] {
                run_thread_ranks(2, 0.2, [](Transport& transport) {
                  int received = 0;
                  if (transport.rank() == 0) transport.await({1, room_of(received)});
                });
              }),
              HasSubstr("rank 0: rank 1 has not answered within the deadline"));
}

/// Times worked out by hand: rank 0 posts at 1, 2, 3; letters take 0.5; rank 1 looks at 1.2, 2.4 and 3.6.
TEST(Transport, ClocksSayWhatHasArrived) {
  for (int repetition = 0; repetition < 50; ++repetition)
    run_clocked_ranks(2, 60, 0.5, [&](ClockedTransport& transport) {
      if (transport.rank() == 0) {
        for (int i = 1; i <= 3; ++i) {
          transport.advance(1);
          const Outgoing letter{1, bytes_of(i)};
          transport.post({&letter, 1});
        }
        return;
      }
      int received = 0;
      const Incoming in{0, room_of(received)};
      transport.advance(1.2);
      EXPECT_FALSE(transport.take(in));  // the first arrives at 1.5
      transport.advance(1.2);
      EXPECT_TRUE(transport.take(in));
      EXPECT_EQ(received, 1);
      EXPECT_FALSE(transport.take(in));  // the second arrives at 2.5
      transport.advance(1.2);
      EXPECT_TRUE(transport.take(in));
      EXPECT_TRUE(transport.take(in));
      EXPECT_EQ(received, 3);
      EXPECT_DOUBLE_EQ(transport.seconds(), 3.6);
    });
}

/// A rank that waits goes on when the message arrives, which is no sooner than by its sender's clock.
TEST(Transport, ClocksGoOnWhileTheirRanksWait) {
  run_clocked_ranks(3, 60, 0.25, [&](ClockedTransport& transport) {
    transport.advance(transport.rank() == 1 ? 5 : 1);
    int all[3] = {};
    transport.all_gather(bytes_of(1), std::as_writable_bytes(std::span(all)));
    EXPECT_DOUBLE_EQ(transport.seconds(), transport.rank() == 1 ? 5 : 5.25);
  });
  EXPECT_THAT(message_of([] { run_clocked_ranks(1, 1, -1, [](ClockedTransport&) {}); }), HasSubstr("latency = -1"));
}

TEST(Transport, RefusesNumbersThatAreNone) {
  EXPECT_THAT(message_of([] { run_thread_ranks(0, 1, [](Transport&) {}); }), HasSubstr("ranks = 0"));
  for (const double seconds : {0.0, -1.0, 1e9})
    EXPECT_THAT(message_of([&] { run_thread_ranks(1, seconds, [](Transport&) {}); }), HasSubstr("deadline"));
}

}  // namespace
}  // namespace stiction::distributed
