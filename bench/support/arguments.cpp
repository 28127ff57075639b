#include "bench/support/arguments.hpp"

#include <charconv>
#include <sstream>

#include "bench/support/machine.hpp"
#include "stiction/error.hpp"

namespace stiction::bench {

namespace {

[[noreturn]] void refuse(const std::string& text) {
  throw Error(ErrorCode::invalid_argument, text);
}

template <class T>
T parsed(const std::string& name, const std::string& text) {
  T value{};
  const char* const end = text.data() + text.size();
  const auto [stop, code] = std::from_chars(text.data(), end, value);
  if (code != std::errc{} || stop != end) refuse(name + ": '" + text + "' is no number");
  return value;
}

}  // namespace

double to_number(const std::string& name, const std::string& text) {
  return parsed<double>(name, text);
}

int to_count(const std::string& name, const std::string& text, int least) {
  const int value = parsed<int>(name, text);
  if (value < least) refuse(name + " = " + text + ": must be at least " + std::to_string(least));
  return value;
}

std::vector<std::string> comma_parts(const std::string& text) {
  std::vector<std::string> parts;
  std::istringstream in(text);
  for (std::string part; std::getline(in, part, ',');) parts.push_back(part);
  return parts;
}

Arguments::Arguments(int argc, char** argv, std::map<std::string, std::string> defaults)
    : command_(command_line(argc, argv)), values_(std::move(defaults)) {
  values_.emplace("--csv", "");
  for (int i = 1; i < argc; i += 2) {
    const auto known = values_.find(argv[i]);
    if (known == values_.end() || i + 1 >= argc) {
      std::string names;
      for (const auto& [name, value] : values_) names += (names.empty() ? "" : ", ") + name;
      refuse(std::string(argv[i]) + (known == values_.end() ? " is not known" : " needs a value") + ": use " + names +
             ", each with a value");
    }
    known->second = argv[i + 1];
  }
}

const std::string& Arguments::text(const std::string& name) const {
  return values_.at(name);
}

std::vector<std::string> Arguments::texts(const std::string& name) const {
  return comma_parts(text(name));
}

double Arguments::number(const std::string& name) const {
  return to_number(name, text(name));
}

std::vector<double> Arguments::numbers(const std::string& name) const {
  std::vector<double> all;
  for (const std::string& part : texts(name)) all.push_back(to_number(name, part));
  return all;
}

int Arguments::count(const std::string& name, int least) const {
  return to_count(name, text(name), least);
}

std::vector<int> Arguments::counts(const std::string& name, int least) const {
  std::vector<int> all;
  for (const std::string& part : texts(name)) all.push_back(to_count(name, part, least));
  return all;
}

std::unique_ptr<Csv> Arguments::csv(const std::string& header) const {
  return text("--csv").empty() ? nullptr : std::make_unique<Csv>(text("--csv"), command_, header);
}

}  // namespace stiction::bench
