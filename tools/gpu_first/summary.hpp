#pragma once

#include <map>
#include <string>
#include <vector>

namespace stiction::gpu_first {

/// A few lines that a person reads first: the checks' numbers, by subject, and failures.
class Summary {
 public:
  static constexpr std::size_t kMostLines = 40;

  /// Keeps "> subject | text" of a check's output; anything else is left out.
  void hear(const std::string& line);
  void add_wrong(const std::string& line) { wrong_.push_back(line); }
  /// `head` and then the rest, at most kMostLines lines.
  [[nodiscard]] std::vector<std::string> lines(const std::string& head) const;

 private:
  std::vector<std::string> subjects_;  ///< in the order in which they came
  std::map<std::string, std::string> said_;
  std::vector<std::string> wrong_;
};

}  // namespace stiction::gpu_first
