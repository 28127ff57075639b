#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <string_view>
#include <utility>

#include "cli/commands.hpp"
#include "cli/hash_rows.hpp"
#include "cli/output.hpp"
#include "cli/report.hpp"
#include "stiction/error.hpp"
#include "stiction/io.hpp"

namespace stiction::cli {

namespace {

struct Part {
  std::string name;
  io::SolutionFile file;
  io::SolutionShard shard;  ///< the file's
  [[nodiscard]] Offset environments() const { return static_cast<Offset>(file.env_row_offsets.size()) - 1; }
};

[[noreturn]] void refuse(const std::string& sentence) {
  throw Error(ErrorCode::invalid_argument, sentence);
}

Part read_part(const std::filesystem::path& path) {
  io::SolutionFile file = io::read_solution(path);
  if (!file.shard)
    refuse(
        fmt::format("{}: it says of no part to be one; merge takes what stiction solve --shard wrote", path.string()));
  const io::SolutionShard shard = *file.shard;
  return {path.string(), std::move(file), shard};
}

/// The first word of two lists in which they differ.
std::string first_difference(std::string_view a, std::string_view b) {
  while (!a.empty() || !b.empty()) {
    const std::string_view one = a.substr(0, a.find(' ')), other = b.substr(0, b.find(' '));
    if (one != other) return fmt::format("{} and {}", one, other);
    a.remove_prefix(std::min(a.size(), one.size() + 1));
    b.remove_prefix(std::min(b.size(), other.size() + 1));
  }
  return "nothing";
}

/// Throws unless two parts are of one solution.
void require_same_whole(const Part& first, const Part& part) {
  const io::SolutionShard& a = first.shard;
  const io::SolutionShard& b = part.shard;
  const auto differ = [&](const std::string& what) {
    refuse(fmt::format("{} and {} are not parts of one solution: {}", first.name, part.name, what));
  };
  if (a.input != b.input) differ(fmt::format("the files solved have the hashes {} and {}", a.input, b.input));
  if (a.count != b.count) differ(fmt::format("of {} and of {} parts", a.count, b.count));
  if (a.environment_count != b.environment_count)
    differ(fmt::format("of {} and of {} environments", a.environment_count, b.environment_count));
  if (a.options != b.options) differ(fmt::format("solved with {}", first_difference(a.options, b.options)));
  if (first.file.precision != part.file.precision || first.file.law != part.file.law)
    differ("their options are the same, but not their precision or law");
}

/// Every part once, in the order of their environments, without a gap.
void require_whole(const std::vector<Part>& parts) {
  const std::int64_t count = parts.front().shard.count;
  std::int64_t next = 0;
  const auto missing = [&](std::int64_t until) {
    if (next < until)
      refuse(fmt::format("part {}/{} is missing; solve it with --shard {}/{}", next, count, next, count));
  };
  const Part* before = nullptr;
  Offset end = 0;
  for (const Part& part : parts) {
    if (part.file.w.size() != part.file.lambda.size() ||
        static_cast<Offset>(part.file.status.size()) != part.environments())
      refuse(fmt::format("{}: 'w' or 'status' is missing; solve it again with --shard", part.name));
    const io::SolutionShard& shard = part.shard;
    if (before != nullptr && before->shard.index == shard.index)
      refuse(fmt::format("{} and {} are both part {}/{}; leave one of them out", before->name, part.name, shard.index,
                         count));
    missing(shard.index);
    if (shard.first_environment != end)
      refuse(fmt::format("{}: it begins with environment {}, and the parts before it end with {}", part.name,
                         shard.first_environment, end - 1));
    end += part.environments();
    next = shard.index + 1;
    before = &part;
  }
  missing(count);
  if (end != parts.front().shard.environment_count)
    refuse(fmt::format("{}: the parts end with environment {}, expected {}", parts.back().name, end - 1,
                       parts.front().shard.environment_count - 1));
}

template <class T>
void append(std::vector<T>& whole, const std::vector<T>& part) {
  whole.insert(whole.end(), part.begin(), part.end());
}

io::SolutionFile joined(const std::vector<Part>& parts) {
  io::SolutionFile whole;
  const io::SolutionFile& first = parts.front().file;
  whole.precision = first.precision;
  whole.law = first.law;
  whole.solver = first.solver;
  whole.source = first.source;
  whole.env_row_offsets = {0};
  for (const Part& part : parts) {
    const Offset rows = whole.env_row_offsets.back();
    append(whole.lambda, part.file.lambda);
    append(whole.w, part.file.w);
    append(whole.status, part.file.status);
    for (Offset env = 1; env <= part.environments(); ++env)
      whole.env_row_offsets.push_back(rows + part.file.env_row_offsets[static_cast<std::size_t>(env)]);
  }
  return whole;
}

}  // namespace

int run_merge(const MergeArguments& arguments) {
  for (const std::filesystem::path& part : arguments.parts) require_different(part, arguments.output);
  require_replaceable(arguments.output);
  std::vector<Part> parts;
  parts.reserve(arguments.parts.size());
  for (const std::filesystem::path& part : arguments.parts) {
    parts.push_back(read_part(part));
    require_same_whole(parts.front(), parts.back());
  }
  std::stable_sort(parts.begin(), parts.end(),
                   [](const Part& a, const Part& b) { return a.shard.index < b.shard.index; });
  require_whole(parts);
  const io::SolutionFile whole = joined(parts);
  io::write_solution(arguments.output, whole);
  if (!arguments.quiet)
    fmt::print("{}: {} parts, {} environments, {} rows, hash {}\n", arguments.output.string(), parts.size(),
               whole.env_row_offsets.size() - 1, whole.lambda.size(), hex(hash_rows(whole.lambda, whole.precision)));
  return kExitDone;
}

}  // namespace stiction::cli
