#include "cli/inspect_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>

#include "cli/commands.hpp"
#include "cli/json_text.hpp"
#include "cli/load.hpp"

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
    if (features.box_friction[rows] != 0)
      text += fmt::format(", {} box_friction of {} rows", features.box_friction[rows], rows);
    if (features.semidefinite[rows] != 0)
      text += fmt::format(", {} semidefinite of {} rows", features.semidefinite[rows], rows);
  }
  return text;
}

/// One number of every environment analysed in which it was determined.
template <class Number>
std::vector<double> determined(const Features& features, const Number& number) {
  std::vector<double> values;
  for (const OperatorAnalysis& seen : features.operators) {
    const double value = number(seen);
    if (!std::isnan(value)) values.push_back(value);
  }
  return values;
}

struct OperatorNumber {
  const char *label, *key;
  double (*of)(const OperatorAnalysis& seen);
};

double deficiency(const OperatorAnalysis& seen) {
  return seen.rank < 0 ? OperatorAnalysis::kNone : static_cast<double>(seen.rows - seen.rank);
}

constexpr OperatorNumber kOperatorNumbers[] = {
    {"largest value", "largest_singular_value", [](const OperatorAnalysis& seen) { return seen.largest; }},
    {"smallest value", "smallest_singular_value", [](const OperatorAnalysis& seen) { return seen.smallest; }},
    {"rank missing", "rank_deficiency", deficiency},
    {"range condition", "range_condition", [](const OperatorAnalysis& seen) { return seen.range_condition(); }},
    {"normal spread", "normal_spread", [](const OperatorAnalysis& seen) { return seen.normal_spread; }},
};

template <class Test>
std::ptrdiff_t count(const Features& features, const Test& test) {
  return std::count_if(features.operators.begin(), features.operators.end(), test);
}

std::ptrdiff_t count(const Features& features, Definiteness definiteness) {
  return count(features, [&](const OperatorAnalysis& seen) { return seen.definiteness == definiteness; });
}

/// Counts of environments with a condition number, of those to kSettledError, and of those without an inverse.
struct ConditionCounts {
  std::ptrdiff_t estimated, settled, singular;
};

ConditionCounts condition_counts(const Features& features) {
  return {count(features, [](const OperatorAnalysis& seen) { return seen.rank >= 0; }),
          count(features,
                [](const OperatorAnalysis& seen) {
                  return seen.largest_error <= kSettledError && seen.smallest_error <= kSettledError;
                }),
          count(features, [](const OperatorAnalysis& seen) { return seen.rank >= 0 && seen.rank < seen.rows; })};
}

std::vector<double> conditions(const Features& features) {
  return determined(features, [](const OperatorAnalysis& seen) { return seen.condition(); });
}

std::string condition_text(const Features& features) {
  const ConditionCounts counts = condition_counts(features);
  std::string text = fmt::format("{} (estimate, {} environments; {} settled, {} singular",
                                 spread_text(conditions(features)), counts.estimated, counts.settled, counts.singular);
  const auto large = static_cast<std::ptrdiff_t>(features.operators.size()) - counts.estimated;
  return text + (large != 0 ? fmt::format("; not estimated in {} large ones)", large) : ")");
}

std::string definiteness_text(const Features& features) {
  return fmt::format("{} positive definite, {} positive semidefinite, {} indefinite, {} not tested",
                     count(features, Definiteness::positive_definite),
                     count(features, Definiteness::positive_semidefinite), count(features, Definiteness::indefinite),
                     count(features, Definiteness::unknown));
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
  const auto indefinite = count(features, Definiteness::indefinite);
  if (indefinite != 0) {
    texts.push_back(
        fmt::format("{} of {} environments looked at have an eigenvalue below zero by more than rounding: "
                    "there the convex law need not have a minimiser",
                    indefinite, features.operators.size()));
  }
  return texts;
}

std::string to_json(const InspectReport& report) {
  const Features& features = report.features;
  Json cones = totals(features.cones);
  cones["free"] = features.free;
  cones["unilateral"] = features.unilateral;
  cones["box"] = features.box;
  cones["friction"] = cones["box_friction"] = cones["semidefinite"] = Json::object();
  for (std::size_t rows = 2; rows < features.friction.size(); ++rows) {
    cones["friction"][std::to_string(rows)] = features.friction[rows];
    cones["box_friction"][std::to_string(rows)] = features.box_friction[rows];
    if (is_cone(ConeKind::semidefinite, static_cast<Offset>(rows)))
      cones["semidefinite"][std::to_string(rows)] = features.semidefinite[rows];
  }
  const ConditionCounts counts = condition_counts(features);
  Json condition = spread(conditions(features));
  condition["environments"] = counts.estimated;
  condition["settled"] = counts.settled;
  condition["singular"] = counts.singular;
  Json operators = {{"environments", features.operators.size()},
                    {"positive_definite", count(features, Definiteness::positive_definite)},
                    {"positive_semidefinite", count(features, Definiteness::positive_semidefinite)},
                    {"indefinite", count(features, Definiteness::indefinite)},
                    {"not_tested", count(features, Definiteness::unknown)}};
  for (const OperatorNumber& number : kOperatorNumbers) operators[number.key] = spread(determined(features, number.of));
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
               {"operators", operators},
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
  line("definiteness", definiteness_text(features));
  line("condition", condition_text(features));
  for (const OperatorNumber& number : kOperatorNumbers)
    line(number.label, spread_text(determined(features, number.of)));
  line("stored beside", fmt::format("{}, {}", report.has_jacobian ? "J and M" : "no J and M",
                                    report.has_reference ? "a reference solution" : "no reference solution"));
  if (report.graph_environment) line("drawn", fmt::format("environment {}", *report.graph_environment));
  for (const std::string& warning : report.warnings) line("warning", warning);
  return text;
}

}  // namespace stiction::cli
