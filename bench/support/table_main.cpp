#include "bench/support/table_main.hpp"

#include <cstdio>
#include <filesystem>

#include "stiction/error.hpp"

int main(int argc, char** argv) {
  try {
    return stiction::bench::run(argc, argv);
  } catch (const stiction::Error& error) {
    std::fprintf(stderr, "%s: %s\n", std::filesystem::path(argv[0]).filename().c_str(), error.what());
    return 2;
  }
}
