#include <optional>
#include <span>

#include "core/io/readers.hpp"
#include "stiction/error.hpp"
#include "tests/fuzz/require.hpp"
#include "tests/fuzz/sanitizer_options.hpp"

namespace {

namespace io = stiction::io;

/// Any reading ends in a result or in an Error(bad_file) with a sentence.
template <class Read>
void expect_result_or_refusal(Read read) {
  try {
    read();
  } catch (const stiction::Error& error) {
    stiction::fuzz::require(error.code() == stiction::ErrorCode::bad_file, "a damaged file is a bad file");
  }
}

/// A batch, and a caller's next steps with it.
void read_batch(const io::InputFile& file) {
  const io::Recording recording = io::read_any(file);
  const auto view = recording.batch.view();
  if (stiction::validate(view).empty()) stiction::asymmetry(view);
  try {
    io::jacobian_batch<float>(recording);
  } catch (const stiction::Error& error) {
    stiction::fuzz::require(error.code() == stiction::ErrorCode::invalid_argument,
                            "what is no Jacobian form is an invalid argument");
  }
}

}  // namespace

// libFuzzer's entry: any bytes, read as every kind of file there is. read_any distinguishes contact batches and local,
// global and rolling problems of FCLIB by content; the seeds have one or more of each.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto image = std::as_bytes(std::span(data, size));
  std::optional<io::InputFile> file;
  expect_result_or_refusal([&] { file.emplace(image, "fuzzed"); });
  if (!file) return 0;
  expect_result_or_refusal([&] { read_batch(*file); });
  expect_result_or_refusal([&] { io::read_solution(*file); });
  expect_result_or_refusal([&] { io::read_checkpoint(*file); });
  return 0;
}
