#include "tests/fuzz/c_session.hpp"
#include "tests/fuzz/sanitizer_options.hpp"

namespace {

template <class Real>
void run(stiction::fuzz::Bytes& bytes) {
  constexpr int kMostCalls = 24;
  stiction::fuzz::Session<Real> session;
  for (int calls = 0; calls < kMostCalls && !bytes.empty(); ++calls) {
    if (bytes.once_in(32)) {
      stiction::fuzz::call_library(bytes);
    } else {
      session.call(bytes);
    }
  }
}

}  // namespace

// libFuzzer's entry: calls of the C interface, in any order, on handles and batches that edits have spoiled.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  stiction::fuzz::Bytes bytes(data, size);
  if (bytes.once_in(2)) {
    run<double>(bytes);
  } else {
    run<float>(bytes);
  }
  return 0;
}
