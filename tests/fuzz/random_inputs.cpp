// The checks of fuzz_solve on inputs drawn at random, without a fuzzer: seconds of the test suite, with any compiler.
//
//   fuzz_random [SEED [FIRST [COUNT]]]      default: 1 0 50000
//
// An input depends on the seed and its number alone. A finding names it, and `fuzz_random SEED NUMBER 1` repeats it.

#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);  // fuzz_solve.cpp

namespace {

long number = 0;

void name_input(int) {
  std::fprintf(stderr, "input %ld\n", number);
  std::_Exit(1);
}

/// Bytes of one of four kinds: any; small ones, of which choices are made; two alternating; mostly one.
std::vector<std::uint8_t> draw(std::uint32_t seed, long of) {
  std::seed_seq start{seed, static_cast<std::uint32_t>(of)};
  std::mt19937 random(start);
  const auto kind = random() % 4;
  std::vector<std::uint8_t> bytes(20 + random() % 492);
  const auto any = [&] { return static_cast<std::uint8_t>(random()); };
  const std::uint8_t often = any();
  for (std::size_t k = 0; k < bytes.size(); ++k) {
    std::uint8_t& byte = bytes[k] = any();
    if (kind == 1 && k >= 8 && random() % 3 != 0) byte %= 16;
    if (kind == 2 && random() % 2 == 0) byte = often;
    if (kind == 3 && random() % 3 != 0) byte = often;
  }
  return bytes;
}

}  // namespace

int main(int argc, char** argv) {
  const auto argument = [&](int k, long otherwise) { return argc > k ? std::atol(argv[k]) : otherwise; };
  const auto seed = static_cast<std::uint32_t>(argument(1, 1));
  const long first = argument(2, 0), count = argument(3, 50000);
  std::signal(SIGILL, name_input);   // signal of a broken promise on x86,
  std::signal(SIGTRAP, name_input);  // and elsewhere
  for (number = first; number < first + count; ++number) {
    const std::vector<std::uint8_t> input = draw(seed, number);
    LLVMFuzzerTestOneInput(input.data(), input.size());
  }
  std::printf("%ld inputs of seed %u, no finding\n", count, seed);
}
