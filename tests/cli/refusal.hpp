#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "tests/cli/process.hpp"

namespace stiction::test {

/// Succeeds if a command refused: exit status 2, nothing on stdout, one sentence on stderr that says all of `said`.
inline testing::AssertionResult is_refused(const Finished& finished, const std::vector<std::string>& said) {
  const auto lines = std::count(finished.err.begin(), finished.err.end(), '\n');
  if (finished.status != 2) return testing::AssertionFailure() << "exit status " << finished.status << ", not 2";
  if (finished.err.rfind("stiction: ", 0) != 0 || lines != 1) {
    return testing::AssertionFailure() << "not one sentence of stiction's: " << finished.err;
  }
  if (!finished.out.empty()) return testing::AssertionFailure() << "stdout is not empty: " << finished.out;
  for (const std::string& text : said) {
    if (finished.err.find(text) == std::string::npos) {
      return testing::AssertionFailure() << "'" << text << "' is missing in: " << finished.err;
    }
  }
  return testing::AssertionSuccess();
}

}  // namespace stiction::test
