// The first minutes on a GPU: every check in a process of its own with a time limit, the most telling first. Each
// result is a line of JSON, appended to a file at once. A check that hangs or dies costs its own line alone.
//
//   gpu_first --out results.jsonl [--device cuda|emulated|ptx|cpu] [--size full|small] [--seconds S]
//             [--only PREFIX,...] [--skip PREFIX,...] [--hashes FILE] [--batches FOLDER] [--patience 1]
//             [--write-hashes FILE] [--plan minutes]
//
// --list names the checks. --plan minutes runs the phases of plan.hpp. Each has its share of --seconds (470 by
// default). A summary follows, which repeats the program's sources as given.
//
// Answers are compared with the CPU's, and with the hashes that are committed beside this file. --device ptx runs
// nvcc's code of the kernels on the CPU (STICTION_EMULATED_KERNELS names the library): a rehearsal. --device cpu
// compares the CPU with the committed hashes alone. Exit status 0: all is right; 1: something is not; 2: usage.

#include <fcntl.h>

#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <map>

#include "stiction/error.hpp"
#include "tools/gpu_first/check.hpp"
#include "tools/gpu_first/child.hpp"
#include "tools/gpu_first/plan.hpp"
#include "tools/gpu_first/summary.hpp"

namespace stiction::gpu_first {
namespace {

constexpr int kWrong = 1, kUsage = 2;

Checks all_checks() {
  Checks checks;
  add_device(checks);
  add_robot_hashes(checks);
  add_robot_times(checks);
  add_baseline(checks);
  add_lanes(checks);
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
  add_profiles(checks);
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
      {"--only", ""},    {"--seconds", ""},    {"--hashes", "tools/gpu_first/hashes.csv"},
      {"--batches", ""}, {"--patience", ""},   {"--write-hashes", ""},
      {"--run", ""},     {"--skip", ""},       {"--plan", ""},
      {"--made-of", ""}, {"--summary", ""}};
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

/// Returns true of a check that goes wrong by design, or that a profiler looks at.
bool is_for_others(const Check& check) {
  return check.name.rfind("self/", 0) == 0 || check.name.rfind("profile/", 0) == 0;
}

bool begins_with_any(const std::string& name, const std::vector<std::string>& prefixes) {
  for (const std::string& prefix : prefixes)
    if (name.rfind(prefix, 0) == 0) return true;
  return false;
}

/// Returns the parent's line of a check whose process printed none itself.
std::string line_of(const Check& check, const Ending& ending) {
  JsonLine line;
  line.add("check", check.name);
  if (ending.kind == Ending::Kind::out_of_time) line.add("result", "out of time");
  if (ending.kind == Ending::Kind::signalled) line.add("result", "died").add("signal", ending.number);
  if (ending.kind == Ending::Kind::exited) line.add("result", "failed").add("status", ending.number);
  return line.add("seconds", ending.seconds).add("printed", ending.printed).text();
}

/// Keeps the GPU awake: without a process that has it open, each check would wait for the driver to begin anew.
void hold_devices() {
  for (int ordinal = 0; ordinal < 8; ++ordinal) {
    const std::string path = "/dev/nvidia" + std::to_string(ordinal);
    [[maybe_unused]] const int kept = open(path.c_str(), O_RDWR | O_CLOEXEC);  // a machine may have none of it
  }
}

/// Runs checks one after the other, each in a process of its own.
class Parent {
 public:
  Parent(const Arguments& arguments, const Setting& setting, char* self)
      : arguments_(arguments), setting_(setting), self_(self) {}

  /// Runs checks whose names begin with one of `only`, in the order of these, but with none of `skip`, until `end`.
  void run(const std::vector<std::string>& only, const std::vector<std::string>& skip, double end) {
    const std::vector<std::string> named = parts_of(arguments_.at("--only")),
                                   unwanted = parts_of(arguments_.at("--skip"));
    const std::vector<std::string> everything{""};
    for (const std::string& beginning : !only.empty() ? only : !named.empty() ? named : everything)
      for (const Check& check : checks_) {
        if (check.name.rfind(beginning, 0) != 0 || begins_with_any(check.name, skip)) continue;
        if (begins_with_any(check.name, unwanted) || (!named.empty() && !begins_with_any(check.name, named))) continue;
        if (named.empty() && is_for_others(check)) continue;
        run(check, end);
      }
  }
  /// The phases of a plan, all of them within `seconds`.
  void run(std::span<const Phase> plan, double seconds) {
    double end = start_;
    append(JsonLine()
               .add("check", "all")
               .add("part", "plan")
               .add("result", "begins")
               .add("made_of", arguments_.at("--made-of")),
           false);
    for (const Phase& phase : plan) {
      end += phase.seconds * seconds / seconds_of(plan);
      append(JsonLine().add("check", "phase").add("part", phase.name).add("result", "begins"), true);
      run(parts_of(phase.only), parts_of(phase.skip), end);
    }
  }
  /// Says how it went; the exit status.
  int finish(bool has_summary) {
    const bool is_right = wrong_ == 0 && left_out_ == 0;
    const std::string counts = std::to_string(right_) + " checks right, " + std::to_string(wrong_) + " wrong, " +
                               std::to_string(left_out_) + " left out for time, ";
    char seconds[32];
    std::snprintf(seconds, sizeof seconds, "%.1f s", wall_seconds() - start_);
    append(JsonLine()
               .add("check", "all")
               .add("result", is_right ? "right" : "wrong")
               .add("right", right_)
               .add("wrong", wrong_)
               .add("left_out", left_out_)
               .add("made_of", arguments_.at("--made-of")),
           true);
    if (!has_summary) {
      std::printf("%s%s\n", counts.c_str(), seconds);
    } else {
      std::string head = counts + seconds;
      if (!arguments_.at("--made-of").empty()) head += ", made of sources " + arguments_.at("--made-of");
      for (const std::string& line : summary_.lines(head)) {
        std::printf("%s\n", line.c_str());
        if (!arguments_.at("--summary").empty()) append_line(arguments_.at("--summary"), line);
      }
    }
    std::fflush(stdout);
    return is_right ? 0 : kWrong;
  }

 private:
  void append(JsonLine line, bool has_time) const {
    if (has_time) line.add("seconds", wall_seconds() - start_);
    if (!setting_.out.empty()) append_line(setting_.out, line.text());
  }

  void run(const Check& check, double end) {
    const double left = end - wall_seconds(), limit = check.limit_s * setting_.patience;
    if (left < 2) {
      ++left_out_;
      append(JsonLine().add("check", check.name).add("result", "left out: no time"), false);
      return;
    }
    std::vector<std::string> command{self_, "--run", check.name};
    for (const char* const name :
         {"--out", "--device", "--size", "--hashes", "--batches", "--patience", "--write-hashes"})
      if (!arguments_.at(name).empty()) command.insert(command.end(), {name, arguments_.at(name)});
    const Ending ending = run_child(command, std::min(limit, left), [&](const std::string& line) {
      if (line.rfind(kSaid, 0) != 0) return;
      summary_.hear(line);
      std::printf("%s\n", line.c_str());
      std::fflush(stdout);
    });
    const bool is_right = ending.kind == Ending::Kind::exited && ending.number == 0;
    const bool has_said = ending.kind == Ending::Kind::exited && ending.number <= kWrong;
    if (!has_said && !setting_.out.empty()) append_line(setting_.out, line_of(check, ending));
    is_right ? ++right_ : ++wrong_;
    const char* const word = is_right ? "right" : has_said ? "WRONG" : "FAILED";
    std::printf("%-8s %6.1f s  %s\n", word, ending.seconds, check.name.c_str());
    if (!is_right) {
      summary_.add_wrong(std::string(word) + " " + check.name);
      std::printf("  %s\n", ending.printed.c_str());
    }
    std::fflush(stdout);
  }

  const Arguments& arguments_;
  const Setting& setting_;
  const char* self_;
  const Checks checks_ = all_checks();
  const double start_ = wall_seconds();
  Summary summary_;
  int right_ = 0, wrong_ = 0, left_out_ = 0;
};

int run_all(const Arguments& arguments, const Setting& setting, char* self) {
  if (setting.device == "cuda") hold_devices();
  const std::string& plan = arguments.at("--plan");
  const bool has_end = !arguments.at("--seconds").empty();
  const double seconds = has_end ? arguments.number("--seconds") : plan.empty() ? 1e9 : seconds_of(plan_of(plan));
  Parent parent(arguments, setting, self);
  if (plan.empty())
    parent.run({}, {}, wall_seconds() + seconds);
  else
    parent.run(plan_of(plan), seconds);
  return parent.finish(!plan.empty() || !arguments.at("--summary").empty());
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
