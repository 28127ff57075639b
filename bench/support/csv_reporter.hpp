#pragma once

#include <benchmark/benchmark.h>

#include <memory>
#include <string>

#include "bench/support/csv.hpp"
#include "stiction/types.hpp"

namespace stiction::bench {

/// Numbers that every benchmark of a contact batch shows beside its time.
struct ContactCounters {
  Index contacts;
  Offset envs;
  Index sweeps;
  double residual;   ///< largest relative residual after those sweeps
  std::string hash;  ///< of lambda
};

/// Sets the counters and the label of a finished benchmark.
void show(benchmark::State& state, const ContactCounters& counters);

/// Runs everything registered: console as Google Benchmark prints it, its JSON with --benchmark_out, and with
/// --csv=PATH a table with the command in line 1. Returns the exit status.
int run_benchmarks(int argc, char** argv);

}  // namespace stiction::bench
