#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdint>

/// Memory behind which a page lies that nothing may touch. The GPU's own code, executed by the CPU, has no sanitizer in
/// it: an access beyond an array ends the process there.
namespace stiction::cuda {

inline constexpr std::size_t kPageBytes = 4096;

/// Bytes of whole pages for so many bytes.
inline std::size_t whole_pages(std::size_t bytes) {
  return (bytes + kPageBytes - 1) / kPageBytes * kPageBytes;
}

/// `bytes`, a multiple of the wanted alignment, that end where the page begins; null if there are none.
inline void* allocate_guarded(std::size_t bytes) {
  const std::size_t pages = whole_pages(bytes);
  void* const memory = mmap(nullptr, pages + kPageBytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) return nullptr;
  auto* const guard = static_cast<std::byte*>(memory) + pages;
  mprotect(guard, kPageBytes, PROT_NONE);
  return guard - bytes;
}
inline void release_guarded(void* memory, std::size_t bytes) {
  const std::size_t pages = whole_pages(bytes);
  munmap(static_cast<std::byte*>(memory) + bytes - pages, pages + kPageBytes);
}

}  // namespace stiction::cuda
