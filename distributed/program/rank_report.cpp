#include "distributed/program/rank_report.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "cli/commands.hpp"
#include "cli/json_text.hpp"
#include "stiction/error.hpp"

namespace stiction::distributed {

namespace {

using cli::Json;

struct Totals {
  std::int64_t exchanges = 0, gathers = 0, messages = 0, bytes = 0;
  double seconds = 0, waited = 0, largest_work = 0, mean_work = 0;

  explicit Totals(const std::vector<RankReport>& ranks) {
    for (const RankReport& rank : ranks) {
      exchanges = std::max(exchanges, rank.exchanges);
      gathers = std::max(gathers, rank.gathers);
      messages += rank.messages;
      bytes += rank.bytes;
      seconds += rank.seconds;
      waited += rank.waited;
      largest_work = std::max(largest_work, rank.seconds - rank.waited);
    }
    mean_work = ranks.empty() ? 0 : (seconds - waited) / static_cast<double>(ranks.size());
  }
  [[nodiscard]] double share() const { return seconds > 0 ? waited / seconds : 0; }
  /// Largest of the ranks' times at work over their mean.
  [[nodiscard]] double imbalance() const { return mean_work > 0 ? largest_work / mean_work : 1; }
};

Json json_of(const std::vector<RankReport>& ranks) {
  Json all = Json::array();
  for (const RankReport& rank : ranks)
    all.push_back({{"bodies", rank.bodies - rank.ghosts},
                   {"ghosts", rank.ghosts},
                   {"contacts", rank.contacts},
                   {"exchanges", rank.exchanges},
                   {"messages", rank.messages},
                   {"bytes", rank.bytes},
                   {"seconds", rank.seconds},
                   {"waited", rank.waited}});
  return all;
}

/// Adds the ranks' work to a report that has the rest.
void put_ranks(Json& json, const std::vector<RankReport>& ranks, const std::string& partition) {
  const Totals totals(ranks);
  json["ranks"] = ranks.size();
  json["partition"] = partition;
  json["exchanges"] = totals.exchanges;
  json["gathers"] = totals.gathers;
  json["messages"] = totals.messages;
  json["bytes"] = totals.bytes;
  json["synchronisation_share"] = totals.share();
  json["imbalance"] = totals.imbalance();
  json["per_rank"] = json_of(ranks);
}

std::string line(const char* name, const std::string& value) {
  return fmt::format("{:<16}{}\n", name, value);
}

std::string ranks_line(const std::vector<RankReport>& ranks, const std::string& partition) {
  return line("ranks", fmt::format("{}, partition {}", ranks.size(), partition));
}

/// Nothing for a method without subdomains.
std::string method_line(const JobReport& report) {
  if (report.method == "newton")
    return line("method", fmt::format("newton over {} subdomains, {} sweeps, {} linear iterations",
                                      report.consensus.subdomains, report.newton.sweeps, report.newton.linear_steps));
  if (report.method != "consensus") return {};
  return line("method", fmt::format("consensus of {} subdomains, {} sweeps a round{}", report.consensus.subdomains,
                                    report.consensus.sweeps,
                                    report.consensus.asynchronous ? ", asynchronous: not reproducible" : ""));
}

std::string traffic_lines(const std::vector<RankReport>& ranks) {
  const Totals totals(ranks);
  return line("exchanges", fmt::format("{} of twists, {} of single numbers", totals.exchanges, totals.gathers)) +
         line("sent", fmt::format("{} messages, {} bytes", totals.messages, totals.bytes)) +
         line("synchronisation",
              fmt::format("{:.1f} % of the ranks' time, imbalance {:.3f}", 100 * totals.share(), totals.imbalance()));
}

std::string memory_line(std::int64_t most) {
  return line("memory", fmt::format("{:.0f} MB at most of a rank", static_cast<double>(most) / 1e6));
}

std::vector<RankReport> solves_of(const std::vector<StepRankReport>& ranks) {
  std::vector<RankReport> solves;
  for (const StepRankReport& rank : ranks) solves.push_back(rank.solve);
  return solves;
}

}  // namespace

void add(RankReport& total, const RankReport& more) {
  total.seconds += more.seconds;
  total.waited += more.waited;
  total.bodies += more.bodies;
  total.ghosts += more.ghosts;
  total.contacts += more.contacts;
  total.exchanges += more.exchanges;
  total.gathers += more.gathers;
  total.messages += more.messages;
  total.bytes += more.bytes;
  total.rounds += more.rounds;
}

void add(StepTraffic& total, const StepTraffic& more) {
  total.seconds.detect += more.seconds.detect;
  total.seconds.plan += more.seconds.plan;
  total.seconds.integrate += more.seconds.integrate;
  total.near_bodies += more.near_bodies;
  total.migrated += more.migrated;
  total.waves += more.waves;
  total.exchanges += more.exchanges;
  total.gathers += more.gathers;
  total.messages += more.messages;
  total.bytes += more.bytes;
}

std::string to_json(const JobReport& report) {
  const cli::SolveReport& solve = report.solve;
  Json json = {{"schema_version", cli::kReportSchemaVersion},
               {"solver", solve.solver},
               {"precision", stiction::to_string(solve.precision)},
               {"law", to_string(solve.law)},
               {"environments", solve.environments},
               {"bodies", report.bodies},
               {"contacts", solve.cones},
               {"seconds", {{"load", solve.seconds.load}, {"solve", solve.seconds.solve}}},
               {"iterations", cli::json_of(solve.iterations)},
               {"residual", cli::json_of(solve.residual)},
               {"unconverged", solve.unconverged},
               {"hash", cli::hex(solve.hash)},
               {"epoch", kNumericsEpoch}};
  put_ranks(json, report.ranks, report.partition);
  for (std::size_t k = 0; k < report.ranks.size(); ++k) json["per_rank"][k]["peak_memory"] = report.peak_memory[k];
  json["method"] = report.method;
  json["reproducible"] = !report.consensus.asynchronous;
  if (report.method == "consensus") {
    json["subdomains"] = report.consensus.subdomains;
    json["sweeps_per_round"] = report.consensus.sweeps;
    json["penalty"] = report.consensus.penalty;
    json["asynchronous"] = report.consensus.asynchronous;
    for (std::size_t k = 0; k < report.ranks.size(); ++k) json["per_rank"][k]["rounds"] = report.ranks[k].rounds;
  }
  if (report.method == "newton") {
    json["subdomains"] = report.consensus.subdomains;
    json["sweeps"] = report.newton.sweeps;
    json["linear_iterations"] = report.newton.linear_steps;
  }
  return cli::dump(json);
}

std::string to_json(const StepJobReport& report) {
  Json json = cli::json_of(report.step);
  put_ranks(json, solves_of(report.ranks), report.partition);
  std::int64_t migrated = 0;
  for (std::size_t k = 0; k < report.ranks.size(); ++k) {
    const StepTraffic& rest = report.ranks[k].rest;
    migrated += rest.migrated;
    json["per_rank"][k]["rest"] = {{"near_bodies", rest.near_bodies},
                                   {"migrated", rest.migrated},
                                   {"waves", rest.waves},
                                   {"exchanges", rest.exchanges},
                                   {"gathers", rest.gathers},
                                   {"messages", rest.messages},
                                   {"bytes", rest.bytes},
                                   {"detect_seconds", rest.seconds.detect},
                                   {"plan_seconds", rest.seconds.plan}};
    json["per_rank"][k]["peak_memory"] = report.ranks[k].peak_memory;
  }
  json["migrated"] = migrated;
  return cli::dump(json);
}

std::string to_text(const JobReport& report) {
  const cli::SolveReport& solve = report.solve;
  return line("file", solve.file) + line("environments", fmt::format("{}", solve.environments)) +
         line("bodies", fmt::format("{}", report.bodies)) + line("contacts", fmt::format("{}", solve.cones)) +
         line("solver", fmt::format("{}, tolerance {:g}, at most {} iterations", solve.solver, solve.options.tolerance,
                                    solve.options.max_iterations)) +
         line("law", to_string(solve.law)) + line("precision", stiction::to_string(solve.precision)) +
         method_line(report) + ranks_line(report.ranks, report.partition) +
         line("seconds", fmt::format("load {:.4g}  solve {:.4g}", solve.seconds.load, solve.seconds.solve)) +
         line("iterations", cli::quantile_text(solve.iterations)) +
         line("residual", cli::quantile_text(solve.residual)) + traffic_lines(report.ranks) +
         memory_line(*std::max_element(report.peak_memory.begin(), report.peak_memory.end())) +
         line("unconverged", fmt::format("{}", solve.unconverged)) +
         line("hash", fmt::format("{} (numerics epoch {})", cli::hex(solve.hash), kNumericsEpoch));
}

std::string to_text(const StepJobReport& report) {
  const std::vector<RankReport> solves = solves_of(report.ranks);
  StepTraffic rest;
  std::int64_t most = 0;
  for (const StepRankReport& rank : report.ranks) {
    add(rest, rank.rest);
    most = std::max(most, rank.peak_memory);
  }
  return cli::to_text(report.step) + ranks_line(solves, report.partition) + traffic_lines(solves) +
         line("beside solves",
              fmt::format("{} messages, {} bytes, {} bodies migrated", rest.messages, rest.bytes, rest.migrated)) +
         memory_line(most);
}

}  // namespace stiction::distributed
