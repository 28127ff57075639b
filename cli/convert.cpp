#include <fmt/format.h>

#include <cstdio>

#include "cli/commands.hpp"
#include "cli/load.hpp"
#include "cli/output.hpp"
#include "stiction/error.hpp"
#include "stiction/io.hpp"

namespace stiction::cli {

namespace {

/// FCLIB names its files .hdf5, contact batches are .h5.
bool wants_fclib(const ConvertArguments& arguments) {
  if (arguments.to.empty()) return arguments.output.extension() == ".hdf5";
  if (arguments.to == "fclib" || arguments.to == "batch") return arguments.to == "fclib";
  throw Error(ErrorCode::invalid_argument, fmt::format("--to {}: expected fclib or batch", arguments.to));
}

}  // namespace

int run_convert(const ConvertArguments& arguments) {
  const bool to_fclib = wants_fclib(arguments);
  require_different(arguments.input, arguments.output);
  require_replaceable(arguments.output);
  // A number that breaks a precondition is carried over as it is; a structure that does cannot be read reliably.
  const io::Recording recording = load_batch(arguments.input, std::nullopt, ValueDefects::keep).recording;
  const Offset count = recording.batch.env_count();
  if (arguments.environment) require_environment(*arguments.environment, count);
  if (!to_fclib) {
    if (arguments.environment) {
      throw Error(ErrorCode::invalid_argument, "--env: a contact batch is written whole; --env is for --to fclib");
    }
    io::write_batch(arguments.output, recording);
    fmt::print("{}: contact batch of {} environments, {} rows\n", arguments.output.string(), count,
               recording.batch.row_count());
    return kExitDone;
  }
  if (!arguments.environment && count != 1) {
    throw Error(ErrorCode::invalid_argument,
                fmt::format("{}: an FCLIB file holds one problem and this file has {} environments; choose one with "
                            "--env",
                            arguments.input.string(), count));
  }
  const Offset env = arguments.environment.value_or(0);
  io::write_fclib_local(arguments.output, recording, env);
  fmt::print("{}: FCLIB local problem of environment {}\n", arguments.output.string(), env);
  return kExitDone;
}

}  // namespace stiction::cli
