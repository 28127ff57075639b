#include "bench/support/csv.hpp"

#include <cstdio>

#include "bench/support/machine.hpp"
#include "stiction/error.hpp"

namespace stiction::bench {

Csv::Csv(const std::string& path, const std::string& command, const std::string& header) : file_(path) {
  if (!file_) throw Error(ErrorCode::io, "cannot write '" + path + "': make its folder first");
  file_ << "# " << command << '\n';
  for (const auto& [name, value] : describe_machine()) file_ << "# " << name << ": " << value << '\n';
  file_ << header << '\n';
}

void Csv::row(const std::vector<std::string>& cells) {
  for (std::size_t i = 0; i < cells.size(); ++i) file_ << (i > 0 ? "," : "") << cells[i];
  file_ << '\n' << std::flush;
}

std::string number(double value, int digits) {
  char text[40];
  std::snprintf(text, sizeof text, "%.*g", digits, value);
  return text;
}

}  // namespace stiction::bench
