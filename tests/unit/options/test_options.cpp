#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>

#include "core/runtime/check/check_options.hpp"
#include "stiction/error.hpp"
#include "stiction/solver.hpp"
#include "stiction/status.hpp"

namespace {

using namespace stiction;

/// The message of the error, or "no error"; its code must be invalid_argument.
std::string complaint(const std::function<void(SolverOptions&)>& change) {
  SolverOptions options;
  change(options);
  try {
    check_options(options);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::invalid_argument);
    return error.what();
  }
  return "no error";
}

TEST(Options, DefaultsAreAccepted) {
  EXPECT_EQ(complaint([](SolverOptions&) {}), "no error");
}

TEST(Options, LimitsThemselvesAreAccepted) {
  EXPECT_EQ(complaint([](SolverOptions& o) {
              o.tolerance = 0;
              o.max_iterations = 0;
              o.stall_window = 0;
              o.threads = 0;
            }),
            "no error");
}

TEST(Options, EveryNumberOutOfRangeIsNamedWithItsValueAndTheRemedy) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(complaint([](SolverOptions& o) { o.tolerance = -1; }),
            "tolerance = -1.000000: must be finite and >= 0 (0 runs all iterations)");
  for (const double bad : {nan, infinity})
    EXPECT_EQ(complaint([bad](SolverOptions& o) { o.tolerance = bad; }).rfind("tolerance = ", 0), 0U);
  EXPECT_EQ(complaint([](SolverOptions& o) { o.max_iterations = -3; }), "max_iterations = -3: must be >= 0");
  EXPECT_EQ(complaint([](SolverOptions& o) { o.stall_window = -1; }),
            "stall_window = -1: must be >= 0 (0 never gives up)");
  EXPECT_EQ(complaint([](SolverOptions& o) { o.threads = -2; }), "threads = -2: must be >= 0 (0 takes all cores)");
  for (const double bad : {0.0, 2.0, -0.5, 2.5, nan})
    EXPECT_NE(complaint([bad](SolverOptions& o) { o.omega = bad; }).find("0 < omega < 2"), std::string::npos) << bad;
}

TEST(Options, MatricesMayBeLargerWhereTheUserHasTheMemoryAndTheDeviceIsTheCpu) {
  EXPECT_EQ(complaint([](SolverOptions& o) { o.direct_rows = 32768; }), "no error");
  for (const Index bad : {-1, 0, 1023, 32769})
    EXPECT_EQ(complaint([bad](SolverOptions& o) { o.direct_rows = bad; }),
              "direct_rows = " + std::to_string(bad) + ": must be from 1024 to 32768");
  EXPECT_EQ(
      complaint([](SolverOptions& o) {
        o.solver = SolverKind::automatic;
        o.direct_rows = 2048;
      }),
      "direct_rows = 2048: solver auto chooses for matrices of up to 1024 rows; name a solver, or leave direct_rows "
      "as it is");
  SolverOptions options;
  options.direct_rows = 2048;
  try {
    const Solver solver(Device::emulated(), options);
    FAIL() << "a device took it";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::invalid_argument);
    EXPECT_EQ(std::string(error.what()).rfind("direct_rows = 2048: a device's memory is laid out", 0), 0U)
        << error.what();
  }
}

TEST(Options, IslandModesAreFoundByTheirNamesAndNoOthersAreTaken) {
  for (const IslandMode mode : {IslandMode::together, IslandMode::apart})
    EXPECT_EQ(island_mode_from_string(to_string(mode)), mode);
  try {
    island_mode_from_string("adrift");
    FAIL() << "an unknown name was accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::invalid_argument);
    EXPECT_STREQ(error.what(), "island mode 'adrift' is not known; use one of: together, apart");
  }
  EXPECT_EQ(complaint([](SolverOptions& o) { o.islands = static_cast<IslandMode>(7); }),
            "islands = 7: no such mode; use IslandMode::together or apart");
}

TEST(Options, SolversAreFoundByTheirNames) {
  for (const SolverKind solver : {SolverKind::pgs, SolverKind::npgs, SolverKind::jacobi, SolverKind::apgd})
    EXPECT_EQ(solver_from_string(to_string(solver)), solver);
  try {
    solver_from_string("newtron");
    FAIL() << "an unknown name was accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::invalid_argument);
    for (const char* name : {"newtron", "pgs", "npgs", "jacobi", "apgd"})
      EXPECT_NE(std::string(error.what()).find(name), std::string::npos) << error.what();
  }
}

TEST(Options, DevicesAreFoundByTheirNames) {
  EXPECT_EQ(Device::from_string("cpu").kind, DeviceKind::cpu);
  EXPECT_EQ(Device::from_string("emulated").kind, DeviceKind::emulated);
  EXPECT_NO_THROW(Device::from_string("auto"));
  for (const char* text :
       {"", "gpu", "CPU", "cuda:", "cuda:x", "cuda:-1", "cuda:1x", "cuda:12345", "cuda 0", "cpu:0"}) {
    try {
      Device::from_string(text);
      ADD_FAILURE() << "'" << text << "' was accepted";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::invalid_argument) << error.what();
      EXPECT_NE(std::string(error.what()).find("choose auto, cpu, cuda, cuda:N or emulated"), std::string::npos);
    }
  }
}

TEST(Options, ADeviceThatIsNotThereSaysWhy) {
  try {
    Device::from_string("cuda:99");
    GTEST_SKIP() << "this machine has a hundred GPUs";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::no_device);
    EXPECT_NE(std::string(error.what()).find("'cuda:99' is not usable: "), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("use cpu or auto"), std::string::npos);
  }
}

}  // namespace
