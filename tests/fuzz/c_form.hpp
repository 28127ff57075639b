#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

#include "stiction.h"
#include "tests/fuzz/numbers.hpp"

/// A struct of the C interface over arrays that are exactly as long as in stiction.h, so that reading past one of them
/// is seen. There are edits of it that a hostile caller could make without breaking that rule.
namespace stiction::fuzz {

/// Any value for an integer of the interface, including those near `value`.
template <class T>
T wild_integer(Bytes& bytes, T value) {
  using Limits = std::numeric_limits<T>;
  const T edges[] = {T(0),
                     T(1),
                     T(-1),
                     Limits::max(),
                     Limits::min(),
                     T(value + T(value < Limits::max())),
                     T(value - T(value > Limits::min())),
                     T(bytes.byte())};
  return bytes.one_of(edges);
}

template <class View>
class CForm {
 public:
  View view{};

  CForm() = default;
  CForm(CForm&&) noexcept = default;
  CForm& operator=(CForm&&) noexcept = default;

  /// Adds an array that the struct points to at `where`; absent: null until an edit shows it.
  template <class T>
  void array(std::size_t where, const std::vector<T>& values, bool absent = false) {
    Array made{where, kind_of<T>(), values.size(), std::vector<std::uint8_t>(values.size() * sizeof(T)), absent};
    if (!values.empty()) std::memcpy(made.bytes.data(), values.data(), made.bytes.size());
    arrays_.push_back(std::move(made));
    show(arrays_.back());
  }
  template <class T>
  void array(std::size_t where, const T* values, std::int64_t count) {
    array(where, std::vector<T>(values, values + count));
  }
  /// Adds a field that is a length of arrays: edits make it smaller only.
  void length(std::size_t where) { lengths_.push_back(where); }
  /// Adds a field of int32_t that edits may set to anything.
  void choice(std::size_t where) { choices_.push_back(where); }

  /// Returns true if the pointer at `where` is not null.
  [[nodiscard]] bool is_present(std::size_t where) const { return get<const void*>(where) != nullptr; }

  /// One edit. Returns the environment that it reaches, of `envs` equal ones; -1: more than one.
  int edit(Bytes& bytes, int envs) {
    const int what = bytes.below(8);
    if (what == 0 && !lengths_.empty()) {
      edit_length(bytes);
    } else if (what == 1 && !choices_.empty()) {
      const std::size_t where = choices_[bytes.byte() % choices_.size()];
      set<std::int32_t>(where, wild_integer(bytes, get<std::int32_t>(where)));
    } else if (what == 2) {
      Array& array = arrays_[bytes.byte() % arrays_.size()];
      array.absent = !array.absent;
      show(array);
    } else {
      return edit_entry(bytes, envs);
    }
    return -1;
  }

 private:
  enum class Kind : std::uint8_t { i64, i32, u32, u8, f64, f32 };
  struct Array {
    std::size_t where;
    Kind kind;
    std::size_t count;
    std::vector<std::uint8_t> bytes;
    bool absent;
  };

  template <class T>
  static constexpr Kind kind_of() {
    if constexpr (std::is_same_v<T, std::int64_t>) return Kind::i64;
    if constexpr (std::is_same_v<T, std::int32_t>) return Kind::i32;
    if constexpr (std::is_same_v<T, std::uint32_t>) return Kind::u32;
    if constexpr (std::is_same_v<T, std::uint8_t>) return Kind::u8;
    if constexpr (std::is_same_v<T, double>) return Kind::f64;
    if constexpr (std::is_same_v<T, float>) return Kind::f32;
  }

  template <class T>
  T get(std::size_t where) const {
    T value;
    std::memcpy(&value, reinterpret_cast<const char*>(&view) + where, sizeof value);
    return value;
  }
  template <class T>
  void set(std::size_t where, T value) {
    std::memcpy(reinterpret_cast<char*>(&view) + where, &value, sizeof value);
  }
  /// An array of no entries is a place and not null.
  void show(Array& array) {
    static std::uint8_t no_entries[1];
    const void* place = array.bytes.empty() ? no_entries : array.bytes.data();
    set<const void*>(array.where, array.absent ? nullptr : place);
  }

  void edit_length(Bytes& bytes) {
    const std::size_t where = lengths_[bytes.byte() % lengths_.size()];
    const auto now = get<std::int64_t>(where);
    constexpr std::int64_t kSmallest = std::numeric_limits<std::int64_t>::min();
    const std::int64_t smaller[] = {0, now > kSmallest ? now - 1 : now, now / 2, -1, kSmallest};
    const std::int64_t next = bytes.one_of(smaller);
    if (next <= now) set<std::int64_t>(where, next);
  }

  template <class T, class Make>
  static void change(Array& array, std::size_t entry, Make make) {
    T value;
    std::memcpy(&value, array.bytes.data() + entry * sizeof(T), sizeof value);
    value = make(value);
    std::memcpy(array.bytes.data() + entry * sizeof(T), &value, sizeof value);
  }

  int edit_entry(Bytes& bytes, int envs) {
    Array& array = arrays_[bytes.byte() % arrays_.size()];
    if (array.count == 0) return -1;
    const std::size_t entry = bytes.byte() % array.count;
    const auto any = [&](auto value) { return wild_integer(bytes, value); };
    if (array.kind == Kind::i64) change<std::int64_t>(array, entry, any);
    if (array.kind == Kind::i32) change<std::int32_t>(array, entry, any);
    if (array.kind == Kind::u32) change<std::uint32_t>(array, entry, any);
    if (array.kind == Kind::u8) change<std::uint8_t>(array, entry, any);
    if (array.kind == Kind::f64) change<double>(array, entry, [&](double) { return wild<double>(bytes); });
    if (array.kind == Kind::f32) change<float>(array, entry, [&](float) { return wild<float>(bytes); });
    const bool divides = array.count % static_cast<std::size_t>(envs) == 0;
    return divides ? static_cast<int>(entry / (array.count / static_cast<std::size_t>(envs))) : -1;
  }

  std::vector<Array> arrays_;
  std::vector<std::size_t> lengths_, choices_;
};

}  // namespace stiction::fuzz
