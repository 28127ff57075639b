#include "tests/fuzz/checks.hpp"
#include "tests/fuzz/sanitizer_options.hpp"

// libFuzzer's entry: environments of any numbers, one of them spoiled, under any solver.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  stiction::fuzz::Bytes bytes(data, size);
  switch (bytes.below(4)) {
    case 0:
      stiction::fuzz::check_bodies(bytes);
      break;
    case 1:
      stiction::fuzz::check_jacobians(bytes);
      break;
    default:
      stiction::fuzz::check_contacts(bytes);
      break;
  }
  return 0;
}
