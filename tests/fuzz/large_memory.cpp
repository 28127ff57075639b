#include <cstddef>
#include <cstdlib>
#include <new>

// The address sanitizer ends the program where `operator new` has no memory to give. The library promises to report
// that to its caller, so here it throws, as it does without a sanitizer.
namespace {

constexpr std::size_t kMostBytes = std::size_t{1} << 28;

void* given(std::size_t size) {
  void* memory = size <= kMostBytes ? std::malloc(size == 0 ? 1 : size) : nullptr;
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

}  // namespace

void* operator new(std::size_t size) {
  return given(size);
}
void* operator new[](std::size_t size) {
  return given(size);
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  return size <= kMostBytes ? std::malloc(size == 0 ? 1 : size) : nullptr;
}
void* operator new[](std::size_t size, const std::nothrow_t&) noexcept {
  return size <= kMostBytes ? std::malloc(size == 0 ? 1 : size) : nullptr;
}
void operator delete(void* memory) noexcept {
  std::free(memory);
}
void operator delete[](void* memory) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}
void operator delete[](void* memory, std::size_t) noexcept {
  std::free(memory);
}
void operator delete(void* memory, const std::nothrow_t&) noexcept {
  std::free(memory);
}
void operator delete[](void* memory, const std::nothrow_t&) noexcept {
  std::free(memory);
}
