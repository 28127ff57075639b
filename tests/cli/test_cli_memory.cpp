// Arrays beyond memory are refused before anything is allocated, in one sentence. An unforeseen lack ends so, too.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <filesystem>
#include <string>
#include <vector>

#include "cli/memory.hpp"
#include "stiction/error.hpp"
#include "tests/cli/process.hpp"
#include "tests/cli/refusal.hpp"

namespace stiction::test {
namespace {

/// A limit of this process's addresses and its children's, as `ulimit -v` sets it, for as long as the object lives.
class AddressLimit {
 public:
  explicit AddressLimit(double bytes) {
    getrlimit(RLIMIT_AS, &before_);
    rlimit limit = before_;
    limit.rlim_cur = static_cast<rlim_t>(bytes);
    setrlimit(RLIMIT_AS, &limit);
  }
  ~AddressLimit() { setrlimit(RLIMIT_AS, &before_); }
  AddressLimit(const AddressLimit&) = delete;
  AddressLimit& operator=(const AddressLimit&) = delete;

 private:
  rlimit before_{};
};

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kIsSanitized = true;  // a sanitizer takes terabytes of addresses for itself
#else
constexpr bool kIsSanitized = false;
#endif

}  // namespace

TEST(Memory, BytesAreWrittenAsPeopleReadThem) {
  EXPECT_EQ(cli::bytes_text(0), "0 B");
  EXPECT_EQ(cli::bytes_text(999), "999 B");
  EXPECT_EQ(cli::bytes_text(1000), "1 kB");
  EXPECT_EQ(cli::bytes_text(3.072e12), "3.07 TB");
  EXPECT_EQ(cli::bytes_text(5e21), "5e+03 EB");
}

TEST(Memory, ALimitOfAddressesIsSeen) {
  if (kIsSanitized) GTEST_SKIP() << "addresses cannot be limited under a sanitizer";
  if (!cli::free_memory()) GTEST_SKIP() << "this system does not say how much memory is free";
  const AddressLimit limit(2e9);
  EXPECT_LT(cli::free_memory().value_or(2e9), 2e9);
  EXPECT_NO_THROW(cli::require_memory(1e6, "little"));
  EXPECT_THROW(cli::require_memory(2e9, "much"), Error);
}

TEST(Memory, ScenesThatNoMachineHoldsAreRefused) {
  const std::vector<std::string> free{"of memory, and ", " are free: choose less"};
  const auto says = [&](std::vector<std::string> more) {
    more.insert(more.end(), free.begin(), free.end());
    return more;
  };
  // 12 bodies have 12 * 32 numbers of 8 bytes, and an environment a status of 32 bytes: 3104 bytes.
  EXPECT_TRUE(is_refused(run_stiction({"step", "pile", "--envs", "1000000000000"}),
                         says({"pile with 1000000000000 environments of 12 bodies", "at least 3.1 PB"})));
  EXPECT_TRUE(is_refused(run_stiction({"step", "pile", "--envs", "1000000000000", "--precision", "f32"}),
                         says({"at least 1.57 PB"})));
  EXPECT_TRUE(
      is_refused(run_stiction({"step", "pile", "--envs", "9000000000000000000"}), says({"at least 2.79e+04 EB"})));
  EXPECT_TRUE(is_refused(run_stiction({"step", "stack", "--size", "2000000000"}),
                         says({"stack with 4096 environments of 2000000000 bodies", "at least 2.1 PB"})));
  EXPECT_TRUE(is_refused(run_stiction({"scaling", "pile", "--envs", "1000000000000"}), says({"at least 3.1 PB"})));
  const Folder folder;
  EXPECT_TRUE(is_refused(run_stiction({"generate", "pile", "--envs", "1000000000000", "-o", folder / "pile.h5"}),
                         says({"pile with 1000000000000 environments (--envs)"})));
  EXPECT_FALSE(std::filesystem::exists(folder / "pile.h5"));
}

TEST(Memory, WhatIsWrongWithASceneIsSaidBeforeItsMemory) {
  EXPECT_TRUE(is_refused(run_stiction({"step", "pyre", "--size", "2000000000"}), {"scene 'pyre' cannot be stepped"}));
  EXPECT_TRUE(is_refused(run_stiction({"step", "walker", "--size", "2000000000"}), {"scene 'walker' has no size"}));
}

TEST(Memory, UnderALimitTheLimitCounts) {
  if (kIsSanitized) GTEST_SKIP() << "addresses cannot be limited under a sanitizer";
  if (!cli::free_memory()) GTEST_SKIP() << "this system does not say how much memory is free";
  const std::vector<std::string> step{"step", "pile", "--threads", "1", "--steps", "1", "--envs"};
  const auto with = [&](const char* environments) {
    std::vector<std::string> words = step;
    words.emplace_back(environments);
    return run_stiction(words);
  };
  const AddressLimit limit(5e8);
  EXPECT_EQ(with("3").status, 0);
  EXPECT_TRUE(is_refused(with("1000000"), {"at least 3.1 GB", "MB are free"}));
  // 0.25 GB of state fit, and a world's other arrays do not.
  EXPECT_TRUE(is_refused(with("76000"), {"out of memory; use a smaller batch"}));
}

}  // namespace stiction::test
