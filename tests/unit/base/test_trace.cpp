#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "stiction/solver.hpp"
#include "stiction/trace.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace stiction::test {
namespace {

/// Spans of that name.
std::vector<Span> named(const std::vector<Span>& spans, const std::string& name) {
  std::vector<Span> found;
  for (const Span& span : spans)
    if (span.name == name) found.push_back(span);
  return found;
}

TEST(Trace, TheJsonIsWhatTheFormatAsksFor) {
  Tracer tracer;
  tracer.add({"a \"quoted\"\nname", nullptr, SpanPlace::host, 3, -1, 12.5, 0.0625});
  tracer.add({"kernel", "npgs", SpanPlace::device, 1, 7, 2, 1});
  EXPECT_EQ(tracer.chrome_json(),
            "[\n{\"name\": \"kernel\", \"cat\": \"device\", \"ph\": \"X\", \"ts\": 2.000, \"dur\": 1.000, \"pid\": 1, "
            "\"tid\": 1, \"args\": {\"detail\": \"npgs\", \"environments\": 7}},\n"
            "{\"name\": \"a \\\"quoted\\\" name\", \"cat\": \"host\", \"ph\": \"X\", \"ts\": 12.500, \"dur\": 0.062, "
            "\"pid\": 0, \"tid\": 3, \"args\": {}}\n]\n");
  EXPECT_EQ(Tracer().chrome_json(), "[\n]\n");
}

TEST(Trace, MemoryIsBoundedAndWhatIsLeftOutIsCounted) {
  Tracer tracer(5);
  std::vector<std::thread> threads;
  for (int lane = 0; lane < 4; ++lane)
    threads.emplace_back([&tracer, lane] {
      for (int k = 0; k < 10; ++k) const ScopedSpan span(&tracer, "work", nullptr, lane);
    });
  for (std::thread& thread : threads) thread.join();
  tracer.leave_out(2);
  EXPECT_EQ(tracer.spans().size(), 5U);
  EXPECT_EQ(tracer.left_out(), 37U);
}

TEST(Trace, ASpanLastsAsLongAsItsScopeAndHoldsWhatIsInside) {
  Tracer tracer;
  {
    const ScopedSpan outer(&tracer, "outer");
    const ScopedSpan inner(&tracer, "inner", "detail", 2, 9);
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  const auto spans = tracer.spans();
  ASSERT_EQ(spans.size(), 2U);
  EXPECT_STREQ(spans[0].name, "outer") << "sorted by start, though the inner one ended first";
  EXPECT_GE(spans[1].duration, 2000);
  EXPECT_LE(spans[0].start, spans[1].start);
  EXPECT_GE(spans[0].start + spans[0].duration, spans[1].start + spans[1].duration);
  EXPECT_EQ(spans[1].lane, 2);
  EXPECT_EQ(spans[1].environments, 9);
}

TEST(Trace, EveryEnvironmentIsInOneWorkItemOfTheCpuAndNoBitChanges) {
  const ContactBatch<double> batch = ragged_batch(5, 3);
  SolverOptions o = options(SolverKind::npgs, 1e-3, 40);
  const auto expected = solve_hashes(batch, o);
  for (const int threads : {1, 3}) {
    Tracer tracer;
    o.threads = threads;
    o.tracer = &tracer;
    EXPECT_EQ(solve_hashes(batch, o), expected);
    const auto spans = tracer.spans();
    ASSERT_EQ(named(spans, "plan").size(), 1U);
    ASSERT_EQ(named(spans, "solve").size(), 1U);
    const Span solve = named(spans, "solve").front();
    std::int64_t environments = 0;
    std::set<std::string> classes;
    for (const char* name : {"pack", "one by one"})
      for (const Span& item : named(spans, name)) {
        environments += item.environments;
        classes.insert(item.detail);
        EXPECT_GE(item.lane, 0);
        EXPECT_LT(item.lane, threads);
        EXPECT_GE(item.start, solve.start);
        EXPECT_LE(item.start + item.duration, solve.start + solve.duration);
      }
    EXPECT_EQ(environments, batch.env_count());
    EXPECT_TRUE(classes.count("dense") == 1 && classes.count("sparse") == 1) << classes.size();
  }
}

TEST(Trace, OneThreadDoesOneThingAtATime) {
  Tracer tracer;
  SolverOptions o = options(SolverKind::npgs, 1e-3, 20);
  o.threads = 3;
  o.tracer = &tracer;
  solve(scene_batch("mixed", 60, 4, 24), o);
  std::vector<Span> items = named(tracer.spans(), "pack");
  for (const Span& item : named(tracer.spans(), "one by one")) items.push_back(item);
  ASSERT_GT(items.size(), 1U);
  for (const Span& a : items)
    for (const Span& b : items)
      if (&a != &b && a.lane == b.lane) {
        EXPECT_TRUE(a.start + a.duration <= b.start || b.start + b.duration <= a.start) << a.lane;
      }
}

}  // namespace
}  // namespace stiction::test
