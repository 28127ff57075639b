#include <unistd.h>

#include <cstdlib>
#include <stdexcept>

#include "tools/gpu_first/check.hpp"

/// Checks that go wrong, each in its way, to try the program itself. They run where --only names them.
namespace stiction::gpu_first {

namespace {

void hang(Report& report) {
  report.judge("before", "");
  Report::say("self", "before it hangs");
  for (;;) pause();
}

void die(Report& report) {
  report.judge("before", "");
  std::abort();
}

void throw_something(Report&) {
  throw std::runtime_error("a check that throws");
}

void judge_wrong(Report& report) {
  report.judge("", "a check that is wrong");
}

void talk(Report&) {
  constexpr int kSubjects = 60;
  for (int k = 0; k < 2 * kSubjects; ++k) Report::say("subject " + std::to_string(k % kSubjects), std::to_string(k));
}

void compare_unequal(Report& report) {
  report.compare("", [] { return Hashes{1, 2, 3, 4}; }, [] { return Hashes{1, 2, 9, 8}; });
}

}  // namespace

void add_self(Checks& checks) {
  checks.push_back({"self/hangs", 0.5, hang});
  checks.push_back({"self/dies", 5, die});
  checks.push_back({"self/throws", 5, throw_something});
  checks.push_back({"self/wrong", 5, judge_wrong});
  checks.push_back({"self/talks", 5, talk});
  checks.push_back({"self/unequal", 5, compare_unequal});
}

}  // namespace stiction::gpu_first
