#pragma once

#include <signal.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <string>
#include <vector>

/// Shared by the programs around physics engines: problems in, answers and times out.
///
///     PROGRAM SOLVER ITERATIONS SECONDS IN OUT
///
/// IN is little-endian: int64 environments, then for each int64 rows and the fields of a BoxedLcp. OUT has for each
/// environment:
///
/// * int64 how (0: the engine calls it solved, 1: it does not, -1: out of time, -2: it crashed);
/// * double seconds of the solving call, double seconds of what the engine forms before and after;
/// * double reaction[rows] (NaN without an answer).
///
/// Both times are medians over calls that take SECONDS together, at least one and at most 1000. One more call goes
/// before them as a warm-up. Each environment is solved in a separate process, so that neither a crash nor the clock
/// costs the others.
namespace engines {

/// [s] for all calls of one environment, by the wall: a limit on processor time would make Linux count it in ticks of 4
/// ms.
constexpr unsigned kLimit = 5;

/// w = A x + b; row by row w = 0 between the bounds, w >= 0 at the lower and w <= 0 at the upper one. In a row with
/// findex >= 0 the bounds are -hi and hi times x[findex].
struct BoxedLcp {
  std::vector<double> A, b, lo, hi;  // A by rows  (rows * rows, rows, rows, rows)
  std::vector<std::int64_t> findex;  // (rows)
  int rows() const { return static_cast<int>(b.size()); }
};

/// Results of one call. Times in seconds.
struct Call {
  double solve = 0, form = 0;
  bool claimed = true;
  std::vector<double> reaction;
};

[[noreturn]] inline void fail(const char* what) {
  std::fprintf(stderr, "engine: %s\n", what);
  std::exit(2);
}

/// Parses an argument as a number.
template <class T>
T number(const std::string& text) {
  T value{};
  const char* const end = text.data() + text.size();
  const auto [stop, code] = std::from_chars(text.data(), end, value);
  if (code != std::errc{} || stop != end) fail("an argument is no number");
  return value;
}

/// The wall clock measures short intervals, since asking for the processor's costs as much as a small solve. For long
/// intervals it is the lesser of both, so that other programs' turns do not count.
class Stopwatch {
 public:
  [[nodiscard]] double seconds() const {
    const double wall = of(CLOCK_MONOTONIC) - wall_;
    return wall < 1e-4 ? wall : std::min(wall, of(CLOCK_PROCESS_CPUTIME_ID) - processor_);
  }

 private:
  static double of(clockid_t clock) {
    timespec time;
    clock_gettime(clock, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  }
  double processor_ = of(CLOCK_PROCESS_CPUTIME_ID);
  double wall_ = of(CLOCK_MONOTONIC);
};

template <class T>
std::vector<T> take(std::FILE* in, std::size_t count) {
  std::vector<T> data(count);
  if (std::fread(data.data(), sizeof(T), count, in) != count) fail("the input ends early");
  return data;
}

inline void read(std::FILE* in, BoxedLcp& p) {
  const auto n = static_cast<std::size_t>(take<std::int64_t>(in, 1)[0]);
  p.A = take<double>(in, n * n);
  p.b = take<double>(in, n), p.lo = take<double>(in, n), p.hi = take<double>(in, n);
  p.findex = take<std::int64_t>(in, n);
}

inline double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Warm-up, then calls until the time is used; without time the first call is all.
template <class Solve>
Call timed(const BoxedLcp& problem, double seconds, const Solve& solve) {
  Call last = solve(problem);
  if (seconds <= 0) return last;
  const double first = last.solve + last.form;
  const int calls = static_cast<int>(std::clamp(seconds / std::max(first, 1e-9), 1.0, 1000.0));
  std::vector<double> solving, forming;
  for (int call = 0; call < calls; ++call) {
    last = solve(problem);
    solving.push_back(last.solve), forming.push_back(last.form);
  }
  last.solve = median(solving), last.form = median(forming);
  return last;
}

/// Record that a child leaves for its parent in shared memory, and that is written.
struct Record {
  std::int64_t how;
  double solve, form, reaction[1];
};

template <class Solve>
void solve_apart(const BoxedLcp& problem, double seconds, const Solve& solve, std::FILE* out) {
  const auto rows = static_cast<std::size_t>(problem.rows());
  const std::size_t size = offsetof(Record, reaction) + sizeof(double) * rows;
  void* memory = mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) fail("no memory");
  auto* record = static_cast<Record*>(memory);
  std::fflush(out);
  const pid_t child = fork();
  if (child < 0) fail("no process");
  if (child == 0) {
    alarm(kLimit);
    if (!std::freopen("/dev/null", "w", stdout) || !std::freopen("/dev/null", "w", stderr)) _exit(3);
    const Call call = timed(problem, seconds, solve);
    record->how = call.claimed ? 0 : 1;
    record->solve = call.solve, record->form = call.form;
    std::copy_n(call.reaction.begin(), rows, record->reaction);
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    const bool late = WIFSIGNALED(status) && WTERMSIG(status) == SIGALRM;
    record->how = late ? -1 : -2;
    record->solve = record->form = std::numeric_limits<double>::quiet_NaN();
    std::fill_n(record->reaction, rows, std::numeric_limits<double>::quiet_NaN());
  }
  if (std::fwrite(memory, size, 1, out) != 1) fail("the output cannot be written");
  munmap(memory, size);
}

/// Solves every environment of the input by `solve(problem)`.
template <class Solve>
int serve(char** words, const Solve& solve) {
  std::FILE* in = std::fopen(words[4], "rb");
  std::FILE* out = std::fopen(words[5], "wb");
  if (!in || !out) fail("a file cannot be opened");
  const std::int64_t environments = take<std::int64_t>(in, 1)[0];
  for (std::int64_t e = 0; e < environments; ++e) {
    BoxedLcp problem;
    read(in, problem);
    solve_apart(problem, number<double>(words[3]), solve, out);
  }
  return std::fclose(out) ? 2 : 0;
}

}  // namespace engines
