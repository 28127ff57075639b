#pragma once

#include <cstddef>
#include <memory>
#include <new>

#include "stiction/types.hpp"

namespace stiction::cpu {

/// Scratch of one thread, aligned for the widest vectors.
template <class Real>
class Scratch {
 public:
  Real* reserve(Offset elements) {
    if (elements > capacity_) {
      memory_.reset();
      memory_.reset(static_cast<Real*>(
          ::operator new (static_cast<std::size_t>(elements) * sizeof(Real), std::align_val_t{kAlignment})));
      capacity_ = elements;
    }
    return memory_.get();
  }

 private:
  static constexpr std::size_t kAlignment = 64;
  struct Free {
    void operator()(Real* memory) const { ::operator delete (memory, std::align_val_t{kAlignment}); }
  };
  std::unique_ptr<Real, Free> memory_;
  Offset capacity_ = 0;
};

}  // namespace stiction::cpu
