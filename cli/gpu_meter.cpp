#include "cli/gpu_meter.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <condition_variable>
#include <mutex>
#include <stdexcept>
#include <thread>

namespace stiction::cli {

namespace {

/// Why there are no samples.
using NoSamples = std::runtime_error;

/// A library that is loaded while this lives.
class Library {
 public:
  Library(const char* what, const std::string& name)
      : name_(name), handle_(dlopen(name.c_str(), RTLD_NOW | RTLD_LOCAL)) {
    if (handle_ == nullptr) throw NoSamples(fmt::format("no {} here: {}", what, dlerror()));
  }
  ~Library() { dlclose(handle_); }
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;

  template <class Function>
  Function* function(const char* name) const {
    void* const found = dlsym(handle_, name);
    if (found == nullptr) throw NoSamples(fmt::format("{} has no {}", name_, name));
    return reinterpret_cast<Function*>(found);
  }

 private:
  std::string name_;
  void* handle_;
};

/// Returns the PCI bus of the CUDA device with that number. NVML numbers devices in another order, and knows nothing
/// of CUDA_VISIBLE_DEVICES; the driver's interface has the order of the run time.
std::string pci_bus_id(const Library& driver, int ordinal) {
  int device = 0;
  char id[32] = {};
  const auto check = [](int error, const char* call) {
    if (error != 0) throw NoSamples(fmt::format("{} gave CUDA error {}", call, error));
  };
  check(driver.function<int(unsigned)>("cuInit")(0), "cuInit");
  check(driver.function<int(int*, int)>("cuDeviceGet")(&device, ordinal), "cuDeviceGet");
  check(driver.function<int(char*, int, int)>("cuDeviceGetPCIBusId")(id, sizeof(id), device), "cuDeviceGetPCIBusId");
  return id;
}

/// nvmlUtilization_t of nvml.h (NVML API Reference Guide).
struct Utilization {
  unsigned gpu;     ///< percent of the sample period in which a kernel ran
  unsigned memory;  ///< percent of it in which memory was read or written
};

/// One device as NVML knows it.
class Nvml {
 public:
  Nvml(const std::string& name, const std::string& bus_id)
      : library_("NVML", name),
        text_(library_.function<const char*(int)>("nvmlErrorString")),
        rates_(library_.function<int(void*, Utilization*)>("nvmlDeviceGetUtilizationRates")),
        shut_down_(library_.function<int()>("nvmlShutdown")) {
    const auto find = library_.function<int(const char*, void**)>("nvmlDeviceGetHandleByPciBusId_v2");
    check(library_.function<int()>("nvmlInit_v2")());
    const int error = find(bus_id.c_str(), &device_);
    if (error != 0) shut_down_();
    check(error);
  }
  ~Nvml() { shut_down_(); }
  Nvml(const Nvml&) = delete;
  Nvml& operator=(const Nvml&) = delete;

  [[nodiscard]] double share() const {
    Utilization rates{};
    check(rates_(device_, &rates));
    return rates.gpu / 100.0;
  }

 private:
  void check(int error) const {
    if (error != 0) throw NoSamples(fmt::format("NVML says: {}", text_(error)));
  }

  Library library_;
  const char* (*text_)(int);
  int (*rates_)(void*, Utilization*);
  int (*shut_down_)();
  void* device_ = nullptr;
};

std::string reason_of(Device device) {
  if (device.kind == DeviceKind::cpu) return "the device is the CPU";
  return device.kind == DeviceKind::emulated ? "the device is emulated" : "";
}

}  // namespace

/// A thread that samples until it is stopped.
class GpuMeter::Sampler {
 public:
  Sampler(int ordinal, const GpuMeterOptions& options)
      : options_(options),
        nvml_(options.nvml, pci_bus_id(Library("CUDA driver", options.driver), ordinal)),
        thread_([this] { sample(); }) {}
  ~Sampler() { end(); }
  Sampler(const Sampler&) = delete;
  Sampler& operator=(const Sampler&) = delete;

  GpuUse end() {
    {
      const std::lock_guard lock(mutex_);
      ended_ = true;
    }
    wake_.notify_all();
    if (thread_.joinable()) thread_.join();
    GpuUse use;
    use.samples = samples_;
    use.reason = reason_;
    if (!reason_.empty()) return use;
    if (samples_ > 0)
      use.share = sum_ / samples_;
    else
      use.reason = fmt::format("the run ended before NVML's first sample of it, after {} ms", options_.first.count());
    return use;
  }

 private:
  void sample() {
    std::unique_lock lock(mutex_);
    std::chrono::milliseconds pause = options_.first;
    while (!wake_.wait_for(lock, pause, [&] { return ended_; })) {
      pause = options_.every;
      try {
        sum_ += nvml_.share();
        ++samples_;
      } catch (const NoSamples& error) {
        reason_ = error.what();
        return;
      }
    }
  }

  const GpuMeterOptions options_;
  const Nvml nvml_;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool ended_ = false;  // guarded by mutex_, as all below
  double sum_ = 0;
  int samples_ = 0;
  std::string reason_;
  std::thread thread_;  // begins when all else is there
};

GpuMeter::GpuMeter(Device device, const GpuMeterOptions& options) {
  use_.reason = reason_of(device);
  if (!use_.reason.empty()) return;
  try {
    sampler_ = std::make_unique<Sampler>(device.ordinal, options);
  } catch (const std::exception& error) {
    use_.reason = error.what();
  }
}

GpuMeter::~GpuMeter() = default;

GpuUse GpuMeter::end() {
  if (sampler_) use_ = sampler_->end();
  sampler_.reset();
  return use_;
}

Json json_of(const GpuUse& use) {
  return use.share ? Json(*use.share) : Json(nullptr);
}

std::string gpu_use_text(const GpuUse& use) {
  return use.share ? fmt::format("{:.1f} % of the time, {} samples", 100 * *use.share, use.samples) : use.reason;
}

}  // namespace stiction::cli
