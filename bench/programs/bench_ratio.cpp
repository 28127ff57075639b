// Speed of lanes = environments over a naive scalar loop. The implementations alternate again and again (A B C A B C
// ...) on one thread, in CPU time, warm-up excluded. The program prints median and quartiles of the ratio over
// repeats.
//
//   bench_ratio [--contacts 8,16] [--envs 1024] [--family stack] [--precision f32] [--repeats 5] [--seed 7]
//               [--csv PATH]

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>

#include "bench/support/arguments.hpp"
#include "bench/support/baselines.hpp"
#include "bench/support/csv.hpp"
#include "bench/support/grid.hpp"
#include "bench/support/machine.hpp"
#include "bench/support/table_main.hpp"

namespace stiction::bench {

namespace {

constexpr Index kShort = 20;            // sweeps of a whole call
constexpr Index kLong = 60;             // sweeps of the longer call, for the slope
constexpr double kLeastSeconds = 0.02;  // of one measurement; shorter calls are repeated inside it

/// Quartiles of measurements.
struct Spread {
  double q1, median, q3;
};
Spread spread(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const auto at = [&](double part) {
    const double position = part * static_cast<double>(values.size() - 1);
    const auto low = static_cast<std::size_t>(position);
    const std::size_t high = std::min(low + 1, values.size() - 1);
    return values[low] + (position - static_cast<double>(low)) * (values[high] - values[low]);
  };
  return {at(0.25), at(0.5), at(0.75)};
}

/// One way to solve the batch: a call of so many sweeps, and its measurements.
template <class Real>
struct Contestant {
  std::string name, flags;
  std::function<void(Index sweeps, std::vector<Real>& lambda)> solve;
  int calls = 1;                ///< inside one measurement
  std::vector<double> whole;    ///< seconds of a call of kShort sweeps, one for each repeat
  std::vector<double> slope;    ///< seconds of kLong - kShort sweeps, by difference
  double residual[2] = {0, 0};  ///< after kShort and kLong sweeps
  std::string hash;             ///< of lambda after kShort sweeps
};

template <class Real>
std::vector<Contestant<Real>> make_contestants(const ContactBatch<Real>& batch) {
  std::vector<Contestant<Real>> all;
  for (const BaselineInfo& info : baselines()) {
    Baseline<Real> baseline;
    if constexpr (std::is_same_v<Real, float>) {
      baseline = info.f32;
    } else {
      baseline = info.f64;
    }
    Contestant<Real> contestant;
    contestant.name = info.name;
    contestant.flags = info.flags;
    contestant.solve = [&batch, baseline](Index sweeps, std::vector<Real>& lambda) {
      run_baseline(baseline, batch, sweeps, lambda);
    };
    all.push_back(std::move(contestant));
  }
  const auto plan = std::make_shared<Plan>(Solver(Device::cpu(), SolverOptions{}).plan(batch.view()));
  for (const SolverKind kind : {SolverKind::pgs, SolverKind::npgs}) {
    Contestant<Real> contestant;
    contestant.name = std::string("stiction ") + to_string(kind);
    contestant.flags = devices().front().name;
    std::replace(contestant.flags.begin(), contestant.flags.end(), ',', ';');
    const auto brief = std::make_shared<Solver>(Device::cpu(), fixed_sweeps(kind, kShort));
    const auto lengthy = std::make_shared<Solver>(Device::cpu(), fixed_sweeps(kind, kLong));
    const auto status = std::make_shared<std::vector<EnvStatus>>(static_cast<std::size_t>(batch.env_count()));
    const auto w = std::make_shared<std::vector<Real>>(static_cast<std::size_t>(batch.row_count()));
    contestant.solve = [=, &batch](Index sweeps, std::vector<Real>& lambda) {
      lambda.resize(static_cast<std::size_t>(batch.row_count()));
      (sweeps == kShort ? brief : lengthy)->solve(*plan, batch.view(), {lambda.data(), w->data(), status->data()});
    };
    all.push_back(std::move(contestant));
  }
  return all;
}

template <class Real>
double measure(const Contestant<Real>& contestant, Index sweeps, std::vector<Real>& lambda) {
  const double start = cpu_seconds();
  for (int call = 0; call < contestant.calls; ++call) contestant.solve(sweeps, lambda);
  return (cpu_seconds() - start) / contestant.calls;
}

/// Warm-up: the answer, and how often a call has to be repeated to be measured.
template <class Real>
void prepare(Contestant<Real>& contestant, const ContactBatch<Real>& batch, std::vector<Real>& lambda) {
  contestant.solve(kLong, lambda);
  contestant.residual[1] = worst_residual(batch, lambda);
  const double seconds = measure(contestant, kShort, lambda);
  contestant.residual[0] = worst_residual(batch, lambda);
  contestant.hash = hash_text(lambda);
  contestant.calls = std::max(1, static_cast<int>(kLeastSeconds / std::max(seconds, 1e-7)));
}

template <class Real>
void compete(const std::string& family, Index contacts, Offset envs, std::uint64_t seed, int repeats, Csv* csv) {
  const ContactBatch<Real> batch = make_contacts<Real>(family, contacts, envs, seed);
  std::vector<Contestant<Real>> all = make_contestants(batch);
  std::vector<Real> lambda;
  for (Contestant<Real>& contestant : all) prepare(contestant, batch, lambda);
  for (int repeat = 0; repeat < repeats; ++repeat)
    for (Contestant<Real>& contestant : all) {
      contestant.whole.push_back(measure(contestant, kShort, lambda));
      contestant.slope.push_back(measure(contestant, kLong, lambda) - contestant.whole.back());
    }

  const std::string precision = precision_name<Real>();
  const double fill = static_cast<double>(batch.view().nonzero_count) /
                      (9.0 * static_cast<double>(envs) * static_cast<double>(contacts) * static_cast<double>(contacts));
  std::printf("\n%s, %s, %d contacts, %lld environments, A %.0f %% full\n", family.c_str(), precision.c_str(), contacts,
              static_cast<long long>(envs), 100 * fill);
  std::printf("%-14s %-28s %21s %24s %24s %22s  %s\n", "", "", "ns/contact/sweep", "times naive, whole call",
              "times naive, sweeps", "residual after", "");
  std::printf("%-14s %-28s %10s %10s %8s %15s %8s %15s %10s %11s  %s\n", "implementation", "flags", "whole call",
              "sweeps", "median", "quartiles", "median", "quartiles", "20", "60 sweeps", "hash at 20");
  const double steps = static_cast<double>(contacts) * static_cast<double>(envs);
  for (const Contestant<Real>& contestant : all) {
    std::vector<double> whole_ratio;
    std::vector<double> slope_ratio;
    for (std::size_t r = 0; r < contestant.whole.size(); ++r) {
      whole_ratio.push_back(all.front().whole[r] / contestant.whole[r]);
      slope_ratio.push_back(all.front().slope[r] / contestant.slope[r]);
    }
    const double whole = 1e9 * spread(contestant.whole).median / (steps * kShort);
    const double slope = 1e9 * spread(contestant.slope).median / (steps * (kLong - kShort));
    const Spread a = spread(whole_ratio);
    const Spread b = spread(slope_ratio);
    std::printf("%-14s %-28s %10.2f %10.2f %8.2f %7.2f-%7.2f %8.2f %7.2f-%7.2f %10.2e %11.2e  %s\n",
                contestant.name.c_str(), contestant.flags.c_str(), whole, slope, a.median, a.q1, a.q3, b.median, b.q1,
                b.q3, contestant.residual[0], contestant.residual[1], contestant.hash.c_str());
    if (csv != nullptr)
      csv->row({family, precision, std::to_string(contacts), std::to_string(envs), number(fill), contestant.name,
                contestant.flags, number(whole), number(slope), number(a.q1), number(a.median), number(a.q3),
                number(b.q1), number(b.median), number(b.q3), number(contestant.residual[0]),
                number(contestant.residual[1]), contestant.hash});
  }
  std::fflush(stdout);
}

}  // namespace

int run(int argc, char** argv) {
  std::string all_families;
  for (const std::string& family : families()) all_families += (all_families.empty() ? "" : ",") + family;
  const Arguments arguments(argc, argv,
                            {{"--contacts", "1,2,4,8,16,22,32,64"},
                             {"--envs", "1024"},
                             {"--family", all_families},
                             {"--precision", "f32,f64"},
                             {"--repeats", "5"},
                             {"--seed", std::to_string(kSeed)}});
  const auto seed = static_cast<std::uint64_t>(arguments.count("--seed", 0));
  const Offset most_envs = arguments.count("--envs");
  const int repeats = arguments.count("--repeats");
  // As many numbers as that many environments of 8 contacts have: larger ones are fewer.
  const Offset entries = most_envs * 24 * 24;
  const auto csv = arguments.csv(
      "family,precision,contacts,envs,fill,implementation,flags,ns_whole,ns_sweeps,"
      "whole_q1,whole_median,whole_q3,sweeps_q1,sweeps_median,sweeps_q3,residual_20,"
      "residual_60,hash_20");
  for (const auto& [name, value] : describe_machine()) std::printf("# %s: %s\n", name.c_str(), value.c_str());
  for (const std::string& family : arguments.texts("--family"))
    for (const std::string& precision : arguments.texts("--precision"))
      for (const Index contacts : arguments.counts("--contacts")) {
        const Offset envs = capped_envs(contacts, most_envs, entries);
        if (precision == "f32") {
          compete<float>(family, contacts, envs, seed, repeats, csv.get());
        } else {
          compete<double>(family, contacts, envs, seed, repeats, csv.get());
        }
      }
  return 0;
}

}  // namespace stiction::bench
