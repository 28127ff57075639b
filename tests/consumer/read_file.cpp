#include <cstdio>
#include <exception>

#include "stiction/io.hpp"

// A file that is not there must be refused with a sentence.
int main() {
  try {
    stiction::io::read_batch("no_such_file.h5");
  } catch (const std::exception& error) {
    std::printf("%s\n", error.what());
    return 0;
  }
  return 1;
}
