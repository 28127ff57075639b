#pragma once

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <string>
#include <utility>
#include <vector>

namespace stiction::test {

/// Runs a property that returns a violation and names unsolved environments in its argument. With `always` every
/// system has to be solved. Else three of 60 may be left. For a solver that leaves one of ten thousand, to leave four
/// of 60 is less likely than 1e-10.
template <class Property>
void expect_always(bool always, Property&& property) {
  std::vector<std::string> left;
  EXPECT_TRUE(rc::check([&] {
    std::string unsolved;
    std::string violation = property(unsolved);
    if (always) violation += unsolved;
    if (!violation.empty()) RC_FAIL(violation);
    if (!unsolved.empty()) left.push_back(std::move(unsolved));
  }));
  EXPECT_LE(left.size(), 3U) << testing::PrintToString(left);
}

}  // namespace stiction::test
