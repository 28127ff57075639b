#include <fmt/format.h>

#include <thread>

#include "cli/output.hpp"
#include "cli/report.hpp"
#include "cli/step_world.hpp"
#include "stiction/error.hpp"

namespace stiction::cli {

namespace {

std::string name_of(Device device) {
  for (const DeviceReport& report : devices())
    if (report.device.kind == device.kind && report.device.ordinal == device.ordinal) return report.name;
  return "the GPU's kernels on the CPU";
}

int list_scenes() {
  for (const std::string& name : scenes::world_names())
    fmt::print("{:<10} {}\n", name, scenes::make_world(name).summary);
  return kExitDone;
}

}  // namespace

int run_step(const StepArguments& arguments) {
  if (arguments.list) return list_scenes();
  if (arguments.scene.empty())
    throw Error(ErrorCode::invalid_argument, "a scene is missing: stiction step --list shows them");
  require_distinct({{"-o", arguments.output}, {"--json", arguments.json}, {"--checkpoint", arguments.checkpoint}});
  if (arguments.json) require_writable(*arguments.json);
  if (arguments.checkpoint) require_replaceable(*arguments.checkpoint);
  const Precision precision = precision_from_option(arguments.precision);
  if (arguments.size > 0) {
    scenes::make_world(arguments.scene, 1);  // refuses a scene that is not there, or has no size
    require_world_memory(arguments, arguments.size, precision);
  }
  const scenes::WorldScene scene = scenes::make_world(arguments.scene, arguments.size);
  const Device device = Device::from_string(arguments.device);
  StepReport report = precision == Precision::f32 ? step_world<float>(arguments, scene, device)
                                                  : step_world<double>(arguments, scene, device);
  report.scene = arguments.scene;
  report.device = to_string(device);
  report.device_name = name_of(device);
  report.precision = precision;
  report.environments = arguments.environments;
  report.steps = arguments.steps;
  report.seed = arguments.seed;
  report.threads = arguments.threads > 0 ? arguments.threads : static_cast<int>(std::thread::hardware_concurrency());
  if (arguments.json) write_text(*arguments.json, to_json(report));
  const bool printed = arguments.json == "-" || arguments.output == "-";
  if (!arguments.quiet && !printed) fmt::print("{}", to_text(report));
  return exit_status(report);
}

}  // namespace stiction::cli
