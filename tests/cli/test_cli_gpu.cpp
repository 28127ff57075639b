// Use of a GPU, by NVML. A fake NVML answers, so that the answers are known; no GPU is needed.
#include <dlfcn.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <thread>

#include "cli/gpu_meter.hpp"
#include "tests/cli/process.hpp"

namespace stiction::cli {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

class GpuMeters : public testing::Test {
 protected:
  void SetUp() override {
    fake_ = dlopen(STICTION_FAKE_NVML, RTLD_NOW);
    ASSERT_NE(fake_, nullptr) << dlerror();
    samples() = 0;
  }
  void TearDown() override {
    unsetenv("FAKE_NVML");
    EXPECT_EQ(*static_cast<std::atomic<int>*>(dlsym(fake_, "fake_nvml_open")), 0) << "not shut down, or too often";
    dlclose(fake_);
  }
  std::atomic<int>& samples() { return *static_cast<std::atomic<int>*>(dlsym(fake_, "fake_nvml_samples")); }

  static GpuMeterOptions fake() { return {STICTION_FAKE_NVML, STICTION_FAKE_NVML, milliseconds(1), milliseconds(1)}; }

  /// A meter's answer after so many samples, or after a minute.
  GpuUse after(int count, int ordinal) {
    GpuMeter meter(Device::cuda(ordinal), fake());
    for (int ms = 0; ms < 60000 && samples() < count; ++ms) std::this_thread::sleep_for(milliseconds(1));
    return meter.end();
  }
  static std::string reason(int ordinal, const GpuMeterOptions& options) {
    const GpuUse use = GpuMeter(Device::cuda(ordinal), options).end();
    EXPECT_FALSE(use.share);
    EXPECT_TRUE(json_of(use).is_null());
    return use.reason;
  }

  void* fake_ = nullptr;
};

TEST_F(GpuMeters, TheShareIsTheMeanOfTheSamplesOfTheDeviceThatCudaMeans) {
  for (const int ordinal : {0, 1}) {
    samples() = 0;
    const GpuUse use = after(4, ordinal);
    EXPECT_EQ(use.reason, "");
    ASSERT_GE(use.samples, 4);
    double percent = 0;
    for (int k = 0; k < use.samples; ++k) percent += 30 * (k % 3 + 1) + ordinal;
    EXPECT_NEAR(use.share.value_or(-1), percent / 100 / use.samples, 1e-12);
    EXPECT_DOUBLE_EQ(json_of(use).get<double>(), use.share.value_or(-1));
  }
}

TEST_F(GpuMeters, WhatIsMissingIsTheReason) {
  GpuMeterOptions options = fake();
  options.nvml = "libnowhere-nvml.so.1";
  EXPECT_THAT(reason(0, options), HasSubstr("no NVML here: libnowhere-nvml.so.1"));
  options.nvml = "libc.so.6";
  EXPECT_THAT(reason(0, options), HasSubstr("libc.so.6 has no nvml"));
  options = fake();
  options.driver = "libnowhere-cuda.so.1";
  EXPECT_THAT(reason(0, options), HasSubstr("no CUDA driver here: libnowhere-cuda.so.1"));
  EXPECT_EQ(reason(2, fake()), "cuDeviceGet gave CUDA error 101");
}

TEST_F(GpuMeters, WhatNvmlRefusesIsTheReason) {
  setenv("FAKE_NVML", "init", 1);
  EXPECT_EQ(reason(0, fake()), "NVML says: Not Supported");
  setenv("FAKE_NVML", "find", 1);
  EXPECT_EQ(reason(0, fake()), "NVML says: Not Found");
  setenv("FAKE_NVML", "rates", 1);
  GpuMeter meter(Device::cuda(0), fake());
  std::this_thread::sleep_for(milliseconds(50));
  const GpuUse use = meter.end();
  EXPECT_FALSE(use.share);
  // A machine that gives the sampling thread no turn in this time has no sample to refuse.
  EXPECT_THAT(use.reason, testing::AnyOf("NVML says: Not Supported", HasSubstr("before NVML's first sample")));
}

TEST_F(GpuMeters, ARunThatEndsBeforeTheFirstSampleSaysSo) {
  GpuMeterOptions options = fake();
  options.first = std::chrono::hours(1);
  EXPECT_THAT(reason(0, options), HasSubstr("before NVML's first sample"));
  EXPECT_EQ(samples(), 0);
}

TEST(GpuUtilisation, IsNullWithAReasonWhereThereIsNoGpu) {
  using test::run_stiction;
  for (const auto& [device, reason] :
       {std::pair{"cpu", "the device is the CPU"}, std::pair{"emulated", "the device is emulated"}}) {
    const auto run = run_stiction({"step", "slide", "--envs", "2", "--steps", "2", "--device", device, "--json", "-"});
    ASSERT_EQ(run.status, 0) << run.err;
    const Json report = Json::parse(run.out);
    EXPECT_TRUE(report["gpu_utilisation"].is_null());
    EXPECT_EQ(report["gpu_utilisation_reason"], reason);
  }
}

}  // namespace
}  // namespace stiction::cli
