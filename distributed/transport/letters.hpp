#pragma once

#include <cstring>
#include <span>
#include <type_traits>
#include <vector>

#include "distributed/transport/transport.hpp"

/// Messages whose length the receiver does not know.
namespace stiction::distributed {

/// Plain numbers, put in and taken out in one order.
class Letter {
 public:
  Letter() = default;
  explicit Letter(std::size_t bytes) : bytes_(bytes) {}

  template <class T>
  void put(const T& value) {
    static_assert(std::is_trivially_copyable_v<T> && !std::is_pointer_v<T>);
    const auto* from = reinterpret_cast<const std::byte*>(&value);
    bytes_.insert(bytes_.end(), from, from + sizeof(T));
  }
  template <class T>
  T take() {
    static_assert(std::is_trivially_copyable_v<T>);
    if (bytes_.size() - read_ < sizeof(T)) throw RankLost("a message is truncated");
    T value;
    std::memcpy(&value, bytes_.data() + read_, sizeof(T));
    read_ += sizeof(T);
    return value;
  }
  [[nodiscard]] bool at_end() const { return read_ == bytes_.size(); }
  [[nodiscard]] std::size_t size() const { return bytes_.size(); }
  [[nodiscard]] std::span<const std::byte> bytes() const { return bytes_; }
  [[nodiscard]] std::span<std::byte> bytes() { return bytes_; }

 private:
  std::vector<std::byte> bytes_;
  std::size_t read_ = 0;
};

/// A letter to every rank, empty where nothing is sent, and every rank's letter to this one. All ranks call it. Each
/// sends and gets messages only of ranks with data for one another. \throws RankLost
std::vector<Letter> exchange_with_all(Transport& transport, const std::vector<Letter>& out);

/// A letter to each of these other ranks, and one from each. They call it, too. \throws RankLost
std::vector<Letter> exchange_with(Transport& transport, std::span<const int> ranks, const std::vector<Letter>& out);

/// One value of every rank, by rank. \throws RankLost
template <class T>
std::vector<T> gather(Transport& transport, const T& mine) {
  static_assert(std::is_trivially_copyable_v<T>);
  std::vector<T> all(static_cast<std::size_t>(transport.size()));
  transport.all_gather(std::as_bytes(std::span(&mine, 1)), std::as_writable_bytes(std::span(all)));
  return all;
}

/// As many values of every rank, one rank's after the other's. \throws RankLost
template <class T>
std::vector<T> gather_all(Transport& transport, std::span<const T> mine) {
  static_assert(std::is_trivially_copyable_v<T>);
  std::vector<T> all(mine.size() * static_cast<std::size_t>(transport.size()));
  transport.all_gather(std::as_bytes(mine), std::as_writable_bytes(std::span(all)));
  return all;
}

}  // namespace stiction::distributed
