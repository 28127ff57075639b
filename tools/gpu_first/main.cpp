// The first minutes on a GPU: every check in a process of its own with a time limit, the most telling first. Each
// result is a line of JSON, appended to a file at once. A check that hangs or dies costs its own line alone.
//
//   gpu_first --out results.jsonl [--device cuda|emulated|ptx|cpu] [--size full|small] [--seconds S]
//             [--only PREFIX,...] [--skip PREFIX,...] [--hashes FILE] [--batches FOLDER] [--patience 1]
//             [--write-hashes FILE] [--list]
//
// Answers are compared with the CPU's, and with the hashes that are committed beside this file. --device ptx runs what
// nvcc made of the kernels on the CPU (STICTION_EMULATED_KERNELS names the library): a rehearsal. --device cpu compares
// the CPU with the committed hashes alone. Exit status 0: all is right; 1: something is not; 2: usage.

#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <map>

#include "stiction/error.hpp"
#include "tools/gpu_first/check.hpp"
#include "tools/gpu_first/child.hpp"

namespace stiction::gpu_first {
namespace {

constexpr int kWrong = 1, kUsage = 2;

Checks all_checks() {
  Checks checks;
  add_device(checks);
  add_plan(checks);
  add_classes(checks);
  add_solvers(checks);
  add_golden(checks);
  add_forms(checks);
  add_steps(checks);
  add_capture(checks);
  add_repetition(checks);
  add_times(checks);
  add_sanitizer(checks);
  add_tuning(checks);
  add_self(checks);
  return checks;
}

/// "a,b" as parts; nothing for an empty text.
std::vector<std::string> parts_of(const std::string& text) {
  std::vector<std::string> parts;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    parts.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

struct Arguments {
  std::map<std::string, std::string> values{
      {"--out", ""},     {"--device", "cuda"}, {"--size", ""},
      {"--only", ""},    {"--seconds", "1e9"}, {"--hashes", "tools/gpu_first/hashes.csv"},
      {"--batches", ""}, {"--patience", ""},   {"--write-hashes", ""},
      {"--run", ""},     {"--skip", ""}};
  bool lists = false;

  Arguments(int argc, char** argv) {
    for (int i = 1; i < argc; ++i) {
      const std::string word = argv[i];
      if (word == "--list") {
        lists = true;
        continue;
      }
      const auto found = values.find(word);
      if (found == values.end() || i + 1 == argc)
        throw Error(ErrorCode::invalid_argument, "'" + word + "' is unknown or has no value: see the head of main.cpp");
      found->second = argv[++i];
    }
  }
  [[nodiscard]] const std::string& at(const std::string& name) const { return values.at(name); }
  [[nodiscard]] double number(const std::string& name) const {
    char* end = nullptr;
    const double value = std::strtod(at(name).c_str(), &end);
    if (end == at(name).c_str() || *end != 0)
      throw Error(ErrorCode::invalid_argument, name + " is '" + at(name) + "': give a number");
    return value;
  }
  [[nodiscard]] Setting setting() const {
    Setting setting;
    setting.device = at("--device");
    if (setting.device != "cuda" && setting.device != "emulated" && setting.device != "ptx" && setting.device != "cpu")
      throw Error(ErrorCode::invalid_argument, "--device is '" + setting.device + "': use cuda, emulated, ptx or cpu");
    const bool is_small = setting.device == "emulated" || setting.device == "ptx";
    setting.full = at("--size").empty() ? !is_small : at("--size") == "full";
    setting.patience = at("--patience").empty() ? (is_small ? 20 : 1) : number("--patience");
    setting.out = at("--out");
    setting.hashes = at("--hashes");
    setting.write_hashes = at("--write-hashes");
    setting.batches = at("--batches");
    return setting;
  }
};

std::unique_ptr<Target> make_target(const std::string& device) {
  if (device == "cpu") return nullptr;
  if (device == "ptx" && std::getenv("STICTION_EMULATED_KERNELS") == nullptr)
    throw Error(ErrorCode::invalid_argument, "--device ptx needs STICTION_EMULATED_KERNELS, the library of tests/ptx");
  if (device != "cuda") return make_emulated_target();
  std::unique_ptr<Target> target = make_cuda_target(0);
  if (target == nullptr) throw Error(ErrorCode::no_device, "this build has no CUDA: rehearse with --device emulated");
  return target;
}

/// In the child.
int run_one(const Arguments& arguments, const Setting& setting) {
  for (const Check& check : all_checks()) {
    if (check.name != arguments.at("--run")) continue;
    const std::unique_ptr<Target> target = make_target(setting.device);
    Report report(setting, target.get(), check.name);
    check.run(report);
    return report.good() ? 0 : kWrong;
  }
  throw Error(ErrorCode::invalid_argument, "there is no check '" + arguments.at("--run") + "'");
}

/// Whether the check goes wrong by design.
bool is_for_itself(const Check& check) {
  return check.name.rfind("self/", 0) == 0;
}

bool begins_with_any(const std::string& name, const std::vector<std::string>& prefixes) {
  for (const std::string& prefix : prefixes)
    if (name.rfind(prefix, 0) == 0) return true;
  return false;
}

/// What the parent says of a check whose process did not say it itself.
std::string line_of(const Check& check, const Ending& ending) {
  JsonLine line;
  line.add("check", check.name);
  if (ending.kind == Ending::Kind::out_of_time) line.add("result", "out of time");
  if (ending.kind == Ending::Kind::signalled) line.add("result", "died").add("signal", ending.number);
  if (ending.kind == Ending::Kind::exited) line.add("result", "failed").add("status", ending.number);
  return line.add("seconds", ending.seconds).add("printed", ending.printed).text();
}

int run_all(const Arguments& arguments, const Setting& setting, char* self) {
  const std::vector<std::string> only = parts_of(arguments.at("--only")), skip = parts_of(arguments.at("--skip"));
  const double start = wall_seconds(), seconds = arguments.number("--seconds");
  int wrong = 0, right = 0, left_out = 0;
  for (const Check& check : all_checks()) {
    const bool is_named = begins_with_any(check.name, only);
    if (begins_with_any(check.name, skip) || !(is_named || (only.empty() && !is_for_itself(check)))) continue;
    const double left = seconds - (wall_seconds() - start), limit = check.limit_s * setting.patience;
    if (left < 2) {
      ++left_out;
      if (!setting.out.empty())
        append_line(setting.out, JsonLine().add("check", check.name).add("result", "left out: no time").text());
      continue;
    }
    std::vector<std::string> command{self, "--run", check.name};
    for (const auto& [name, value] : arguments.values)
      if (name != "--run" && name != "--only" && name != "--seconds" && name != "--skip" && !value.empty())
        command.insert(command.end(), {name, value});
    const Ending ending = run_child(command, std::min(limit, left));
    const bool is_right = ending.kind == Ending::Kind::exited && ending.number == 0;
    const bool has_said = ending.kind == Ending::Kind::exited && ending.number <= kWrong;
    if (!has_said && !setting.out.empty()) append_line(setting.out, line_of(check, ending));
    is_right ? ++right : ++wrong;
    std::printf("%-8s %6.1f s  %s\n",
                is_right   ? "right"
                : has_said ? "WRONG"
                           : "FAILED",
                ending.seconds, check.name.c_str());
    if (!is_right) std::printf("  %s\n", ending.printed.c_str());
    std::fflush(stdout);
  }
  std::printf("%d checks right, %d wrong, %d left out for time, %.1f s\n", right, wrong, left_out,
              wall_seconds() - start);
  if (!setting.out.empty())
    append_line(setting.out, JsonLine()
                                 .add("check", "all")
                                 .add("result", wrong == 0 && left_out == 0 ? "right" : "wrong")
                                 .add("right", right)
                                 .add("wrong", wrong)
                                 .add("left_out", left_out)
                                 .add("seconds", wall_seconds() - start)
                                 .text());
  return wrong == 0 && left_out == 0 ? 0 : kWrong;
}

int run(int argc, char** argv) {
  const Arguments arguments(argc, argv);
  if (arguments.lists) {
    for (const Check& check : all_checks()) std::printf("%-28s %5.0f s\n", check.name.c_str(), check.limit_s);
    return 0;
  }
  const Setting setting = arguments.setting();
  return arguments.at("--run").empty() ? run_all(arguments, setting, argv[0]) : run_one(arguments, setting);
}

}  // namespace
}  // namespace stiction::gpu_first

int main(int argc, char** argv) {
  try {
    return stiction::gpu_first::run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "gpu_first: %s\n", error.what());
    return stiction::gpu_first::kUsage;
  }
}
