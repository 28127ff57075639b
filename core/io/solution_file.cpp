#include <algorithm>

#include "core/base/fp_env.hpp"
#include "core/io/hdf5_out.hpp"
#include "core/io/readers.hpp"
#include "stiction/error.hpp"

namespace stiction::io {
namespace {

constexpr const char* kFormat = "contact-solution";

/// One member of every record, as an array.
template <class T, class Member>
std::vector<T> column(const std::vector<EnvStatus>& status, Member member) {
  std::vector<T> values;
  values.reserve(status.size());
  for (const EnvStatus& record : status) values.push_back(static_cast<T>(record.*member));
  return values;
}

/// Refuses a code that this library does not know.
void check_codes(const InputFile& file, const std::string& path, const std::vector<std::uint8_t>& codes, int count) {
  for (std::size_t env = 0; env < codes.size(); ++env) {
    if (codes[env] >= count) {
      file.refuse_dataset(path, "holds " + std::to_string(codes[env]) + " at position " + std::to_string(env) +
                                    ", the last code known is " + std::to_string(count - 1));
    }
  }
}

/// Refuses the number of a solver that this library does not know, or of none that answers.
void check_solvers(const InputFile& file, const std::vector<std::uint8_t>& solvers) {
  for (std::size_t env = 0; env < solvers.size(); ++env) {
    const auto solver = static_cast<SolverKind>(solvers[env]);
    const bool answers =
        solver < SolverKind::end || solver == SolverKind::velocity_newton || solver == SolverKind::multigrid;
    if (!answers)
      file.refuse_dataset("answered_by", "holds " + std::to_string(solvers[env]) + " at position " +
                                             std::to_string(env) + ", which is no solver that answers");
  }
}

std::vector<EnvStatus> read_status(const InputFile& file, std::size_t envs) {
  const auto codes = file.integers<std::uint8_t>("status", envs);
  check_codes(file, "status", codes, kEnvCodeCount);
  std::vector<EnvStatus> status(envs, EnvStatus{});
  for (std::size_t env = 0; env < envs; ++env) status[env].code = static_cast<EnvCode>(codes[env]);
  const auto fill = [&status](const auto& values, auto member) {
    using Member = std::remove_reference_t<decltype(status[0].*member)>;
    for (std::size_t env = 0; env < status.size(); ++env) status[env].*member = static_cast<Member>(values[env]);
  };
  if (file.has("flags")) fill(file.integers<std::uint32_t>("flags", envs), &EnvStatus::flags);
  if (file.has("iterations")) fill(file.integers<Index>("iterations", envs), &EnvStatus::iterations);
  if (file.has("residual")) fill(file.reals("residual", envs), &EnvStatus::residual);
  if (file.has("residual_absolute")) {
    fill(file.reals("residual_absolute", envs), &EnvStatus::residual_absolute);
  }
  if (file.has("answered_by")) {
    const auto solvers = file.integers<std::uint8_t>("answered_by", envs);
    check_solvers(file, solvers);
    fill(solvers, &EnvStatus::solver);
  }
  if (file.has("islands")) fill(file.integers<Index>("islands", envs), &EnvStatus::islands);
  return status;
}

/// An integer attribute that a part of a solution has, at least `least`.
std::int64_t shard_number(const InputFile& file, const std::string& name, std::int64_t least) {
  const auto value = file.integer_attribute(name);
  if (!value) file.refuse("attribute '" + name + "' is missing, 'shard_index' needs it");
  if (*value < least)
    file.refuse("attribute '" + name + "' is " + std::to_string(*value) + ", expected at least " +
                std::to_string(least));
  return *value;
}

/// Reads the whole to which a part of a solution belongs. Nothing in a file that holds all environments.
std::optional<SolutionShard> read_shard(const InputFile& file, const std::vector<Offset>& env_row_offsets) {
  if (!file.integer_attribute("shard_index")) return std::nullopt;
  if (env_row_offsets.empty()) file.refuse_dataset("env_row_ptr", "is missing, 'shard_index' needs it");
  SolutionShard shard;
  shard.index = shard_number(file, "shard_index", 0);
  shard.count = shard_number(file, "shard_count", 1);
  shard.first_environment = shard_number(file, "shard_first_environment", 0);
  shard.environment_count = shard_number(file, "shard_environments", 0);
  shard.input = file.text_attribute("shard_input").value_or("");
  shard.options = file.text_attribute("shard_options").value_or("");
  if (shard.index >= shard.count)
    file.refuse("attribute 'shard_index' is " + std::to_string(shard.index) + ", expected less than shard_count, " +
                std::to_string(shard.count));
  const auto held = static_cast<Offset>(env_row_offsets.size()) - 1;
  if (shard.first_environment > shard.environment_count || held > shard.environment_count - shard.first_environment)
    file.refuse("attribute 'shard_first_environment' is " + std::to_string(shard.first_environment) + ", and " +
                std::to_string(held) + " environments from there are not in " +
                std::to_string(shard.environment_count));
  return shard;
}

void write_shard(OutputFile& file, const SolutionShard& shard) {
  file.attribute("shard_index", shard.index);
  file.attribute("shard_count", shard.count);
  file.attribute("shard_first_environment", std::int64_t{shard.first_environment});
  file.attribute("shard_environments", std::int64_t{shard.environment_count});
  file.attribute("shard_input", shard.input);
  file.attribute("shard_options", shard.options);
}

}  // namespace

SolutionFile read_solution(const InputFile& file) {
  const auto format = file.text_attribute("format");
  if (format && *format != kFormat) {
    file.refuse("attribute 'format' is '" + *format + "', expected '" + kFormat + "' or none");
  }
  SolutionFile solution;
  solution.precision = file.is_single("lambda") ? Precision::f32 : Precision::f64;
  solution.lambda = file.reals("lambda");
  const std::size_t rows = solution.lambda.size();
  if (file.has("w")) solution.w = file.reals("w", rows);
  if (file.has("env_row_ptr")) {
    solution.env_row_offsets = file.integers<Offset>("env_row_ptr");
    check_offsets(file, "env_row_ptr", solution.env_row_offsets, rows);
  }
  if (file.has("status")) {
    if (solution.env_row_offsets.empty()) file.refuse_dataset("env_row_ptr", "is missing, 'status' needs it");
    solution.status = read_status(file, solution.env_row_offsets.size() - 1);
  }
  solution.law = read_law(file, Law::convex);
  solution.solver = file.text_attribute("solver").value_or("");
  solution.source = file.text_attribute("source").value_or("");
  solution.shard = read_shard(file, solution.env_row_offsets);
  return solution;
}

void write_solution(const std::filesystem::path& path, const SolutionFile& solution) {
  const ScopedFpEnv fp_env;
  require_length("write_solution: solution.w", solution.w.size(), solution.lambda.size());
  if (solution.shard && solution.env_row_offsets.empty())
    throw Error(ErrorCode::invalid_argument, "write_solution: solution.env_row_offsets is empty, shard needs it");
  if (!solution.status.empty()) {
    if (solution.env_row_offsets.empty()) {
      throw Error(ErrorCode::invalid_argument, "write_solution: solution.env_row_offsets is empty, status needs it");
    }
    require_length("write_solution: solution.status", solution.status.size(), solution.env_row_offsets.size() - 1);
  }
  if (!solution.env_row_offsets.empty() &&
      solution.env_row_offsets.back() != static_cast<Offset>(solution.lambda.size())) {
    throw Error(ErrorCode::invalid_argument, "write_solution: solution.env_row_offsets ends at " +
                                                 std::to_string(solution.env_row_offsets.back()) + ", expected " +
                                                 std::to_string(solution.lambda.size()) + ", the length of lambda");
  }

  OutputFile file(path);
  file.attribute("format", kFormat);
  file.attribute("version", std::int64_t{1});
  file.attribute("law", to_string(solution.law));
  file.attribute("solver", solution.solver);
  file.attribute("source", solution.source);
  file.attribute("numerics_epoch", std::int64_t{kNumericsEpoch});
  if (solution.shard) write_shard(file, *solution.shard);
  file.reals("lambda", solution.lambda, solution.precision);
  if (!solution.w.empty()) file.reals("w", solution.w, solution.precision);
  if (!solution.env_row_offsets.empty()) file.array("env_row_ptr", solution.env_row_offsets);
  const auto& status = solution.status;
  if (!status.empty()) {
    file.array("status", column<std::uint8_t>(status, &EnvStatus::code));
    file.array("flags", column<std::uint32_t>(status, &EnvStatus::flags));
    file.array("iterations", column<std::int32_t>(status, &EnvStatus::iterations));
    file.array("residual", column<double>(status, &EnvStatus::residual));
    file.array("residual_absolute", column<double>(status, &EnvStatus::residual_absolute));
    file.array("answered_by", column<std::uint8_t>(status, &EnvStatus::solver));
    const auto is_apart = [](const EnvStatus& one) { return one.islands != 0; };
    if (std::any_of(status.begin(), status.end(), is_apart))
      file.array("islands", column<std::int32_t>(status, &EnvStatus::islands));
  }
  file.commit();
}

}  // namespace stiction::io
