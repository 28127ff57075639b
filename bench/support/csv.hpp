#pragma once

#include <fstream>
#include <string>
#include <vector>

namespace stiction::bench {

/// A file of comma-separated rows: line 1 is the command, then the machine, both behind '#', then the header.
class Csv {
 public:
  /// \throws Error(io) if the file cannot be written.
  Csv(const std::string& path, const std::string& command, const std::string& header);
  void row(const std::vector<std::string>& cells);

 private:
  std::ofstream file_;
};

/// Shortest text with `digits` significant digits.
std::string number(double value, int digits = 4);

}  // namespace stiction::bench
