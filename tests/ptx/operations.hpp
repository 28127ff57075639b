#pragma once

#include <bit>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <type_traits>

#include "tests/ptx/lane.hpp"

/// Instructions that C++ defines otherwise: NVIDIA, "Parallel Thread Execution ISA", version 9.0, section 9.
namespace stiction::ptx {

template <class To, class From>
To bits_as(From value) {
  return std::bit_cast<To>(value);
}

[[noreturn]] inline void misaligned(u64 address, std::size_t bytes) {
  std::fprintf(stderr, "PTX: an access of %zu bytes at %#llx, which is not aligned\n", bytes,
               static_cast<unsigned long long>(address));
  std::abort();
}
inline u64 aligned(u64 address, std::size_t bytes) {
  if (address % bytes != 0) misaligned(address, bytes);
  return address;
}
template <class T>
T load(u64 address) {
  T value;
  std::memcpy(&value, reinterpret_cast<const void*>(aligned(address, sizeof(T))), sizeof(T));
  return value;
}
template <class T>
void store(u64 address, T value) {
  std::memcpy(reinterpret_cast<void*>(aligned(address, sizeof(T))), &value, sizeof(T));
}
/// Fills memory with bytes that no program may rely on.
inline void poison(unsigned char* memory, std::size_t bytes) {
  std::memset(memory, 0xcb, bytes);
}

template <class T>
T atomic_add(u64 address, T value) {
  const T old = load<T>(address);
  store<T>(address, static_cast<T>(old + value));
  return old;
}
template <class T>
T atomic_or(u64 address, T value) {
  const T old = load<T>(address);
  store<T>(address, static_cast<T>(old | value));
  return old;
}
template <class T>
T atomic_and(u64 address, T value) {
  const T old = load<T>(address);
  store<T>(address, static_cast<T>(old & value));
  return old;
}
template <class T>
T atomic_max(u64 address, T value) {
  const T old = load<T>(address);
  if (value > old) store<T>(address, value);
  return old;
}
template <class T>
T atomic_min(u64 address, T value) {
  const T old = load<T>(address);
  if (value < old) store<T>(address, value);
  return old;
}
template <class T>
T atomic_exch(u64 address, T value) {
  const T old = load<T>(address);
  store<T>(address, value);
  return old;
}

template <class T>
bool is_ordered(T x, T y) {
  return x == x && y == y;
}
template <class T>
T fused(T x, T y, T z) {
  return std::fma(x, y, z);
}
template <class T>
T square_root(T x) {
  return std::sqrt(x);
}
/// The sign bit alone, of NaN too.
template <class T>
T negative(T x) {
  if constexpr (std::is_floating_point_v<T>) return std::copysign(x, std::signbit(x) ? T(1) : T(-1));
  return static_cast<T>(0 - static_cast<std::make_unsigned_t<std::conditional_t<std::is_integral_v<T>, T, int>>>(x));
}
template <class T>
T magnitude(T x) {
  if constexpr (std::is_floating_point_v<T>) return std::copysign(x, T(1));
  return x < 0 ? negative(x) : x;
}
/// -0 is less than +0; a number wins over NaN.
template <class T>
T smaller(T x, T y) {
  if constexpr (std::is_floating_point_v<T>) {
    if (x != x) return y;
    if (y != y) return x;
    if (x == y) return std::signbit(x) ? x : y;
  }
  return x < y ? x : y;
}
template <class T>
T larger(T x, T y) {
  if constexpr (std::is_floating_point_v<T>) {
    if (x != x) return y;
    if (y != y) return x;
    if (x == y) return std::signbit(x) ? y : x;
  }
  return x > y ? x : y;
}

template <class T>
inline constexpr u32 kBits = 8 * sizeof(T);
template <class T>
T shift_left(T x, u32 count) {
  return count >= kBits<T> ? T(0) : static_cast<T>(x << count);
}
template <class T>
T shift_right(T x, u32 count) {
  const u32 most = kBits<T> - 1;
  if (std::is_unsigned_v<T> && count > most) return 0;
  return static_cast<T>(x >> (count > most ? most : count));
}
template <class T>
T quotient(T x, T y) {
  if (y == 0) return static_cast<T>(~T(0));
  if (std::is_signed_v<T> && y == static_cast<T>(-1)) return negative(x);
  return static_cast<T>(x / y);
}
template <class T>
T remainder(T x, T y) {
  if (y == 0) return x;
  return std::is_signed_v<T> && y == static_cast<T>(-1) ? T(0) : static_cast<T>(x % y);
}
template <class T>
T high_product(T x, T y) {
  static_assert(sizeof(T) == 4 || sizeof(T) == 8);
  __extension__ using Wide8 = std::conditional_t<std::is_signed_v<T>, __int128, unsigned __int128>;
  using Wide4 = std::conditional_t<std::is_signed_v<T>, i64, u64>;
  using Wide = std::conditional_t<sizeof(T) == 4, Wide4, Wide8>;
  return static_cast<T>((Wide(x) * Wide(y)) >> kBits<T>);
}
template <class T>
T insert_bits(T field, T into, u32 first, u32 count) {
  first &= 255U;
  count &= 255U;
  if (first >= kBits<T> || count == 0) return into;
  if (count > kBits<T> - first) count = kBits<T> - first;
  const T mask = shift_left(static_cast<T>(count == kBits<T> ? ~T(0) : (T(1) << count) - 1), first);
  return static_cast<T>((into & ~mask) | (shift_left(field, first) & mask));
}
template <class T>
T extract_bits(T from, u32 first, u32 count) {
  first &= 255U;
  count &= 255U;
  using Unsigned = std::make_unsigned_t<T>;
  const u32 end = first + count < kBits<T> ? first + count : kBits<T>;
  const bool sign = std::is_signed_v<T> && count > 0 && (Unsigned(from) >> (end - 1) & 1U) != 0;
  Unsigned result = 0;
  for (u32 k = 0; k < kBits<T>; ++k) {
    const bool bit = k < count && first + k < kBits<T> ? (Unsigned(from) >> (first + k) & 1U) != 0 : sign;
    result |= Unsigned(bit) << k;
  }
  return static_cast<T>(result);
}
template <class T>
T permute_bytes(T low, T high, T selectors) {
  const u64 bytes = u64(high) << 32U | low;
  u32 result = 0;
  for (u32 k = 0; k < 4; ++k) {
    const u32 selector = selectors >> 4U * k & 15U;
    u32 byte = static_cast<u32>(bytes >> 8U * (selector & 7U)) & 255U;
    if ((selector & 8U) != 0) byte = (byte & 128U) != 0 ? 255U : 0U;
    result |= byte << 8U * k;
  }
  return result;
}
template <class T>
u32 leading_zeros(T x) {
  return static_cast<u32>(std::countl_zero(static_cast<std::make_unsigned_t<T>>(x)));
}
template <class T>
T reverse_bits(T x) {
  T result = 0;
  for (u32 k = 0; k < kBits<T>; ++k) result = static_cast<T>(result | (x >> k & 1U) << (kBits<T> - 1 - k));
  return result;
}
/// To an integer, towards zero, the nearest representable one; NaN to 0, or to 2^63 where that has 64 bits.
template <class To, class From>
To truncated(From x) {
  if (x != x) return sizeof(To) == 8 ? static_cast<To>(1ULL << 63U) : To(0);
  const From whole = std::trunc(x);
  if (whole <= static_cast<From>(std::numeric_limits<To>::min())) return std::numeric_limits<To>::min();
  if (whole >= static_cast<From>(std::numeric_limits<To>::max())) return std::numeric_limits<To>::max();
  return static_cast<To>(whole);
}

}  // namespace stiction::ptx
