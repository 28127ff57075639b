#include <cstdint>
#include <cstring>
#include <string>

#include "c_api/enums.hpp"
#include "c_api/errors.hpp"
#include "c_api/views.hpp"
#include "stiction/config.hpp"
#include "stiction/status.hpp"

namespace stiction::c {

namespace {

constexpr const char* kUnknown = "unknown";

/// Everything that fits in a byte, as the enumerations of a status record do.
bool is_byte(std::int32_t value) {
  return value >= 0 && value <= 255;
}

/// "cpu", "cuda:1", "emulated": a name for stiction_solver_create.
std::string device_name(const DeviceReport& report) {
  switch (report.device.kind) {
    case DeviceKind::cpu:
      return "cpu";
    case DeviceKind::emulated:
      return "emulated";
    case DeviceKind::cuda:
      break;
  }
  return report.usable ? "cuda:" + std::to_string(report.device.ordinal) : "cuda";
}

}  // namespace

}  // namespace stiction::c

const char* stiction_version(void) {
  return stiction::kVersion;
}

int32_t stiction_abi_version(void) {
  return STICTION_ABI_VERSION;
}

int32_t stiction_epoch(void) {
  return stiction::kNumericsEpoch;
}

const char* stiction_code_name(int32_t code) {
  switch (code) {
    case STICTION_OK:
      return "ok";
    case STICTION_INVALID_ARGUMENT:
      return "invalid_argument";
    case STICTION_BAD_FILE:
      return "bad_file";
    case STICTION_IO:
      return "io";
    case STICTION_OUT_OF_MEMORY:
      return "out_of_memory";
    case STICTION_NO_DEVICE:
      return "no_device";
    case STICTION_DEVICE_FAILURE:
      return "device_failure";
    case STICTION_UNSUPPORTED:
      return "unsupported";
    case STICTION_INTERNAL:
      return "internal";
    default:
      return stiction::c::kUnknown;
  }
}

const char* stiction_env_code_name(int32_t env_code) {
  if (!stiction::c::is_byte(env_code)) return stiction::c::kUnknown;
  return stiction::to_string(static_cast<stiction::EnvCode>(env_code));
}

const char* stiction_solver_name(int32_t solver) {
  if (!stiction::c::is_byte(solver)) return stiction::c::kUnknown;
  return stiction::to_string(static_cast<stiction::SolverKind>(solver));
}

const char* stiction_flag_name(uint32_t flag) {
  return stiction::flag_name(static_cast<stiction::EnvFlag>(flag));
}

stiction_code stiction_solver_from_name(const char* name, int32_t* solver) {
  return stiction::c::guarded([&] {
    stiction::c::need(name, "name", "give a solver's name, for example \"npgs\"");
    stiction::c::need(solver, "solver", "give it room for one number");
    *solver = static_cast<int32_t>(stiction::solver_from_string(name));
  });
}

stiction_code stiction_devices(char* text, size_t room, size_t* length) {
  return stiction::c::guarded([&] {
    if (room > 0) stiction::c::need(text, "text", "give it `room` bytes, or a room of 0");
    std::string all;
    for (const stiction::DeviceReport& report : stiction::devices())
      all += stiction::c::device_name(report) + ": " + (report.usable ? report.name : "not usable: " + report.reason) +
             "\n";
    if (length != nullptr) *length = all.size();
    if (room == 0) return;
    const size_t shown = all.size() < room ? all.size() : room - 1;
    std::memcpy(text, all.data(), shown);
    text[shown] = '\0';
  });
}
