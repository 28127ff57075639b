#pragma once

#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/base/dense_rows.hpp"
#include "core/job/parallel_for.hpp"
#include "stiction/batch.hpp"

namespace stiction {

/// The structural defects alone: the first of validate()'s list. The arrays of numbers (A, b, R, mu, lo, hi) are not
/// read and may be null. A structure copied from a device can hence be checked before it is planned.
template <class Real>
std::vector<Defect> validate_structure(const ContactBatchView<Real>& batch, std::size_t limit = 64,
                                       const ParallelFor& parallel_for = all_at_once,
                                       std::vector<FullRows>* full_rows = nullptr);

/// Returns their defects of offsets and cones: a batch without them can be gone through, whatever its columns are.
template <class Real>
std::vector<Defect> validate_offsets(const ContactBatchView<Real>& batch, std::size_t limit);

/// validate(), which looks at all columns and can return the environments that store their rows in full.
template <class Real>
std::vector<Defect> validate(const ContactBatchView<Real>& batch, std::size_t limit, SolverKind solver,
                             const ParallelFor& parallel_for, std::vector<FullRows>& full_rows);

/// Collects defects up to a limit. Building a message costs more than looking: ask full() first.
class DefectReport {
 public:
  explicit DefectReport(std::size_t limit) : limit_(limit) {}

  [[nodiscard]] bool full() const { return defects_.size() >= limit_; }
  void add(Defect defect) {
    if (!full()) defects_.push_back(std::move(defect));
  }
  std::vector<Defect> take() { return std::move(defects_); }

 private:
  std::size_t limit_;
  std::vector<Defect> defects_;
};

/// The shortest text that reads back as the same number, so that a message shows the stored one.
template <class Real>
std::string shortest_text(Real value) {
  if (std::isnan(value)) return "nan";  // a NaN's sign means nothing, and not every machine makes the same one
  std::array<char, 64> buffer{};
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return {buffer.data(), end.ptr};
}

/// Returns true if no value is infinite or NaN, on the bits and without a branch: this runs over all of A before a
/// solve. An exponent of ones, and no other, carries into the sign's place when one is added to it; comparing 64-bit
/// numbers would not vectorise.
template <class Real>
bool all_finite(std::span<const Real> values) {
  using Bits = std::conditional_t<sizeof(Real) == 4, std::uint32_t, std::uint64_t>;
  constexpr int kSignPlace = sizeof(Real) * 8 - 1;
  constexpr Bits kOne = Bits{1} << (std::numeric_limits<Real>::digits - 1);
  constexpr Bits kExponent = (Bits{1} << kSignPlace) - kOne;
  Bits any = 0;
  for (const Real value : values) any |= (std::bit_cast<Bits>(value) & kExponent) + kOne;
  return any >> kSignPlace == 0;
}

/// Returns true if no value is infinite, NaN or below zero, likewise.
template <class Real>
bool all_finite_nonnegative(std::span<const Real> values) {
  unsigned below = 0;
  for (const Real value : values) below |= value < Real(0) ? 1U : 0U;
  return below == 0 && all_finite(values);
}

/// Returns true if lo <= hi everywhere and some finite number is between them, likewise. Infinite ones are no bounds.
template <class Real>
bool all_bounds(const Real* lo, const Real* hi, std::size_t count) {
  constexpr Real kMost = std::numeric_limits<Real>::max();
  unsigned broken = 0;
  for (std::size_t i = 0; i < count; ++i)
    broken |= static_cast<unsigned>(!((lo[i] <= hi[i]) & (lo[i] <= kMost) & (hi[i] >= -kMost)));
  return broken == 0;
}

/// Offsets that begin at 0, do not decrease and end at `total`, which together bounds every entry. Each fault is
/// reported as a structural defect; `place(i)` is a Defect that names where entry i is, as far as that is known.
template <class Place>
bool check_offsets(const char* name, std::span<const Offset> offsets, Offset total, const char* total_name,
                   const Place& place, DefectReport& report) {
  bool sound = true;
  const auto entry = [&](std::size_t i) {
    return std::string(name) + "[" + std::to_string(i) + "] = " + std::to_string(offsets[i]);
  };
  const auto fail = [&](std::size_t i, const std::string& message) {
    Defect defect = place(static_cast<Offset>(i));
    defect.structural = true;
    defect.message = message + "; rebuild the offsets";
    report.add(std::move(defect));
  };
  const std::size_t last = offsets.size() - 1;
  if (offsets[0] != 0) {
    sound = false;
    fail(0, entry(0) + ": offsets must begin at 0");
  }
  for (std::size_t i = 0; i < last; ++i) {
    if (offsets[i + 1] >= offsets[i]) continue;
    sound = false;
    if (report.full()) break;
    fail(i, entry(i + 1) + " is less than " + entry(i) + ": offsets must not decrease");
  }
  if (offsets[last] != total) {
    sound = false;
    fail(last > 0 ? last - 1 : 0,
         entry(last) + ": the last offset must be the number of " + total_name + ", " + std::to_string(total));
  }
  return sound;
}

}  // namespace stiction
