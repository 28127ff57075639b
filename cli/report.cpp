#include "cli/report.hpp"

#include <fmt/format.h>

#include "cli/commands.hpp"
#include "cli/json_text.hpp"
#include "cli/thread_use.hpp"
#include "stiction/error.hpp"

namespace stiction::cli {

namespace {

EnvFlag flag_of(std::size_t bit) {
  return static_cast<EnvFlag>(1U << bit);
}

std::string counts_text(const std::string& zero, const std::vector<std::string>& counts) {
  return counts.empty() ? zero : fmt::format("{}", fmt::join(counts, ", "));
}

std::string codes_text(const SolveReport& report) {
  std::vector<std::string> counts;
  for (std::size_t code = 0; code < report.codes.size(); ++code) {
    if (report.codes[code] != 0) {
      counts.push_back(fmt::format("{} {}", report.codes[code], to_string(static_cast<EnvCode>(code))));
    }
  }
  return counts_text("-", counts);
}

std::string flags_text(const SolveReport& report) {
  std::vector<std::string> counts;
  for (std::size_t bit = 0; bit < report.flags.size(); ++bit) {
    if (report.flags[bit] != 0) counts.push_back(fmt::format("{} {}", report.flags[bit], flag_name(flag_of(bit))));
  }
  return counts_text("none", counts);
}

std::string answered_text(const SolveReport& report) {
  std::vector<std::string> counts;
  for (const auto& [solver, count] : report.answered) counts.push_back(fmt::format("{} {}", count, to_string(solver)));
  return counts_text("-", counts);
}

/// True if some environment was taken apart.
bool is_apart(const SolveReport& report) {
  return report.islands && report.islands->max > 0;
}

std::string rate_text(const SolveReport& report) {
  if (report.seconds.solve <= 0) return "-";
  return fmt::format("{:.4g}", static_cast<double>(report.environments) / report.seconds.solve);
}

}  // namespace

void SolveReport::count(std::span<const EnvStatus> status) {
  std::vector<std::int32_t> iteration_counts, island_counts;
  std::vector<double> residuals;
  iteration_counts.reserve(status.size());
  residuals.reserve(status.size());
  for (const EnvStatus& env : status) {
    iteration_counts.push_back(env.iterations);
    residuals.push_back(env.residual);
    island_counts.push_back(env.islands);
    ++codes[static_cast<std::size_t>(env.code)];
    for (std::size_t bit = 0; bit < flags.size(); ++bit) flags[bit] += (env.flags & flag_of(bit)) != 0 ? 1 : 0;
    ++answered[env.solver];
    unconverged += env.code != EnvCode::solved ? 1 : 0;
  }
  iterations = quantiles(std::move(iteration_counts));
  residual = quantiles(std::move(residuals));
  islands = quantiles(std::move(island_counts));
}

std::string to_json(const SolveReport& report) {
  Json flags = Json::object();
  for (std::size_t bit = 0; bit < report.flags.size(); ++bit) flags[flag_name(flag_of(bit))] = report.flags[bit];
  Json answered = Json::object();
  for (const auto& [solver, count] : report.answered) answered[to_string(solver)] = count;
  Json json = {
      {"schema_version", kReportSchemaVersion},
      {"device", report.device},
      {"solver", report.solver},
      {"precision", to_string(report.precision)},
      {"law", to_string(report.law)},
      {"environments", report.environments},
      {"rows", report.rows},
      {"cones", report.cones},
      {"threads", report.threads == 0 ? Json(nullptr) : Json(report.threads)},
      {"seconds", {{"load", report.seconds.load}, {"plan", report.seconds.plan}, {"solve", report.seconds.solve}}},
      {"thread_use", report.threads == 0 ? Json(nullptr) : json_of(report.seconds.threads)},
      {"gpu_utilisation", json_of(report.gpu)},
      {"gpu_utilisation_reason", report.gpu.reason},
      {"iterations", json_of(report.iterations)},
      {"residual", json_of(report.residual)},
      {"flags", flags},
      {"answered", answered},
      {"unconverged", report.unconverged},
      {"hash", hex(report.hash)},
      {"epoch", kNumericsEpoch}};
  if (report.options.islands != IslandMode::together) json["islands"] = to_string(report.options.islands);
  if (is_apart(report)) json["islands_apart"] = json_of(report.islands);
  if (report.options.blocks != BlockMode::cones) json["blocks"] = to_string(report.options.blocks);
  if (report.options.direct_rows != SolverOptions{}.direct_rows) json["direct_rows"] = report.options.direct_rows;
  if (report.pyramid > 0) json["pyramid"] = report.pyramid;
  if (report.form != "matrix") json["form"] = report.form;
  if (!report.preconditioner.empty()) json["preconditioner"] = report.preconditioner;
  if (report.asynchronous) json["asynchronous"] = true;
  if (report.asynchronous) json["reproducible"] = false;
  if (report.shard)
    json["shard"] = {{"index", report.shard->index},
                     {"count", report.shard->count},
                     {"first_environment", report.shard->first_environment},
                     {"environments", report.shard->environment_count}};
  return dump(json);
}

std::string to_text(const SolveReport& report) {
  std::string text;
  const auto line = [&](const char* name, const std::string& value) { text += fmt::format("{:<16}{}\n", name, value); };
  line("file", report.file);
  if (report.shard)
    line("shard", fmt::format("{}/{}, from environment {} of {}", report.shard->index, report.shard->count,
                              report.shard->first_environment, report.shard->environment_count));
  line("environments", fmt::format("{}", report.environments));
  line("rows", fmt::format("{}", report.rows));
  line("cones", fmt::format("{}", report.cones));
  if (report.form == "jacobian") line("form", "jacobian: J and M of the file");
  if (report.form == "bodies") line("form", "bodies: rigid bodies of J and M of the file");
  line("solver", fmt::format("{}, tolerance {:g}, at most {} iterations", report.solver, report.options.tolerance,
                             report.options.max_iterations));
  if (!report.preconditioner.empty()) line("preconditioner", report.preconditioner);
  if (report.asynchronous) line("asynchronous", "not reproducible");
  if (report.options.islands != IslandMode::together) line("islands", to_string(report.options.islands));
  if (report.options.blocks != BlockMode::cones) line("blocks", to_string(report.options.blocks));
  line("law", to_string(report.law));
  if (report.pyramid > 0)
    line("pyramid", fmt::format("{} sides; residuals are those of the pyramids, whose law is convex", report.pyramid));
  line("device", fmt::format("{} ({})", report.device, report.device_name));
  line("precision", to_string(report.precision));
  line("threads", report.threads == 0 ? "-" : fmt::format("{}", report.threads));
  if (report.threads > 0) line("thread use", thread_use_text(report.seconds.threads));
  line("seconds", fmt::format("load {:.4g}  plan {:.4g}  solve {:.4g}", report.seconds.load, report.seconds.plan,
                              report.seconds.solve));
  if (report.threads == 0) line("GPU utilisation", gpu_use_text(report.gpu));
  line("environments/s", rate_text(report));
  line("iterations", quantile_text(report.iterations));
  line("residual", quantile_text(report.residual));
  if (is_apart(report)) line("islands apart", quantile_text(report.islands));
  line("ended", codes_text(report));
  line("flags", flags_text(report));
  if (report.solver == to_string(SolverKind::automatic) || report.options.choose == SolverChoice::spectrum)
    line("answered by", answered_text(report));
  line("unconverged", fmt::format("{}", report.unconverged));
  line("hash", fmt::format("{} (numerics epoch {})", hex(report.hash), kNumericsEpoch));
  return text;
}

std::string hex(std::uint64_t hash) {
  return fmt::format("{:016x}", hash);
}

Precision precision_from_option(const std::string& text) {
  for (const Precision precision : {Precision::f32, Precision::f64}) {
    if (text == to_string(precision)) return precision;
  }
  throw Error(ErrorCode::invalid_argument, fmt::format("--precision {}: expected f32 or f64", text));
}

std::string to_string(Device device) {
  if (device.kind == DeviceKind::cuda) return fmt::format("cuda:{}", device.ordinal);
  return device.kind == DeviceKind::cpu ? "cpu" : "emulated";
}

std::string quantile_text(const std::optional<Quantiles<double>>& values) {
  if (!values) return "-";
  return fmt::format("min {:.2e}  median {:.2e}  p90 {:.2e}  max {:.2e}", values->min, values->median, values->p90,
                     values->max);
}

std::string quantile_text(const std::optional<Quantiles<std::int32_t>>& values) {
  if (!values) return "-";
  return fmt::format("min {}  median {}  p90 {}  max {}", values->min, values->median, values->p90, values->max);
}

}  // namespace stiction::cli
