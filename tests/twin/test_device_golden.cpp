#include <gtest/gtest.h>

#include <string>

#include "tests/support/golden/cases.hpp"

/// The golden table computed by the GPU's kernels and launches on the emulated device.
namespace stiction::test {
namespace {

/// Emulated factorisations of these take seconds each.
bool is_slow(const std::string& name) {
  const auto has = [&](const char* text) { return name.find(text) != std::string::npos; };
  if (name.rfind("worlds/", 0) == 0) return has("/newton/") && !has("/walker/");
  return (has("matrix/mixed") || has("matrix/pile")) && (has("/newton/") || has("/ipm/"));
}

class DeviceGolden : public ::testing::TestWithParam<const char*> {};

/// A method has a row for each law and precision: with every third row all of them get their turn, and all methods.
/// Robots have few rows, and are all computed.
TEST_P(DeviceGolden, EveryThirdAnswerHasTheBitsOfTheTable) {
  const std::string form = GetParam();
  const int stride = form == "robots" ? 1 : 3;
  int index = 0, compared = 0;
  for (const GoldenCase& row : golden_cases_of(form)) {
    if (index++ % stride != 0 || is_slow(row.name)) continue;
    EXPECT_EQ(goldens().at(row.name), row.hash(Device::emulated())) << row.name;
    ++compared;
  }
  EXPECT_GE(compared, 8);
}

INSTANTIATE_TEST_SUITE_P(Forms, DeviceGolden, ::testing::ValuesIn(kGoldenForms),
                         [](const auto& form) { return std::string(form.param); });
INSTANTIATE_TEST_SUITE_P(Derivatives, DeviceGolden, ::testing::Values(kGoldenDerivatives),
                         [](const auto& form) { return std::string(form.param); });

}  // namespace
}  // namespace stiction::test
