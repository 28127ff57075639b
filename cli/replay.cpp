#include <fmt/format.h>

#include <cstdio>

#include "cli/bits.hpp"
#include "cli/commands.hpp"
#include "cli/convert_values.hpp"
#include "cli/load.hpp"
#include "cli/report.hpp"
#include "stiction/config.hpp"
#include "stiction/error.hpp"
#include "stiction/hash.hpp"
#include "stiction/solver.hpp"

namespace stiction::cli {

namespace {

/// Environments whose first difference is printed.
constexpr Offset kShown = 10;

SolverOptions options_of(const io::RecordedSolve& recorded, int threads) {
  SolverOptions options;
  options.solver = recorded.solver;
  options.tolerance = recorded.tolerance;
  options.absolute_tolerance = recorded.absolute_tolerance;
  options.omega = recorded.omega;
  options.max_iterations = recorded.max_iterations;
  options.stall_window = recorded.stall_window;
  options.islands = recorded.islands;
  options.blocks = recorded.blocks;
  options.direct_rows = recorded.direct_rows;
  options.choose = recorded.choose;
  options.spectrum = recorded.spectrum;
  options.threads = threads;
  // A recording made for its broken numbers was isolated then too, or it would not have been solved.
  options.invalid = InvalidPolicy::isolate;
  return options;
}

const io::RecordedSolve& recorded_solve(const ReplayArguments& arguments, const io::Recording& recording) {
  if (!recording.solve)
    throw Error(ErrorCode::bad_file,
                fmt::format("{}: group 'solve' is missing: this file was not written by a recorder",
                            arguments.recording.string()));
  if (recording.solve->numerics_epoch != kNumericsEpoch)
    throw Error(
        ErrorCode::invalid_argument,
        fmt::format("{}: recorded in numerics epoch {}, this build is of epoch {}: bits are the same within one "
                    "epoch only",
                    arguments.recording.string(), recording.solve->numerics_epoch, kNumericsEpoch));
  if (recording.solve->form == io::RecordedForm::bodies)
    throw Error(
        ErrorCode::unsupported,
        fmt::format("{}: solved as bodies, of which the file holds J and M: their solvers are called by stiction "
                    "solve --form bodies",
                    arguments.recording.string()));
  return *recording.solve;
}

void print_difference(const io::Recording& recording, const io::RecordedSolve& recorded, Offset env,
                      const std::vector<double>& now, const char* ended) {
  const std::vector<double>& then = recorded.lambda;
  const auto& offsets = recording.batch.arrays().env_row_offsets;
  const auto first = static_cast<std::size_t>(offsets[static_cast<std::size_t>(env)]);
  std::size_t row = first;
  while (same_bits(then[row], now[row])) ++row;
  const auto index = static_cast<std::size_t>(env);
  fmt::print("environment {} ({}, solve {}): row {}: {} recorded, {} now, {}; ended {}\n", env,
             recording.env_name.empty() ? "no name" : recording.env_name[index],
             recording.step.empty() ? 0 : recording.step[index], row - first, then[row], now[row],
             ulps_text(then[row], now[row], recorded.precision), ended);
}

template <class Real>
Solution<Real> solve_again(const io::Recording& recording, const io::RecordedSolve& recorded,
                           const SolverOptions& options, Device device) {
  const std::vector<Real> warm_start = convert_values<Real>(recorded.warm_start);
  if (recorded.form == io::RecordedForm::matrix)
    return solve(convert<Real>(recording.batch), options, device, std::span<const Real>(warm_start));
  return solve(io::jacobian_batch<Real>(recording), options, device, std::span<const Real>(warm_start)).contact;
}

template <class Real>
int replay(const ReplayArguments& arguments, const io::Recording& recording, const io::RecordedSolve& recorded) {
  const Device device = Device::from_string(arguments.device);
  const std::vector<Real> then = convert_values<Real>(recorded.lambda);
  const Solution<Real> answer = solve_again<Real>(recording, recorded, options_of(recorded, arguments.threads), device);
  const auto& offsets = recording.batch.arrays().env_row_offsets;
  const auto part = [&](const std::vector<Real>& values, std::size_t env) {
    const auto begin = static_cast<std::size_t>(offsets[env]), end = static_cast<std::size_t>(offsets[env + 1]);
    return std::span<const Real>(values).subspan(begin, end - begin);
  };
  const std::vector<double> now(answer.lambda.begin(), answer.lambda.end());
  Offset different = 0;
  const Offset envs = recording.batch.env_count();
  for (Offset env = 0; env < envs; ++env) {
    const auto index = static_cast<std::size_t>(env);
    if (hash_bits(part(then, index)) == hash_bits(part(answer.lambda, index))) continue;
    if (different++ < kShown && !arguments.quiet)
      print_difference(recording, recorded, env, now, to_string(answer.status[index].code));
  }
  if (!arguments.quiet) {
    fmt::print("{}: {}, {}, {}, {}\n", arguments.recording.string(), to_string(recorded.solver),
               to_string(recording.batch.law()), to_string(recorded.precision), to_string(device));
    if (recorded.left_out > 0)
      fmt::print("{} more environments were not recorded for want of room\n", recorded.left_out);
    fmt::print("recorded {}  replayed {}\n", hex(hash_bits(std::span<const Real>(then))),
               hex(hash_bits(std::span<const Real>(answer.lambda))));
    fmt::print("{} of {} environments have the recorded bits\n", envs - different, envs);
  }
  return different == 0 ? kExitDone : kExitMissed;
}

}  // namespace

int run_replay(const ReplayArguments& arguments) {
  const io::Recording recording = load_batch(arguments.recording, std::nullopt, ValueDefects::keep).recording;
  const io::RecordedSolve& recorded = recorded_solve(arguments, recording);
  return recorded.precision == Precision::f32 ? replay<float>(arguments, recording, recorded)
                                              : replay<double>(arguments, recording, recorded);
}

}  // namespace stiction::cli
