#include "bench/support/machine.hpp"

#include <ctime>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>

#include "stiction/stiction.hpp"

namespace stiction::bench {

namespace {

std::string processor() {
  std::ifstream info("/proc/cpuinfo");
  std::string model = "unknown";
  std::string numbers;
  for (std::string line; std::getline(info, line);) {
    const auto colon = line.find(": ");
    if (line.empty()) break;
    if (colon == std::string::npos) continue;
    const std::string value = line.substr(colon + 2);
    if (line.starts_with("model name")) model = value;
    if (line.starts_with("cpu family")) numbers += " family " + value;
    if (line.starts_with("model\t")) numbers += " model " + value;
  }
  return model + numbers;
}

}  // namespace

std::vector<std::pair<std::string, std::string>> describe_machine() {
  const char* commit = std::getenv("STICTION_GIT_ID");
#if defined(__clang__)
  const char* compiler = "clang++ " __clang_version__;
#else
  const char* compiler = "g++ " __VERSION__;
#endif
  return {{"processor", processor()},
          {"cores", std::to_string(std::thread::hardware_concurrency())},
          {"machine", devices().front().name},
          {"compiler", compiler},
          {"flags", STICTION_BENCH_FLAGS},
          {"stiction", std::string(kVersion) + ", numerics epoch " + std::to_string(kNumericsEpoch)},
          {"commit", commit != nullptr ? commit : "unknown"}};
}

std::string command_line(int argc, char** argv) {
  std::string line;
  for (int i = 0; i < argc; ++i) {
    const std::filesystem::path word = argv[i];
    line += (i > 0 ? " " : "") + (word.is_absolute() ? word.filename() : word).string();
  }
  return line;
}

double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace stiction::bench
