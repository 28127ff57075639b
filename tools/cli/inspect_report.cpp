#include "tools/cli/inspect_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "tools/cli/commands.hpp"
#include "tools/cli/json_text.hpp"
#include "tools/cli/load.hpp"

namespace stiction::cli {

namespace {

const char* name(io::FileKind kind) {
  switch (kind) {
    case io::FileKind::contact_batch:
      return "contact-batch";
    case io::FileKind::fclib_local:
      return "fclib local";
    case io::FileKind::fclib_global:
      return "fclib global";
    case io::FileKind::fclib_rolling:
      return "fclib rolling";
  }
  return "?";
}

template <class T>
Json spread(const std::vector<T>& values) {
  const auto q = quantiles(values);
  if (!q) return {{"min", nullptr}, {"median", nullptr}, {"max", nullptr}};
  return {{"min", q->min}, {"median", q->median}, {"max", q->max}};
}

Json totals(const std::vector<Offset>& values) {
  Json json = {{"total", std::accumulate(values.begin(), values.end(), Offset{0})}};
  json.update(spread(values));
  return json;
}

Json json_of(const std::optional<Range>& range) {
  if (!range) return {{"min", nullptr}, {"max", nullptr}};
  return {{"min", range->min}, {"max", range->max}};
}

std::string text_of(const std::optional<Range>& range) {
  return range ? fmt::format("{:.4g} to {:.4g}", range->min, range->max) : "-";
}

template <class T>
std::string spread_text(const std::vector<T>& values) {
  const auto q = quantiles(values);
  return q ? fmt::format("min {:.4g}  median {:.4g}  max {:.4g}", static_cast<double>(q->min),
                         static_cast<double>(q->median), static_cast<double>(q->max))
           : "-";
}

std::string totals_text(const std::vector<Offset>& values) {
  const auto q = quantiles(values);
  if (!q) return "0";
  return fmt::format("{} (min {}  median {}  max {})", std::accumulate(values.begin(), values.end(), Offset{0}), q->min,
                     q->median, q->max);
}

Offset path_count(const Features& features, EnvPath path) {
  return features.paths[static_cast<std::size_t>(path)];
}

std::string cones_text(const Features& features) {
  std::string text = fmt::format("{} free, {} unilateral, {} box", features.free, features.unilateral, features.box);
  for (std::size_t rows = 2; rows < features.friction.size(); ++rows) {
    if (features.friction[rows] != 0) text += fmt::format(", {} friction of {} rows", features.friction[rows], rows);
  }
  return text;
}

std::string condition_text(const Features& features) {
  if (features.condition.empty()) return "-";
  std::string text = spread_text(features.condition);
  text += fmt::format(" (estimate, {} environments", features.condition.size());
  const auto bounded = static_cast<Offset>(features.condition.size()) - features.condition_complete;
  if (bounded != 0) text += fmt::format("; from below in {} large ones", bounded);
  return text + fmt::format("; {} singular, {} indefinite)", features.singular, features.indefinite);
}

}  // namespace

std::vector<std::string> warnings(const Features& features, const std::vector<Defect>& defects) {
  // A reader wants the kinds of trouble; the full list is a matter for a debugger.
  constexpr std::size_t kShown = 20;
  std::vector<std::string> texts;
  for (const Defect& defect : defects) {
    if (texts.size() == kShown) break;
    texts.push_back(defect.message);
  }
  if (defects.size() > kShown) {
    const bool more = defects.size() > kDefectLimit;
    texts.push_back(fmt::format("{}{} more broken preconditions", defects.size() - kShown, more ? " or" : ""));
  }
  const auto asymmetric =
      std::count_if(features.asymmetry.begin(), features.asymmetry.end(), [](double a) { return a > 1e-2; });
  if (asymmetric != 0) {
    texts.push_back(
        fmt::format("{} environments have an A that differs from its transpose by more than 1e-2 of its "
                    "largest entry; solvers for symmetric systems refuse those",
                    asymmetric));
  }
  if (features.indefinite != 0) {
    texts.push_back(
        fmt::format("{} of {} environments looked at have an eigenvalue below zero by more than rounding: "
                    "there the convex law need not have a minimiser",
                    features.indefinite, features.condition.size()));
  }
  return texts;
}

std::string to_json(const InspectReport& report) {
  const Features& features = report.features;
  Json cones = totals(features.cones);
  cones["free"] = features.free;
  cones["unilateral"] = features.unilateral;
  cones["box"] = features.box;
  cones["friction"] = Json::object();
  for (std::size_t rows = 2; rows < features.friction.size(); ++rows) {
    cones["friction"][std::to_string(rows)] = features.friction[rows];
  }
  Json condition = spread(features.condition);
  condition["environments"] = features.condition.size();
  condition["complete"] = features.condition_complete;
  condition["singular"] = features.singular;
  condition["indefinite"] = features.indefinite;
  return dump({{"schema_version", kReportSchemaVersion},
               {"file", report.file},
               {"format", name(report.kind)},
               {"source", report.source},
               {"law", to_string(report.law)},
               {"environment", report.environment ? Json(*report.environment) : Json(nullptr)},
               {"graph_environment", report.graph_environment ? Json(*report.graph_environment) : Json(nullptr)},
               {"environments", features.rows.size()},
               {"rows", totals(features.rows)},
               {"cones", cones},
               {"nonzeros", totals(features.nonzeros)},
               {"density", spread(features.density)},
               {"paths",
                {{"empty", path_count(features, EnvPath::empty)},
                 {"dense", path_count(features, EnvPath::dense)},
                 {"sparse", path_count(features, EnvPath::sparse)}}},
               {"vertices", spread(features.vertices)},
               {"colors", spread(features.colors)},
               {"islands", spread(features.islands)},
               {"asymmetry", spread(features.asymmetry)},
               {"friction", json_of(features.friction_coefficient)},
               {"compliance", json_of(features.compliance)},
               {"condition_estimate", condition},
               {"has_jacobian", report.has_jacobian},
               {"has_reference", report.has_reference},
               {"warnings", report.warnings}});
}

std::string to_text(const InspectReport& report) {
  const Features& features = report.features;
  std::string text;
  const auto line = [&](const char* label, const std::string& value) {
    text += fmt::format("{:<16}{}\n", label, value);
  };
  line("file", fmt::format("{} ({})", report.file, name(report.kind)));
  if (!report.source.empty()) line("source", report.source);
  line("law", to_string(report.law));
  if (report.environment) line("only", fmt::format("environment {}", *report.environment));
  line("environments", fmt::format("{}", features.rows.size()));
  line("rows", totals_text(features.rows));
  line("cones", totals_text(features.cones));
  line("", cones_text(features));
  line("nonzeros", totals_text(features.nonzeros));
  line("density", spread_text(features.density));
  line("paths", fmt::format("{} dense, {} sparse, {} empty", path_count(features, EnvPath::dense),
                            path_count(features, EnvPath::sparse), path_count(features, EnvPath::empty)));
  line("vertices", spread_text(features.vertices) + (features.vertices.empty() ? "" : " (sparse environments)"));
  line("colours", spread_text(features.colors) + (features.colors.empty() ? "" : " (sparse environments)"));
  line("islands", spread_text(features.islands));
  line("asymmetry", spread_text(features.asymmetry));
  line("friction", text_of(features.friction_coefficient));
  line("compliance", text_of(features.compliance));
  line("condition", condition_text(features));
  line("stored beside", fmt::format("{}, {}", report.has_jacobian ? "J and M" : "no J and M",
                                    report.has_reference ? "a reference solution" : "no reference solution"));
  if (report.graph_environment) line("drawn", fmt::format("environment {}", *report.graph_environment));
  for (const std::string& warning : report.warnings) line("warning", warning);
  return text;
}

}  // namespace stiction::cli
