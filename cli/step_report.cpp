#include "cli/step_report.hpp"

#include <fmt/format.h>

#include <vector>

#include "cli/body_method.hpp"
#include "cli/commands.hpp"
#include "cli/json_text.hpp"
#include "cli/report.hpp"
#include "cli/thread_use.hpp"

namespace stiction::cli {

double StepReport::rate() const {
  return wall > 0 ? static_cast<double>(environments) * static_cast<double>(steps - resumed_at) / wall : 0;
}
double StepReport::solver_share() const {
  return wall > 0 ? seconds.solve / wall : 0;
}
double StepReport::utilisation() const {
  return wall > 0 && threads > 0 ? cpu / (wall * threads) : 0;
}

Json json_of(const StepReport& report) {
  Json codes = Json::object();
  for (std::size_t code = 0; code < report.codes.size(); ++code)
    codes[to_string(static_cast<EnvCode>(code))] = report.codes[code];
  Json json = {
      {"schema_version", kReportSchemaVersion},
      {"scene", report.scene},
      {"device", report.device},
      {"solver", report.solver},
      {"law", report.law},
      {"precision", to_string(report.precision)},
      {"environments", report.environments},
      {"steps", report.steps},
      {"resumed_at", report.resumed_at},
      {"bodies", report.bodies},
      {"seed", report.seed},
      {"dt", report.dt},
      {"iterations", report.iterations},
      {"tolerance", report.tolerance},
      {"threads", report.threads},
      {"seconds",
       {{"wall", report.wall},
        {"cpu", report.cpu},
        {"detect", report.seconds.detect},
        {"plan", report.seconds.plan},
        {"solve", report.seconds.solve},
        {"integrate", report.seconds.integrate}}},
      {"thread_use", json_of(report.thread_use)},
      {"sps", report.rate()},
      {"quality", report.quality},
      {"effective_sps", report.rate() * report.quality},
      {"solver_share", report.solver_share()},
      {"utilisation", report.utilisation()},
      {"gpu_utilisation", json_of(report.gpu)},
      {"gpu_utilisation_reason", report.gpu.reason},
      {"contacts", report.contacts},
      {"residual", json_of(report.residual)},
      {"ended", codes},
      {"overflows", report.overflows},
      {"energy", {{"begin", report.energy_begin}, {"end", report.energy_end}, {"largest_rise", report.largest_rise}}},
      {"momentum_drift", report.momentum_drift},
      {"deepest", report.deepest},
      {"hash", hex(report.hash)},
      {"epoch", kNumericsEpoch}};
  if (!report.preconditioner.empty()) json["preconditioner"] = report.preconditioner;
  if (report.blocks != StepArguments{}.blocks) json["blocks"] = report.blocks;
  return json;
}

std::string to_json(const StepReport& report) {
  return dump(json_of(report));
}

int exit_status(const StepReport& report) {
  const auto broken = report.codes[static_cast<std::size_t>(EnvCode::numerical)] +
                      report.codes[static_cast<std::size_t>(EnvCode::invalid_input)];
  return broken == 0 ? kExitDone : kExitMissed;
}

std::string to_text(const StepReport& report) {
  std::string text;
  const auto line = [&](const char* name, const std::string& value) { text += fmt::format("{:<16}{}\n", name, value); };
  const double env_steps =
      static_cast<double>(report.environments) * static_cast<double>(report.steps - report.resumed_at);
  line("scene", fmt::format("{}, {} bodies, seed {}", report.scene, report.bodies, report.seed));
  line("environments", fmt::format("{}", report.environments));
  line("steps", fmt::format("{} of {:g} s{}", report.steps, report.dt,
                            report.resumed_at > 0 ? fmt::format(", from {} on", report.resumed_at) : ""));
  line("solver",
       fmt::format("{}, at most {} {}, tolerance {:g}",
                   report.preconditioner.empty() ? report.solver : report.solver + " with " + report.preconditioner,
                   report.iterations, is_sweeping(report.solver) ? "sweeps" : "steps", report.tolerance));
  line("law", report.law);
  if (report.blocks != StepArguments{}.blocks) line("blocks", report.blocks);
  line("device", fmt::format("{} ({})", report.device, report.device_name));
  line("precision", to_string(report.precision));
  line("threads", fmt::format("{}", report.threads));
  line("thread use", thread_use_text(report.thread_use));
  line("seconds",
       fmt::format("{:.4g}: detect {:.4g}  plan {:.4g}  solve {:.4g}  integrate {:.4g}", report.wall,
                   report.seconds.detect, report.seconds.plan, report.seconds.solve, report.seconds.integrate));
  line("SPS", fmt::format("{:.4g} environment-steps/s", report.rate()));
  line("effective SPS", fmt::format("{:.4g} (quality {:.4f})", report.rate() * report.quality, report.quality));
  line("solver share", fmt::format("{:.1f} %", 100 * report.solver_share()));
  line("utilisation", fmt::format("{:.1f} % of the threads' time", 100 * report.utilisation()));
  line("GPU utilisation", gpu_use_text(report.gpu));
  line("contacts", fmt::format("{:.4g} per environment-step",
                               env_steps > 0 ? static_cast<double>(report.contacts) / env_steps : 0));
  line("penetration", fmt::format("at most {:.3g} m", report.deepest));
  line("residual", quantile_text(report.residual));
  std::vector<std::string> ended;
  for (std::size_t code = 0; code < report.codes.size(); ++code)
    if (report.codes[code] != 0)
      ended.push_back(fmt::format("{} {}", report.codes[code], to_string(static_cast<EnvCode>(code))));
  line("ended", ended.empty() ? "-" : fmt::format("{}", fmt::join(ended, ", ")));
  line("overflows", fmt::format("{}", report.overflows));
  line("energy", fmt::format("{:.6g} J -> {:.6g} J on average, largest rise in a step {:.3g} J", report.energy_begin,
                             report.energy_end, report.largest_rise));
  line("momentum", fmt::format("at most {:.3g} N s a step unaccounted for", report.momentum_drift));
  line("hash", fmt::format("{} (numerics epoch {})", hex(report.hash), kNumericsEpoch));
  return text;
}

}  // namespace stiction::cli
