#include "core/io/guard/text_heap.hpp"

#include <algorithm>
#include <cstring>

namespace stiction::io {
namespace {

constexpr std::size_t kHeader = 16;  // of a collection, and of an object in it
constexpr std::uint64_t kAlignment = 8;

}  // namespace

const TextHeap::Collection* TextHeap::collection(std::uint64_t address) {
  const auto known = collections_.find(address);
  if (known != collections_.end()) return &known->second;

  char header[kHeader];
  if (address > UINT64_MAX / 2 || !bytes_.read(base_ + address, header)) return nullptr;
  const std::uint64_t size = little_endian(header + 8, 8);
  if (std::memcmp(header, "GCOL\1", 5) != 0 || size < kHeader || size > heap_bytes_left_) return nullptr;
  heap_bytes_left_ -= size;
  Collection fresh;
  fresh.bytes.resize(size);
  if (!bytes_.read(base_ + address, fresh.bytes)) return nullptr;
  for (std::size_t at = kHeader; size - at >= kHeader;) {
    const std::uint64_t index = little_endian(fresh.bytes.data() + at, 2);
    const std::uint64_t length = little_endian(fresh.bytes.data() + at + 8, 8);
    if (index == 0) break;  // the rest is free
    at += kHeader;
    if (length > size - at) return nullptr;
    fresh.objects[index] = {at, static_cast<std::size_t>(length)};
    at = std::min<std::size_t>(size, at + (length + kAlignment - 1) / kAlignment * kAlignment);
  }
  return &collections_.emplace(address, std::move(fresh)).first->second;
}

std::optional<std::string> TextHeap::text(std::span<const char, kTextReference> reference) {
  const std::uint64_t length = little_endian(reference.data(), 4);
  const std::uint64_t address = little_endian(reference.data() + 4, 8);
  const std::uint64_t index = little_endian(reference.data() + 12, 4);
  if (length == 0) return std::string();
  const Collection* heap = collection(address);
  if (heap == nullptr || length > text_bytes_left_) return std::nullopt;
  const auto object = heap->objects.find(index);
  if (object == heap->objects.end() || length > object->second.size) return std::nullopt;
  text_bytes_left_ -= length;
  const char* begin = heap->bytes.data() + object->second.begin;
  return std::string(begin, std::find(begin, begin + length, '\0'));
}

}  // namespace stiction::io
