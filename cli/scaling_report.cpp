#include "cli/scaling_report.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "cli/commands.hpp"
#include "cli/report.hpp"
#include "cli/thread_use.hpp"

namespace stiction::cli {

namespace {

constexpr char kRow[] = "{:>7}  {:>12}  {:>10}  {:>8}  {:>10}  {:>7}  {:>15}  {:>9}  {}\n";

Json number_or_null(const std::optional<double>& value) {
  return value ? Json(*value) : Json(nullptr);
}

Json points_of(const ScalingSeries& series) {
  Json points = Json::array();
  for (const ScalingPoint& point : series.points)
    points.push_back({{"threads", point.threads},
                      {"environments", point.environments},
                      {"seconds", point.seconds},
                      {"speedup", number_or_null(series.speedup(point))},
                      {"efficiency", number_or_null(series.efficiency(point))},
                      {"serial_share", number_or_null(serial_share(point))},
                      {"thread_use", json_of(point.use)},
                      {"hash", hex(point.hash)}});
  return points;
}

std::string number(const std::optional<double>& value) {
  return value ? fmt::format("{:.3f}", *value) : "-";
}

std::string percent(const std::optional<double>& share) {
  return share ? fmt::format("{:.1f} %", 100 * *share) : "-";
}

std::string table_of(const ScalingSeries& series) {
  std::string text = fmt::format(kRow, "threads", "environments", "seconds", "speed-up", "efficiency", "serial",
                                 "synchronisation", "imbalance", "hash");
  for (const ScalingPoint& point : series.points)
    text += fmt::format(kRow, point.threads, point.environments, fmt::format("{:.4g}", point.seconds),
                        number(series.speedup(point)), number(series.efficiency(point)), percent(serial_share(point)),
                        percent(point.use.synchronisation_share()), number(point.use.imbalance()), hex(point.hash));
  return text;
}

}  // namespace

std::optional<double> ScalingSeries::speedup(const ScalingPoint& point) const {
  const ScalingPoint& first = points.front();
  if (first.environments == 0 || first.seconds <= 0 || point.seconds <= 0) return std::nullopt;
  const double work = static_cast<double>(point.environments) / static_cast<double>(first.environments);
  return work * first.seconds / point.seconds;
}

std::optional<double> ScalingSeries::efficiency(const ScalingPoint& point) const {
  const std::optional<double> gain = speedup(point);
  if (!gain) return std::nullopt;
  return *gain * points.front().threads / point.threads;
}

std::optional<double> serial_share(const ScalingPoint& point) {
  if (point.seconds <= 0) return std::nullopt;
  return 1 - point.use.seconds / point.seconds;
}

bool ScalingReport::bits_agree() const {
  const auto agree = [&](const ScalingSeries& series) {
    return std::all_of(series.points.begin(), series.points.end(),
                       [&](const ScalingPoint& point) { return point.hash == strong.points.front().hash; });
  };
  return agree(strong) && (!weak || agree(*weak));
}

std::string to_json(const ScalingReport& report) {
  Json json = {{"schema_version", kReportSchemaVersion},
               {report.is_scene ? "scene" : "file", report.target},
               {"device", to_string(Device::cpu())},
               {"solver", report.solver},
               {"precision", to_string(report.precision)}};
  if (report.is_scene) json["steps"] = report.steps;
  json["cores"] = report.cores;
  json["repeat"] = report.repeat;
  json["strong"] = points_of(report.strong);
  if (report.weak) json["weak"] = points_of(*report.weak);
  json["bits_agree"] = report.bits_agree();
  json["hash"] = hex(report.strong.points.front().hash);
  json["epoch"] = kNumericsEpoch;
  return dump(json);
}

std::string to_text(const ScalingReport& report) {
  std::string text;
  const auto line = [&](const char* name, const std::string& value) { text += fmt::format("{:<16}{}\n", name, value); };
  line(report.is_scene ? "scene" : "file",
       report.is_scene ? fmt::format("{}, {} steps", report.target, report.steps) : report.target);
  line("solver", report.solver);
  line("precision", to_string(report.precision));
  line("cores", fmt::format("{}", report.cores));
  line("repeat", fmt::format("{}, the shortest counts", report.repeat));
  text += "\nStrong scaling: the same environments on more threads\n" + table_of(report.strong);
  if (report.weak) text += "\nWeak scaling: environments grow with the threads\n" + table_of(*report.weak);
  text += "\n";
  line("bits", report.bits_agree() ? "equal for every number of threads" : "DIFFER between numbers of threads");
  return text;
}

}  // namespace stiction::cli
