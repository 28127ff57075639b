#include <fmt/format.h>

#include <cstdio>
#include <string>
#include <thread>
#include <vector>

#include "cli/commands.hpp"
#include "cli/json_text.hpp"
#include "cli/output.hpp"
#include "cli/report.hpp"
#include "stiction/solver.hpp"

namespace stiction::cli {

namespace {

std::string compiler() {
#if defined(__clang__)
  return fmt::format("clang {}.{}.{}", __clang_major__, __clang_minor__, __clang_patchlevel__);
#else
  return fmt::format("gcc {}.{}.{}", __GNUC__, __GNUC_MINOR__, __GNUC_PATCHLEVEL__);
#endif
}

/// The instruction sets a body may be compiled for, as far as this CPU has them.
std::vector<std::string> cpu_features() {
  std::vector<std::string> features;
#if defined(__x86_64__)
  __builtin_cpu_init();
  if (__builtin_cpu_supports("sse4.2")) features.emplace_back("sse4.2");
  if (__builtin_cpu_supports("avx")) features.emplace_back("avx");
  if (__builtin_cpu_supports("avx2")) features.emplace_back("avx2");
  if (__builtin_cpu_supports("fma")) features.emplace_back("fma");
  if (__builtin_cpu_supports("avx512f")) features.emplace_back("avx512f");
  if (__builtin_cpu_supports("avx512dq")) features.emplace_back("avx512dq");
  if (__builtin_cpu_supports("avx512vl")) features.emplace_back("avx512vl");
#endif
  return features;
}

struct Library {
  const char* name;
  std::string version;
};

std::vector<Library> libraries() {
  return {{"hdf5", STICTION_HDF5_VERSION},
          {"fmt", fmt::format("{}.{}.{}", FMT_VERSION / 10000, FMT_VERSION / 100 % 100, FMT_VERSION % 100)},
          {"nlohmann_json", fmt::format("{}.{}.{}", NLOHMANN_JSON_VERSION_MAJOR, NLOHMANN_JSON_VERSION_MINOR,
                                        NLOHMANN_JSON_VERSION_PATCH)},
          {"cli11", STICTION_CLI11_VERSION},
          {"cuda", STICTION_CUDA_VERSION}};
}

std::string device_text(const DeviceReport& report) {
  if (report.usable) return fmt::format("{}: {}", to_string(report.device), report.name);
  const char* kind = report.device.kind == DeviceKind::cpu ? "cpu" : "cuda";
  return fmt::format("{}: not usable: {}", kind, report.reason);
}

std::string json_text() {
  Json device_list = Json::array();
  for (const DeviceReport& report : devices()) {
    device_list.push_back({{"device", to_string(report.device)},
                           {"usable", report.usable},
                           {"name", report.name},
                           {"reason", report.reason}});
  }
  Json versions = Json::object();
  for (const Library& library : libraries()) {
    versions[library.name] = library.version.empty() ? Json(nullptr) : Json(library.version);
  }
  return dump({{"schema_version", kReportSchemaVersion},
               {"version", kVersion},
               {"epoch", kNumericsEpoch},
               {"compiler", compiler()},
               {"build_type", STICTION_BUILD_TYPE},
               {"devices", device_list},
               {"cpu_features", cpu_features()},
               {"libraries", versions},
               {"processors", std::thread::hardware_concurrency()}});
}

}  // namespace

int run_info(const InfoArguments& arguments) {
  if (arguments.json) {
    write_text("-", json_text());
    return kExitDone;
  }
  fmt::print("stiction        {}\n", kVersion);
  fmt::print("numerics epoch  {}\n", kNumericsEpoch);
  fmt::print("compiler        {}, {}\n", compiler(), STICTION_BUILD_TYPE);
  const char* label = "devices";
  for (const DeviceReport& report : devices()) {
    fmt::print("{:<16}{}\n", label, device_text(report));
    label = "";
  }
  fmt::print("cpu features    {}\n", fmt::join(cpu_features(), " "));
  fmt::print("processors      {}\n", std::thread::hardware_concurrency());
  std::vector<std::string> versions;
  for (const Library& library : libraries()) {
    versions.push_back(fmt::format("{} {}", library.name, library.version.empty() ? "not built in" : library.version));
  }
  fmt::print("libraries       {}\n", fmt::join(versions, ", "));
  return kExitDone;
}

}  // namespace stiction::cli
