#include "bench/support/csv_reporter.hpp"

#include <cstdio>
#include <cstring>

#include "bench/support/machine.hpp"
#include "stiction/error.hpp"

namespace stiction::bench {

namespace {

constexpr const char* kCsvOption = "--csv=";

/// The console's reporter that also writes every run into a table.
class CsvReporter : public benchmark::ConsoleReporter {
 public:
  CsvReporter(const std::string& path, const std::string& command)
      : ConsoleReporter(OO_Tabular),
        csv_(path, command, "name,contacts,envs,sweeps,ns_per_contact_sweep,envs_per_second,residual,hash") {}

  void ReportRuns(const std::vector<Run>& runs) override {
    ConsoleReporter::ReportRuns(runs);
    for (const Run& run : runs) {
      if (run.error_occurred) continue;
      const auto counter = [&run](const char* name) { return run.counters.at(name).value; };
      csv_.row({run.benchmark_name(), number(counter("contacts"), 9), number(counter("envs"), 9),
                number(counter("sweeps"), 9), number(counter("ns_per_contact_sweep")),
                number(counter("envs_per_second")), number(counter("residual")), run.report_label});
    }
  }

 private:
  Csv csv_;
};

}  // namespace

void show(benchmark::State& state, const ContactCounters& counters) {
  const auto steps = static_cast<double>(counters.contacts) * static_cast<double>(counters.sweeps) *
                     static_cast<double>(counters.envs);
  using benchmark::Counter;
  state.counters["contacts"] = static_cast<double>(counters.contacts);
  state.counters["envs"] = static_cast<double>(counters.envs);
  state.counters["sweeps"] = static_cast<double>(counters.sweeps);
  state.counters["residual"] = counters.residual;
  state.counters["envs_per_second"] = Counter(static_cast<double>(counters.envs), Counter::kIsIterationInvariantRate);
  // An inverted rate is seconds for each unit; a billionth of the units makes it nanoseconds.
  state.counters["ns_per_contact_sweep"] =
      Counter(steps * 1e-9, Counter::Flags(Counter::kIsIterationInvariantRate | Counter::kInvert));
  state.SetLabel(counters.hash);
}

int run_benchmarks(int argc, char** argv) {
  const std::string command = command_line(argc, argv);
  std::string path;
  for (int i = 1; i < argc; ++i) {
    if (std::strncmp(argv[i], kCsvOption, std::strlen(kCsvOption)) != 0) continue;
    path = argv[i] + std::strlen(kCsvOption);
    for (int k = i; k + 1 < argc; ++k) argv[k] = argv[k + 1];
    --argc;
    --i;
  }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  for (const auto& [name, value] : describe_machine()) benchmark::AddCustomContext(name, value);
  benchmark::AddCustomContext("command", command);
  try {
    if (path.empty()) {
      benchmark::RunSpecifiedBenchmarks();
    } else {
      CsvReporter reporter(path, command);
      benchmark::RunSpecifiedBenchmarks(&reporter);
    }
  } catch (const Error& error) {
    std::fprintf(stderr, "%s: %s\n", argv[0], error.what());
    return 2;
  }
  benchmark::Shutdown();
  return 0;
}

}  // namespace stiction::bench
