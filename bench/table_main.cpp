#include "bench/table_main.hpp"

#include <cstdio>
#include <filesystem>
#include <sstream>

#include "stiction/error.hpp"

namespace stiction::bench {

std::vector<std::string> comma_parts(const std::string& text) {
  std::vector<std::string> parts;
  std::istringstream in(text);
  for (std::string part; std::getline(in, part, ',');) parts.push_back(part);
  return parts;
}

}  // namespace stiction::bench

int main(int argc, char** argv) {
  try {
    return stiction::bench::run(argc, argv);
  } catch (const stiction::Error& error) {
    std::fprintf(stderr, "%s: %s\n", std::filesystem::path(argv[0]).filename().c_str(), error.what());
    return 2;
  }
}
