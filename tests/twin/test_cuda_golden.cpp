#include <gtest/gtest.h>

#include <optional>
#include <string>

#include "tests/support/golden/cases.hpp"
#include "tests/support/machines/cuda_device.hpp"

/// The golden table computed on a GPU. Without a device every test here is skipped, with the reason.
namespace stiction::test {
namespace {

class CudaGolden : public ::testing::TestWithParam<const char*> {};

TEST_P(CudaGolden, EveryAnswerHasTheBitsOfTheTable) {
  std::string reason;
  const std::optional<Device> device = usable_cuda(reason);
  if (!device) GTEST_SKIP() << "no GPU to compare with: " << reason;
  const GoldenCases rows = golden_cases_of(GetParam());
  EXPECT_FALSE(rows.empty());
  for (const GoldenCase& row : rows) EXPECT_EQ(goldens().at(row.name), row.hash(*device)) << row.name;
}

INSTANTIATE_TEST_SUITE_P(Forms, CudaGolden, ::testing::ValuesIn(kGoldenForms),
                         [](const auto& form) { return std::string(form.param); });

}  // namespace
}  // namespace stiction::test
