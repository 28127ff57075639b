#include <cstddef>
#include <cstdint>
#include <span>

#include "core/io/readers.hpp"
#include "stiction/error.hpp"

// libFuzzer's entry: any bytes, read as every kind of file there is, end in a result or in an Error(bad_file), and what
// was read can be handed to validate().
namespace {

template <class Read>
void expect_result_or_refusal(Read read) {
  try {
    read();
  } catch (const stiction::Error& error) {
    if (error.code() != stiction::ErrorCode::bad_file) __builtin_trap();
  }
}

}  // namespace

/// HDF5 asks malloc for whatever a damaged header says and copes with a refusal; it also leaks what it had of a damaged
/// object. Neither is a finding: memory that is really used is bounded by -rss_limit_mb.
extern "C" const char* __asan_default_options() {
  return "allocator_may_return_null=1:detect_leaks=0";
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  namespace io = stiction::io;
  const auto image = std::as_bytes(std::span(data, size));
  expect_result_or_refusal([&] {
    const io::Recording recording = io::read_any(io::InputFile(image, "fuzzed"));
    const auto view = recording.batch.view();
    if (stiction::validate(view).empty()) stiction::asymmetry(view);
  });
  expect_result_or_refusal([&] { io::read_solution(io::InputFile(image, "fuzzed")); });
  return 0;
}
