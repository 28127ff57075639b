#include <filesystem>

#include "tools/gpu_first/check.hpp"
#include "tools/gpu_first/child.hpp"

/// Checks once more under NVIDIA's compute-sanitizer, small.
namespace stiction::gpu_first {

namespace {

constexpr double kLimit = 40;  // s
constexpr int kFound = 99;     // exit status where the tool found something

void sanitize(Report& report, const std::string& tool, const std::string& check) {
  if (report.target() == nullptr || !report.target()->is_native())
    return report.left_out("", "compute-sanitizer needs a GPU");
  const std::string self = std::filesystem::read_symlink("/proc/self/exe").string();
  const Ending ending =
      run_child({"compute-sanitizer", "--tool", tool, "--error-exitcode", std::to_string(kFound), "--print-limit", "5",
                 self, "--run", check, "--device", "cuda", "--size", "small", "--hashes", report.setting().hashes},
                kLimit * report.setting().patience);
  const bool ended = ending.kind == Ending::Kind::exited;
  if (ended && ending.number == 127) return report.left_out("", "compute-sanitizer is not here");
  if (!ended) return report.left_out("", "it ran out of time, or died; it printed: " + ending.printed);
  report.judge("", ending.number == 0 ? "" : ending.printed);
}

}  // namespace

void add_sanitizer(Checks& checks) {
  for (const char* const tool : {"memcheck", "racecheck", "synccheck"})
    for (const char* const check : {"class/larger", "class/thread_medium", "form/bodies"})
      checks.push_back({std::string("sanitizer/") + tool + "/" + check, kLimit + 2,
                        [tool, check](Report& report) { sanitize(report, tool, check); }});
}

}  // namespace stiction::gpu_first
