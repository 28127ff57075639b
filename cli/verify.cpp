#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <limits>

#include "cli/commands.hpp"
#include "cli/json_text.hpp"
#include "cli/load.hpp"
#include "cli/output.hpp"
#include "cli/report.hpp"
#include "stiction/error.hpp"
#include "stiction/residual.hpp"

namespace stiction::cli {

namespace {

struct Verdict {
  std::optional<Quantiles<double>> relative, absolute;
  Offset above = 0;               ///< environments whose relative residual is not within the tolerance
  std::int64_t worst = -1;        ///< environment of the largest relative residual, -1: no environments
  Residual contact{0, 0, 0, -1};  ///< residual of that environment
  std::string kind;               ///< of its worst contact
};

/// A residual that is not a number cannot be within any tolerance.
double readable(double residual) {
  return std::isnan(residual) ? std::numeric_limits<double>::infinity() : residual;
}

Verdict judge(const std::vector<Residual>& residuals, const VerifyArguments& arguments) {
  Verdict verdict;
  std::vector<double> relative, absolute;
  double largest = -1;
  for (std::size_t env = 0; env < residuals.size(); ++env) {
    relative.push_back(readable(residuals[env].relative));
    absolute.push_back(readable(residuals[env].absolute));
    if (relative.back() > arguments.tolerance && !(absolute.back() <= arguments.absolute_tolerance)) ++verdict.above;
    if (relative.back() > largest) {
      largest = relative.back();
      verdict.worst = static_cast<std::int64_t>(env);
      verdict.contact = residuals[env];
    }
  }
  verdict.relative = quantiles(std::move(relative));
  verdict.absolute = quantiles(std::move(absolute));
  return verdict;
}

void print_text(const VerifyArguments& arguments, const Verdict& verdict, std::size_t environments, Law law) {
  fmt::print("{:<16}{}\n{:<16}{}\n", "file", arguments.batch.string(), "solution", arguments.solution.string());
  fmt::print("{:<16}{}\n{:<16}{}\n", "law", to_string(law), "environments", environments);
  fmt::print("{:<16}{}\n", "residual", quantile_text(verdict.relative));
  fmt::print("{:<16}{}\n", "absolute", quantile_text(verdict.absolute));
  if (verdict.worst >= 0 && verdict.relative) {
    fmt::print("{:<16}environment {}: {:.3e}\n", "worst", verdict.worst, verdict.relative->max);
    if (verdict.contact.cone >= 0) {
      fmt::print("{:<16}cone {} ({}): error {:.3e} at an island's scale of {:.3e}, both in the unit of b\n", "contact",
                 verdict.contact.cone, verdict.kind, worst_error(verdict.contact), verdict.contact.scale);
    }
  }
  const std::string absolute =
      arguments.absolute_tolerance > 0 ? fmt::format(" or absolute {:g}", arguments.absolute_tolerance) : "";
  fmt::print("{:<16}{} (tolerance {:g}{})\n", "above tolerance", verdict.above, arguments.tolerance, absolute);
}

std::string json_text(const VerifyArguments& arguments, const Verdict& verdict, const ContactBatch<double>& batch) {
  const bool none = verdict.contact.cone < 0;
  return dump({{"schema_version", kReportSchemaVersion},
               {"file", arguments.batch.string()},
               {"solution", arguments.solution.string()},
               {"law", to_string(batch.law())},
               {"environments", batch.env_count()},
               {"rows", batch.row_count()},
               {"tolerance", arguments.tolerance},
               {"absolute_tolerance", arguments.absolute_tolerance},
               {"residual", json_of(verdict.relative)},
               {"residual_absolute", json_of(verdict.absolute)},
               {"above", verdict.above},
               {"worst_environment", verdict.worst < 0 ? Json(nullptr) : Json(verdict.worst)},
               {"worst_cone", none ? Json(nullptr) : Json(verdict.contact.cone)},
               {"worst_kind", none ? Json(nullptr) : Json(verdict.kind)},
               {"worst_error", none ? Json(nullptr) : Json(worst_error(verdict.contact))},
               {"worst_scale", none ? Json(nullptr) : Json(verdict.contact.scale)},
               {"epoch", kNumericsEpoch}});
}

}  // namespace

int run_verify(const VerifyArguments& arguments) {
  if (!(arguments.tolerance >= 0)) {
    throw Error(ErrorCode::invalid_argument,
                fmt::format("--tolerance {}: expected a number >= 0", arguments.tolerance));
  }
  if (!(arguments.absolute_tolerance >= 0)) {
    throw Error(ErrorCode::invalid_argument,
                fmt::format("--absolute-tolerance {}: expected a number >= 0", arguments.absolute_tolerance));
  }
  const LoadedBatch loaded = load_batch(arguments.batch, law_from_option(arguments.law), ValueDefects::keep);
  if (!loaded.defects.empty()) {
    fmt::print(stderr, "stiction: warning: {}: {}\n", arguments.batch.string(), describe(loaded.defects));
  }
  const ContactBatch<double>& batch = loaded.recording.batch;
  const io::SolutionFile solution = load_solution(arguments.solution, batch);
  if (!solution.solver.empty() && solution.law != batch.law()) {
    fmt::print(stderr, "stiction: warning: {} was solved with law {} and is judged by law {}; --law changes that\n",
               arguments.solution.string(), to_string(solution.law), to_string(batch.law()));
  }
  const std::vector<Residual> residuals = verify(batch.view(), std::span<const double>(solution.lambda));
  Verdict verdict = judge(residuals, arguments);
  if (verdict.contact.cone >= 0) {
    const auto view = batch.view();
    verdict.kind = to_string(view.cone_kind[view.env_cone_offsets[verdict.worst] + verdict.contact.cone]);
  }
  if (arguments.json) {
    write_text("-", json_text(arguments, verdict, batch));
  } else {
    print_text(arguments, verdict, residuals.size(), batch.law());
  }
  return verdict.above == 0 ? kExitDone : kExitMissed;
}

}  // namespace stiction::cli
