#include <string>
#include <utility>
#include <vector>

#include "core/machine/contact_machine.hpp"
#include "stiction/error.hpp"

namespace stiction {

std::vector<DeviceReport> devices() {
  std::vector<DeviceReport> all{cpu_report()};
  for (DeviceReport& report : cuda_reports()) all.push_back(std::move(report));
  all.push_back(emulated_report());
  return all;
}

Device Device::from_string(const std::string& text) {
  if (text == "cpu") return cpu();
  if (text == "emulated") return emulated();
  if (text == "auto") {
    for (const DeviceReport& report : devices())
      if (report.usable && report.device.kind == DeviceKind::cuda) return report.device;
    return cpu();
  }
  int ordinal = -1;
  if (text == "cuda") ordinal = 0;
  if (text.rfind("cuda:", 0) == 0 && text.size() > 5 && text.size() < 9 &&
      text.find_first_not_of("0123456789", 5) == std::string::npos)
    ordinal = std::stoi(text.substr(5));
  if (ordinal < 0)
    throw Error(ErrorCode::invalid_argument, "device '" + text + "': choose auto, cpu, cuda, cuda:N or emulated");
  std::string reason = "there is no such device";
  for (const DeviceReport& report : devices()) {
    if (report.device.kind != DeviceKind::cuda) continue;
    if (report.usable && report.device.ordinal == ordinal) return report.device;
    if (!report.usable) reason = report.reason;
  }
  throw Error(ErrorCode::no_device, "device '" + text + "' is not usable: " + reason + "; use cpu or auto");
}

}  // namespace stiction
