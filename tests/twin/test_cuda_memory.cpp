#include <gtest/gtest.h>

#include "tests/support/machines/cuda_device.hpp"

/// Batches that live on the GPU, and the errors of a device.
#if !defined(STICTION_HAS_CUDA)
TEST(CudaMemory, IsTestedWhereTheBuildHasCuda) {
  GTEST_SKIP() << "built without the CUDA machine";
}
#else

#include <cuda_runtime_api.h>

#include <optional>
#include <vector>

#include "cuda/native/cuda_check.hpp"
#include "stiction/batch_arrays.hpp"
#include "stiction/error.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace stiction::test {
namespace {

/// Device memory of one test.
class DeviceArrays {
 public:
  DeviceArrays() = default;
  ~DeviceArrays() {
    for (void* memory : all_) cudaFree(memory);
  }
  DeviceArrays(const DeviceArrays&) = delete;
  DeviceArrays& operator=(const DeviceArrays&) = delete;

  template <class T>
  T* make(Offset count) {
    void* memory = nullptr;
    STICTION_CUDA_TRY(cudaMalloc(&memory, static_cast<std::size_t>(count) * sizeof(T) + 1));
    all_.push_back(memory);
    return static_cast<T*>(memory);
  }
  template <class T>
  T* copy(const T* host, Offset count) {
    T* const memory = make<T>(count);
    STICTION_CUDA_TRY(cudaMemcpy(memory, host, static_cast<std::size_t>(count) * sizeof(T), cudaMemcpyHostToDevice));
    return memory;
  }

 private:
  std::vector<void*> all_;
};

template <class Real>
ContactBatchView<Real> to_device(const ContactBatchView<Real>& host, DeviceArrays& arrays) {
  ContactBatchView<Real> view = host;
  for_each_array(
      host,
      [&](const BatchArray& what, auto*& array) {
        if (array != nullptr) array = arrays.copy(array, what.length);
      },
      view);
  view.space = MemorySpace::cuda;
  return view;
}

class CudaMemory : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string reason;
    device_ = usable_cuda(reason);
    if (!device_) GTEST_SKIP() << "no GPU to put a batch on: " << reason;
    STICTION_CUDA_TRY(cudaSetDevice(device_->ordinal));
    STICTION_CUDA_TRY(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking));
  }
  void TearDown() override {
    if (stream_ != nullptr) cudaStreamDestroy(stream_);
  }

  template <class Real>
  void expect_same_on_device(const ContactBatch<Real>& batch, const SolverOptions& options, int rounds) {
    const Solution<Real> expected = solve(batch, options);
    DeviceArrays arrays;
    const auto view = to_device(batch.view(), arrays);
    const Solver solver(*device_, options);
    const StreamRef stream{static_cast<void*>(stream_)};
    const Plan plan = solver.plan(view, stream);
    for (int round = 0; round < rounds; ++round) {
      const SolutionView<Real> solution{arrays.make<Real>(view.row_count), arrays.make<Real>(view.row_count),
                                        arrays.make<EnvStatus>(view.env_count)};
      solver.solve(plan, view, solution, static_cast<const Real*>(nullptr), stream);
      Solution<Real> host{std::vector<Real>(expected.lambda.size()), std::vector<Real>(expected.w.size()),
                          std::vector<EnvStatus>(expected.status.size())};
      const auto fetch = [this](auto& target, const auto* source) {
        STICTION_CUDA_TRY(
            cudaMemcpyAsync(target.data(), source, target.size() * sizeof(target[0]), cudaMemcpyDeviceToHost, stream_));
      };
      fetch(host.lambda, solution.lambda);
      fetch(host.w, solution.w);
      fetch(host.status, solution.status);
      STICTION_CUDA_TRY(cudaStreamSynchronize(stream_));
      EXPECT_TRUE(same_bits(expected, host)) << "round " << round;
    }
  }

  std::optional<Device> device_;
  cudaStream_t stream_ = nullptr;
};

TEST_F(CudaMemory, ABatchOnTheDeviceHasTheBitsOfTheHostOnAStreamOfTheCallers) {
  for (const SolverKind solver : kAllSolvers) {
    SCOPED_TRACE(to_string(solver));
    SolverOptions chosen = options(solver, 1e-6, 40);
    chosen.invalid = InvalidPolicy::isolate;
    expect_same_on_device(ragged_batch(2, 5), chosen, 2);
    expect_same_on_device(convert<float>(ragged_batch(2, 5)), chosen, 2);
  }
}

TEST_F(CudaMemory, AFailingCallThrowsWithItsNameAndLeavesNoErrorBehind) {
  try {
    void* memory = nullptr;
    STICTION_CUDA_TRY(cudaMalloc(&memory, std::size_t{1} << 60));
    FAIL() << "an exabyte was allocated";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::out_of_memory);
    EXPECT_NE(std::string(error.what()).find("cudaMalloc"), std::string::npos) << error.what();
  }
  EXPECT_EQ(cudaPeekAtLastError(), cudaSuccess);
}

TEST_F(CudaMemory, ADeviceThatIsNotThereIsNamedWithThoseThatAre) {
  try {
    const Solver solver(Device::cuda(1000), SolverOptions{});
    FAIL() << "a solver was made on cuda:1000";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::no_device);
    EXPECT_NE(std::string(error.what()).find("cuda:1000 is not there"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace stiction::test

#endif
