#pragma once

#include "core/base/macros.hpp"
#include "stiction/types.hpp"

namespace stiction::inline STICTION_ISA {

/// An array whose neighbours lie kStride apart. kStride is 1 for a single environment, W for one lane of a CPU pack,
/// 32 for one lane of a warp. An algorithm sees an index alone.
template <class T, int kStride>
struct Strided {
  T* data = nullptr;
  STICTION_HD T& operator[](Index i) const { return data[static_cast<Offset>(i) * kStride]; }
  [[nodiscard]] STICTION_HD Strided from(Offset i) const { return {data + i * kStride}; }
};

}  // namespace stiction::inline STICTION_ISA
