// What one scene over ranks sends and how many sweeps it takes to a residual: sequential impulses (docs/ranks.md) and
// consensus between subdomains (docs/math/consensus.md). Ranks are threads of this process. Only counts are printed,
// which are the same on every machine. So are times: ranks have clocks, and
// a round takes 1. A late one takes --slow times as long: all of rank 1's, or of each rank one of as many as there are
// ranks.
//
//   bench_consensus [--scene wall|pile|tower] [--sizes 16] [--ranks 4] [--subdomains 4] [--sweeps 16] [--penalty 32]
//                   [--law convex] [--tolerances 1e-3,1e-6] [--methods si,consensus,asynchronous] [--limit 100000]
//                   [--csv PATH]. With clocks: [--slow 1] [--late one|any] [--latency 0]

#include <algorithm>
#include <cstdio>

#include "bench/support/arguments.hpp"
#include "bench/support/table_main.hpp"
#include "distributed/solve/partition.hpp"
#include "distributed/subdomains/solve_by_consensus.hpp"
#include "distributed/transport/thread_transport.hpp"
#include "scenes/body_scenes.hpp"
#include "scenes/box_scenes.hpp"

namespace stiction::bench {

namespace {

using distributed::ConsensusOptions;
using distributed::RankReport;

BodyEnvironment<double> make_scene(const std::string& name, Index size) {
  if (name == "wall") return scenes::box_bodies(scenes::box_wall(size, size), 0.5);
  if (name == "tower") return scenes::box_bodies(scenes::box_tower(size), 0.5);
  if (name == "pile") return scenes::make_body_pile(1, size);
  throw Error(ErrorCode::invalid_argument, "--scene " + name + ": expected wall, pile or tower");
}

/// Who is late, and by how much.
struct Lateness {
  double slow = 1;      ///< length of a late round, in those of others
  bool is_any = false;  ///< one round of as many as there are ranks is late, drawn for each rank; else all of rank 1's
  double latency = 0;   ///< of a message, in rounds
};

/// How long a rank's rounds take, one after the other.
class RoundLengths {
 public:
  RoundLengths(const Lateness& late, int rank, int ranks)
      : late_(late), rank_(rank), ranks_(ranks), state_(static_cast<std::uint64_t>(rank) + 1) {}
  double next() {
    state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL;
    const bool is_late = late_.is_any ? (state_ >> 33U) % static_cast<std::uint64_t>(ranks_) == 0 : rank_ == 1;
    return is_late ? late_.slow : 1;
  }

 private:
  const Lateness& late_;
  int rank_, ranks_;
  std::uint64_t state_;
};

struct Counts {
  EnvStatus status{};
  std::int64_t exchanges = 0, gathers = 0, bytes = 0;
  std::int64_t fewest_rounds = 0, most_rounds = 0;  ///< of a rank
  double time = 0;                                  ///< when rank 0 has the answer, in rounds

  void take(const std::vector<RankReport>& ranks) {
    for (const RankReport& rank : ranks) {
      exchanges = std::max(exchanges, rank.exchanges);
      gathers = std::max(gathers, rank.gathers);
      bytes += rank.bytes;
      most_rounds = std::max(most_rounds, rank.rounds);
    }
    fewest_rounds = most_rounds;
    for (const RankReport& rank : ranks) fewest_rounds = std::min(fewest_rounds, rank.rounds);
  }
};

/// By sequential impulses, or by consensus where there are options of it.
Counts count(const BodyBatch<double>& batch, int ranks, const ConsensusOptions* consensus,
             const BodySolverOptions& options, const Lateness& late) {
  const BodyBatchView<double> view = batch.view();
  const std::vector<int> part =
      distributed::bisect(distributed::centres_by_arms(view), consensus != nullptr ? consensus->subdomains : ranks);
  std::vector<double> impulse(static_cast<std::size_t>(3 * view.contact_count));
  std::vector<double> twist(static_cast<std::size_t>(6 * view.body_count));
  Counts counts;
  // A loaded machine is slow, and nothing here is about time.
  distributed::run_clocked_ranks(ranks, 3600, late.latency, [&](distributed::ClockedTransport& transport) {
    RoundLengths lengths(late, transport.rank(), ranks);
    ConsensusOptions own;
    if (consensus != nullptr) own = *consensus;
    own.after_sweeps = [&] { transport.advance(lengths.next()); };
    BodySolutionView<double> solution;
    if (transport.rank() == 0) solution = {impulse.data(), twist.data(), nullptr, &counts.status};
    const auto all = consensus != nullptr
                         ? distributed::solve_by_consensus<double>(transport, view, part, own, {}, options, solution)
                         : distributed::solve_over_ranks<double>(transport, view, part, {}, options, solution);
    if (transport.rank() != 0) return;
    counts.take(all);
    counts.time = transport.seconds();
  });
  return counts;
}

/// Each method with each slowness.
std::vector<std::pair<std::string, double>> pairs_of(const std::vector<std::string>& methods,
                                                     const std::vector<double>& slow) {
  std::vector<std::pair<std::string, double>> all;
  for (const std::string& method : methods)
    for (const double one : slow) all.emplace_back(method, one);
  return all;
}

}  // namespace

int run(int argc, char** argv) {
  const Arguments arguments(argc, argv,
                            {{"--scene", "wall"},
                             {"--sizes", "16"},
                             {"--ranks", "4"},
                             {"--subdomains", "4"},
                             {"--sweeps", "16"},
                             {"--penalty", "32"},
                             {"--law", "convex"},
                             {"--tolerances", "1e-3,1e-6"},
                             {"--methods", "si,consensus"},
                             {"--limit", "100000"},
                             {"--slow", "1"},
                             {"--late", "one"},
                             {"--latency", "0"}});
  const std::string& scene = arguments.text("--scene");
  const int ranks = arguments.count("--ranks");
  ConsensusOptions consensus;
  consensus.subdomains = arguments.count("--subdomains");
  consensus.sweeps = arguments.count("--sweeps");
  consensus.penalty = arguments.number("--penalty");
  BodySolverOptions options;
  options.law = arguments.text("--law") == "convex" ? Law::convex : Law::coulomb;
  options.iterations = arguments.count("--limit");
  const auto csv = arguments.csv(
      "scene,size,bodies,contacts,law,method,ranks,subdomains,sweeps_per_round,penalty,tolerance,sweeps,residual,code,"
      "exchanges,gathers,bytes,slow,late,latency,fewest_rounds,most_rounds,time");
  std::printf("%-6s %6s %7s %-12s %9s %8s %9s %-14s %9s %8s %12s %5s %7s %7s %9s\n", "scene", "size", "bodies",
              "method", "tolerance", "sweeps", "residual", "ended", "exchanges", "gathers", "bytes", "slow", "fewest",
              "most", "time");
  Lateness late;
  late.is_any = arguments.text("--late") == "any";
  late.latency = arguments.number("--latency");
  for (const int size : arguments.counts("--sizes")) {
    BodyBatch<double> batch;
    batch.add(make_scene(scene, size));
    for (const double tolerance : arguments.numbers("--tolerances"))
      for (const auto& [method, slow] : pairs_of(arguments.texts("--methods"), arguments.numbers("--slow"))) {
        options.tolerance = tolerance;
        late.slow = slow;
        consensus.asynchronous = method == "asynchronous";
        const bool by_consensus = method != "si";
        const Counts counts = count(batch, ranks, by_consensus ? &consensus : nullptr, options, late);
        const EnvStatus& status = counts.status;
        std::printf("%-6s %6d %7lld %-12s %9.0e %8d %9.1e %-14s %9lld %8lld %12lld %5g %7lld %7lld %9g\n",
                    scene.c_str(), size, static_cast<long long>(batch.body_count()), method.c_str(), tolerance,
                    status.iterations, status.residual, to_string(status.code),
                    static_cast<long long>(counts.exchanges), static_cast<long long>(counts.gathers),
                    static_cast<long long>(counts.bytes), slow, static_cast<long long>(counts.fewest_rounds),
                    static_cast<long long>(counts.most_rounds), counts.time);
        std::fflush(stdout);
        if (csv)
          csv->row({scene,
                    std::to_string(size),
                    std::to_string(batch.body_count()),
                    std::to_string(batch.contact_count()),
                    to_string(options.law),
                    method,
                    std::to_string(ranks),
                    by_consensus ? std::to_string(consensus.subdomains) : "",
                    by_consensus ? std::to_string(consensus.sweeps) : "",
                    by_consensus ? number(consensus.penalty) : "",
                    number(tolerance),
                    std::to_string(status.iterations),
                    number(status.residual),
                    to_string(status.code),
                    std::to_string(counts.exchanges),
                    std::to_string(counts.gathers),
                    std::to_string(counts.bytes),
                    number(slow),
                    arguments.text("--late"),
                    number(late.latency),
                    std::to_string(counts.fewest_rounds),
                    std::to_string(counts.most_rounds),
                    number(counts.time)});
      }
  }
  return 0;
}

}  // namespace stiction::bench
