#include <thread>

#include "stiction/stiction.hpp"
#include "tools/gpu_first/check.hpp"
#include "tools/gpu_first/child.hpp"

namespace stiction::gpu_first {

namespace {

/// Reports a machine's description of itself, as a program prints it.
void ask(Report& report, const std::vector<std::string>& command) {
  const Ending ending = run_child(command, 10);
  report.measured(command[0],
                  [&](JsonLine& line) { line.add("status", ending.number).add("printed", ending.printed); });
}

void describe(Report& report) {
  report.measured("host", [](JsonLine& line) {
    line.add("threads", static_cast<int>(std::thread::hardware_concurrency()));
    for (const DeviceReport& device : devices())
      line.add(device.device.kind == DeviceKind::cpu    ? "cpu"
               : device.device.kind == DeviceKind::cuda ? "cuda:" + std::to_string(device.device.ordinal)
                                                        : std::string("emulated"),
               device.usable ? device.name : device.reason);
  });
  if (report.target() == nullptr) return;
  report.measured("device", [&](JsonLine& line) { report.target()->describe(line); });
  Report::say("device", report.target()->api()->facts().name);
  if (!report.target()->is_native()) return;
  ask(report, {"nvidia-smi", "--format=csv",
               "--query-gpu=name,driver_version,pstate,clocks.sm,clocks.max.sm,clocks.mem,power.draw,power.limit,"
               "temperature.gpu,ecc.mode.current,mig.mode.current"});
  ask(report, {"nvcc", "--version"});
  ask(report, {"compute-sanitizer", "--version"});
  ask(report, {"ncu", "--version"});
}

void basics(Report& report) {
  if (report.target() == nullptr || !report.target()->is_native())
    return report.left_out("", "times of a device that the CPU stands in for say nothing");
  measure_basics([&](const std::string& name, double value, const std::string& unit) {
    report.measured(name, [&](JsonLine& line) { line.add("value", value).add("unit", unit); });
  });
}

}  // namespace

void add_device(Checks& checks) {
  checks.push_back({"device", 40, describe});
  checks.push_back({"basics", 30, basics});
}

}  // namespace stiction::gpu_first
