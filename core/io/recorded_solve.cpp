#include "core/io/recorded_solve.hpp"

#include <string>
#include <utility>

#include "stiction/error.hpp"

namespace stiction::io {
namespace {

/// An integer that an Index holds.
Index read_index(const InputFile& file, const std::string& path) {
  return file.integers<Index>(path, 1).front();
}

SolverKind read_solver(const InputFile& file) {
  const std::string name = file.strings("solve/solver", 1).front();
  try {
    return solver_from_string(name);
  } catch (const Error& error) {
    file.refuse_dataset("solve/solver", std::string("names no solver: ") + error.what());
  }
}

/// Files written before there was a choice hold nothing, and so do those of the old mode.
template <class Mode>
Mode read_mode(const InputFile& file, const char* path, Mode before, Mode (*from_string)(const std::string&)) {
  if (!file.has(path)) return before;
  const std::string name = file.strings(path, 1).front();
  try {
    return from_string(name);
  } catch (const Error& error) {
    file.refuse_dataset(path, std::string("names no mode: ") + error.what());
  }
}

SolverChoice read_choice(const InputFile& file) {
  if (!file.has("solve/choose")) return SolverChoice::named;
  const std::string name = file.strings("solve/choose", 1).front();
  try {
    return solver_choice_from_string(name);
  } catch (const Error& error) {
    file.refuse_dataset("solve/choose", std::string("names no choice: ") + error.what());
  }
}

/// Thresholds and solvers of a choice by spectrum.
constexpr std::size_t kThresholds = 5, kClassSolvers = kSpectrumClasses;

SpectrumRules read_rules(const InputFile& file) {
  SpectrumRules rules;
  const std::vector<double> thresholds = file.reals("solve/spectrum", kThresholds);
  const std::vector<std::string> solvers = file.strings("solve/spectrum_solvers", kClassSolvers);
  rules.direct_condition = thresholds[1];
  rules.preconditioned_condition = thresholds[3];
  rules.sparse_density = thresholds[4];
  const auto count = [&](double value) {
    if (!(value >= 0 && value <= 2147483647.0) || value != static_cast<double>(static_cast<Index>(value)))
      file.refuse_dataset("solve/spectrum", "has " + std::to_string(value) + ", expected a count there");
    return static_cast<Index>(value);
  };
  rules.steps = count(thresholds[0]);
  rules.direct_rows = count(thresholds[2]);
  SolverKind* const to[] = {&rules.direct, &rules.preconditioned, &rules.decomposed, &rules.otherwise};
  for (std::size_t k = 0; k < kClassSolvers; ++k) try {
      *to[k] = solver_from_string(solvers[k]);
    } catch (const Error& error) {
      file.refuse_dataset("solve/spectrum_solvers", std::string("names no solver: ") + error.what());
    }
  return rules;
}

constexpr std::pair<RecordedForm, const char*> kForms[] = {{RecordedForm::jacobian, "jacobian"},
                                                           {RecordedForm::bodies, "bodies"}};

/// Files of matrices hold nothing.
RecordedForm read_form(const InputFile& file) {
  if (!file.has("solve/form")) return RecordedForm::matrix;
  const std::string name = file.strings("solve/form", 1).front();
  for (const auto& [form, known] : kForms)
    if (name == known) return form;
  file.refuse_dataset("solve/form", "names no form: expected jacobian or bodies, got " + name);
}

}  // namespace

std::optional<RecordedSolve> read_recorded_solve(const InputFile& file, std::size_t rows) {
  if (!file.has("solve")) return std::nullopt;
  RecordedSolve solve;
  solve.solver = read_solver(file);
  solve.islands = read_mode(file, "solve/islands", IslandMode::together, island_mode_from_string);
  solve.blocks = read_mode(file, "solve/blocks", BlockMode::cones, block_mode_from_string);
  solve.form = read_form(file);
  solve.lambda = file.reals("solve/lambda", rows);
  solve.precision = file.is_single("solve/lambda") ? Precision::f32 : Precision::f64;
  if (file.has("solve/warm_start")) solve.warm_start = file.reals("solve/warm_start", rows);
  solve.tolerance = file.reals("solve/tolerance", 1).front();
  if (file.has("solve/absolute_tolerance"))
    solve.absolute_tolerance = file.reals("solve/absolute_tolerance", 1).front();
  solve.omega = file.reals("solve/omega", 1).front();
  solve.max_iterations = read_index(file, "solve/max_iterations");
  solve.stall_window = read_index(file, "solve/stall_window");
  if (file.has("solve/direct_rows")) solve.direct_rows = read_index(file, "solve/direct_rows");
  solve.choose = read_choice(file);
  if (solve.choose == SolverChoice::spectrum) solve.spectrum = read_rules(file);
  solve.numerics_epoch = read_index(file, "solve/numerics_epoch");
  solve.left_out = file.integers<std::int64_t>("solve/left_out", 1).front();
  return solve;
}

void check_recorded_solve(const RecordedSolve& solve, std::size_t rows) {
  for (const auto& [name, values] : {std::pair("lambda", &solve.lambda), std::pair("warm_start", &solve.warm_start)}) {
    const bool may_be_empty = values == &solve.warm_start;
    if (values->size() == rows || (may_be_empty && values->empty())) continue;
    throw Error(ErrorCode::invalid_argument, std::string("write_batch: recording.solve.") + name + " has " +
                                                 std::to_string(values->size()) + " elements, expected " +
                                                 std::to_string(rows) + (may_be_empty ? " or none" : ""));
  }
}

void write_recorded_solve(OutputFile& file, const RecordedSolve& solve) {
  file.group("solve");
  file.strings("solve/solver", {to_string(solve.solver)});
  if (solve.islands != IslandMode::together) file.strings("solve/islands", {to_string(solve.islands)});
  if (solve.blocks != BlockMode::cones) file.strings("solve/blocks", {to_string(solve.blocks)});
  for (const auto& [form, name] : kForms)
    if (solve.form == form) file.strings("solve/form", {name});
  file.reals("solve/lambda", solve.lambda, solve.precision);
  if (!solve.warm_start.empty()) file.reals("solve/warm_start", solve.warm_start, solve.precision);
  const auto number = [&](const char* path, auto value) {
    file.array(path, std::span<const decltype(value)>(&value, 1));
  };
  number("solve/tolerance", solve.tolerance);
  if (solve.absolute_tolerance != 0) number("solve/absolute_tolerance", solve.absolute_tolerance);
  number("solve/omega", solve.omega);
  number("solve/max_iterations", std::int32_t{solve.max_iterations});
  number("solve/stall_window", std::int32_t{solve.stall_window});
  if (solve.direct_rows != RecordedSolve{}.direct_rows) number("solve/direct_rows", std::int32_t{solve.direct_rows});
  if (solve.choose == SolverChoice::spectrum) {
    const SpectrumRules& rules = solve.spectrum;
    const double thresholds[kThresholds] = {static_cast<double>(rules.steps), rules.direct_condition,
                                            static_cast<double>(rules.direct_rows), rules.preconditioned_condition,
                                            rules.sparse_density};
    file.strings("solve/choose", {to_string(solve.choose)});
    file.array("solve/spectrum", std::span<const double>(thresholds));
    file.strings("solve/spectrum_solvers", {to_string(rules.direct), to_string(rules.preconditioned),
                                            to_string(rules.decomposed), to_string(rules.otherwise)});
  }
  number("solve/numerics_epoch", std::int32_t{solve.numerics_epoch});
  number("solve/left_out", std::int64_t{solve.left_out});
}

}  // namespace stiction::io
