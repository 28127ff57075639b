#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "stiction/error.hpp"
#include "tests/support/machines/cuda_device.hpp"

/// Messages on a machine without a usable GPU.
namespace stiction::test {
namespace {

class CudaAbsent : public ::testing::Test {
 protected:
  void SetUp() override {
    if (usable_cuda(reason_)) GTEST_SKIP() << "a CUDA device is here; what is said without one cannot be seen";
  }
  std::string reason_;
};

TEST_F(CudaAbsent, DevicesListsTheReason) {
  EXPECT_FALSE(reason_.empty());
#if defined(STICTION_HAS_CUDA)
  EXPECT_THAT(reason_, ::testing::AnyOf(::testing::HasSubstr("cudaError"), ::testing::HasSubstr("reports none")));
#else
  EXPECT_THAT(reason_, ::testing::HasSubstr("STICTION_ENABLE_CUDA"));
#endif
}

TEST_F(CudaAbsent, ASolverOnCudaThrowsThatReason) {
  try {
    const Solver solver(Device::cuda(0), SolverOptions{});
    FAIL() << "a solver was made on a device that is not there";
  } catch (const Error& error) {
#if defined(STICTION_HAS_CUDA)
    EXPECT_EQ(error.code(), ErrorCode::no_device);
#else
    EXPECT_EQ(error.code(), ErrorCode::unsupported);
#endif
    EXPECT_THAT(error.what(), ::testing::HasSubstr(reason_));
  }
}

TEST_F(CudaAbsent, AskingAgainGivesTheSameAnswer) {
  std::string again;
  EXPECT_FALSE(usable_cuda(again));
  EXPECT_EQ(again, reason_);
}

}  // namespace
}  // namespace stiction::test
