#pragma once

/// Options of the address sanitizer in every fuzzer. Refused memory is a case that the library copes with. HDF5 also
/// asks malloc for any size in a damaged header, and leaks memory of a damaged object. None of that is a finding:
/// memory that is really used is bounded by -rss_limit_mb. The rest is speed: less freed memory is kept, and shorter
/// stacks of where it came from; ASAN_OPTIONS=malloc_context_size=30 shows them whole.
extern "C" const char* __asan_default_options() {
  return "allocator_may_return_null=1:detect_leaks=0:quarantine_size_mb=32:malloc_context_size=4";
}
