#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "bench/support/csv.hpp"

namespace stiction::bench {

/// "a,b,c" in parts.
std::vector<std::string> comma_parts(const std::string& text);

/// Parses `text`, a value of `name`, as a number. \throws Error(invalid_argument) if it is not one.
double to_number(const std::string& name, const std::string& text);
/// Parses `text`, a value of `name`, as a count. \throws Error(invalid_argument) if it is not one or less than `least`.
int to_count(const std::string& name, const std::string& text, int least = 1);

/// Arguments of a benchmark: `--name value` pairs, each name one that has a default. `--csv PATH` is always one of
/// them.
class Arguments {
 public:
  /// \throws Error(invalid_argument) for a name that has no default, or no value.
  Arguments(int argc, char** argv, std::map<std::string, std::string> defaults);

  [[nodiscard]] const std::string& text(const std::string& name) const;
  [[nodiscard]] std::vector<std::string> texts(const std::string& name) const;
  [[nodiscard]] double number(const std::string& name) const;
  [[nodiscard]] std::vector<double> numbers(const std::string& name) const;
  /// \throws Error(invalid_argument) for less than `least`.
  [[nodiscard]] int count(const std::string& name, int least = 1) const;
  [[nodiscard]] std::vector<int> counts(const std::string& name, int least = 1) const;

  /// The file of `--csv`; null if there is to be none.
  [[nodiscard]] std::unique_ptr<Csv> csv(const std::string& header) const;

 private:
  std::string command_;
  std::map<std::string, std::string> values_;
};

}  // namespace stiction::bench
