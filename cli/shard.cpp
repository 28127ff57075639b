#include "cli/shard.hpp"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <fstream>
#include <numeric>

#include "stiction/error.hpp"
#include "stiction/hash.hpp"

namespace stiction::cli {

namespace {

/// A number without sign, or nothing.
std::optional<std::int32_t> number(std::string_view text) {
  std::int32_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || value < 0) return std::nullopt;
  return value;
}

/// environments * index / count. The product of both remainders fits, because count is a number of 32 bits.
Offset first_of(std::int64_t index, std::int64_t count, Offset environments) {
  return environments / count * index + environments % count * index / count;
}

}  // namespace

std::optional<io::SolutionShard> shard_from_option(const std::optional<std::string>& text) {
  if (!text) return std::nullopt;
  const std::size_t slash = text->find('/');
  std::optional<std::int32_t> index, count;
  if (slash != std::string::npos) {
    index = number(std::string_view(*text).substr(0, slash));
    count = number(std::string_view(*text).substr(slash + 1));
  }
  if (!index || !count || *count == 0)
    throw Error(ErrorCode::invalid_argument,
                fmt::format("--shard {}: expected I/N, part I of N with I from 0, such as 0/4", *text));
  if (*index >= *count)
    throw Error(ErrorCode::invalid_argument, fmt::format("--shard {}: the parts are numbered from 0, 0/{} to {}/{}",
                                                         *text, *count, *count - 1, *count));
  io::SolutionShard shard;
  shard.index = *index;
  shard.count = *count;
  return shard;
}

namespace {

std::vector<Offset> environments_of(std::int64_t index, std::int64_t count, Offset environments) {
  const Offset first = first_of(index, count, environments);
  std::vector<Offset> numbers(static_cast<std::size_t>(first_of(index + 1, count, environments) - first));
  std::iota(numbers.begin(), numbers.end(), first);
  return numbers;
}

/// Hash of a file's bytes (FNV-1a), 16 digits. \throws Error(io) if it cannot be read.
std::string file_hash(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::uint64_t hash = 0xcbf29ce484222325ULL;
  std::vector<char> buffer(std::size_t{1} << 20);
  while (file) {
    file.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
    for (std::streamsize i = 0; i < file.gcount(); ++i)
      hash = (hash ^ static_cast<unsigned char>(buffer[static_cast<std::size_t>(i)])) * 0x100000001b3ULL;
  }
  if (!file.eof()) throw Error(ErrorCode::io, fmt::format("{}: cannot be read", path.string()));
  return hex(hash);
}

/// Whatever reaches the bits of a solve. Device, threads and order of solving are left out, since they reach none.
std::string options_text(const SolveArguments& arguments, const SolveReport& report,
                         const std::vector<double>& warm_start) {
  const SolverOptions& options = report.options;
  const auto yes = [](bool value) { return value ? "yes" : "no"; };
  return fmt::format(
      "epoch={} solver={} preconditioner={} precision={} law={} form={} islands={} tolerance={} absolute_tolerance={} "
      "max_iterations={} omega={} direct_rows={} pyramid={} isolate={} warm_start={}{}",
      kNumericsEpoch, report.solver, report.preconditioner.empty() ? "none" : report.preconditioner,
      to_string(report.precision), to_string(report.law), report.form, to_string(options.islands), options.tolerance,
      options.absolute_tolerance, options.max_iterations, options.omega, options.direct_rows, report.pyramid,
      yes(arguments.isolate), warm_start.empty() ? "none" : hex(hash_bits(std::span<const double>(warm_start))),
      options.blocks == BlockMode::cones ? "" : fmt::format(" blocks={}", to_string(options.blocks)));
}

}  // namespace

std::vector<Offset> describe_shard(const SolveArguments& arguments, const std::vector<double>& warm_start,
                                   Offset environments, const SolveReport& report, io::SolutionShard& shard) {
  std::vector<Offset> own = environments_of(shard.index, shard.count, environments);
  shard.first_environment = first_of(shard.index, shard.count, environments);
  shard.environment_count = environments;
  shard.input = file_hash(arguments.batch);
  shard.options = options_text(arguments, report, warm_start);
  return own;
}

}  // namespace stiction::cli
