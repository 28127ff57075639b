#pragma once

#include <cstdint>
#include <span>
#include <type_traits>

#include "distributed/transport/letters.hpp"
#include "stiction/bodies.hpp"
#include "stiction/hash.hpp"

namespace stiction::distributed {

/// Adds numbers and integers to a hash of all that reaches the bits, or is sent.
class Digest {
 public:
  template <class T>
  void add(const T* values, Offset count) {
    if (values == nullptr) return add(std::uint64_t{0});
    if constexpr (std::is_floating_point_v<T>) {
      add(hash_bits(std::span<const T>(values, static_cast<std::size_t>(count))));
    } else {
      for (Offset i = 0; i < count; ++i) add(static_cast<std::uint64_t>(values[i]));
    }
  }
  void add(std::uint64_t word) { sum_ = (sum_ ^ word) * 0x100000001b3ULL + 0x9e3779b97f4a7c15ULL; }
  [[nodiscard]] std::uint64_t sum() const { return sum_; }

 private:
  std::uint64_t sum_ = 0xcbf29ce484222325ULL;
};

/// Adds the arguments of a solve by sequential impulses.
void add_options(Digest& digest, const TimeStepping& stepping, const BodySolverOptions& options);

/// \throws Error(invalid_argument) unless all ranks have rank 0's digest. `what`: the arguments they have to be given.
void require_agreement(Transport& transport, std::uint64_t digest, const char* what);

/// Returns the digest of a batch, its owners and how it is solved.
template <class Real>
std::uint64_t digest_of(const BodyBatchView<Real>& batch, std::span<const int> owner, const TimeStepping& stepping,
                        const BodySolverOptions& options, const Real* warm_start);

/// \throws Error(invalid_argument) unless array `name` has one element for each body, in 0..count-1, each `what`.
void require_owners(const char* name, const char* what, std::span<const int> owner, Offset bodies, int count);

/// \throws Error(unsupported) for a method other than impulses, or a limit of contacts.
void require_impulses(const BodySolverOptions& options);

}  // namespace stiction::distributed
