// Functions of NVML and of the CUDA driver that the command line calls, with answers that a test knows. CUDA's device
// 0 is at bus id 0000:3B:00.0, device 1 at 0000:1A:00.0. Samples are 30, 60, 90, 30, ... percent; of device 1 one
// percent more. FAKE_NVML in the environment names a call that fails.
#include <atomic>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace {

struct Utilization {
  unsigned gpu, memory;
};

constexpr int kErrorNotSupported = 3;
constexpr int kErrorNotFound = 6;
const char* const kIds[] = {"0000:3B:00.0", "0000:1A:00.0"};
int handles[2];

bool fails(const char* call) {
  const char* const failing = std::getenv("FAKE_NVML");
  return failing != nullptr && std::strcmp(failing, call) == 0;
}

}  // namespace

// The names are those of the libraries.
// NOLINTBEGIN(readability-identifier-naming)
extern "C" {

std::atomic<int> fake_nvml_samples{0};
std::atomic<int> fake_nvml_open{0};  // initialised and not shut down

int nvmlInit_v2() {
  if (fails("init")) return kErrorNotSupported;
  ++fake_nvml_open;
  return 0;
}
int nvmlShutdown() {
  --fake_nvml_open;
  return 0;
}
const char* nvmlErrorString(int error) {
  return error == kErrorNotFound ? "Not Found" : "Not Supported";
}
int nvmlDeviceGetHandleByPciBusId_v2(const char* id, void** device) {
  for (int k = 0; k < 2; ++k)
    if (std::strcmp(id, kIds[k]) == 0 && !fails("find")) {
      *device = &handles[k];
      return 0;
    }
  return kErrorNotFound;
}
int nvmlDeviceGetUtilizationRates(void* device, Utilization* rates) {
  if (fails("rates")) return kErrorNotSupported;
  const unsigned sample = static_cast<unsigned>(fake_nvml_samples++);
  rates->gpu = 30 * (sample % 3 + 1) + (device == &handles[1] ? 1U : 0U);
  rates->memory = 7;
  return 0;
}

int cuInit(unsigned) {
  return 0;
}
int cuDeviceGet(int* device, int ordinal) {
  *device = 100 + ordinal;
  return ordinal < 2 ? 0 : 101;
}
int cuDeviceGetPCIBusId(char* id, int length, int device) {
  std::snprintf(id, static_cast<std::size_t>(length), "%s", kIds[device - 100]);
  return 0;
}
}
// NOLINTEND(readability-identifier-naming)
