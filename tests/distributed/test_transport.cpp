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

TEST(Transport, RefusesNumbersThatAreNone) {
  EXPECT_THAT(message_of([] { run_thread_ranks(0, 1, [](Transport&) {}); }), HasSubstr("ranks = 0"));
  for (const double seconds : {0.0, -1.0, 1e9})
    EXPECT_THAT(message_of([&] { run_thread_ranks(1, seconds, [](Transport&) {}); }), HasSubstr("deadline"));
}

}  // namespace
}  // namespace stiction::distributed
