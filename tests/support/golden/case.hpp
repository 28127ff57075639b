#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "stiction/hash.hpp"
#include "stiction/solver.hpp"

/// Rows of the golden table as something that can be computed, and how an answer becomes one number.
namespace stiction::test {

/// Not a multiple of the chunk, and past one refresh of the motion.
inline constexpr Index kGoldenIterations = 22;
inline constexpr std::uint64_t kGoldenSeed = 20;

/// One row: "form/scene/solver/precision/law", and its hash on a device.
struct GoldenCase {
  std::string name;
  std::function<std::uint64_t(Device)> hash;
};
using GoldenCases = std::vector<GoldenCase>;

/// Joins the hashes of an answer's arrays, in their order.
class Digest {
 public:
  Digest& add(std::uint64_t hash) {
    value_ = value_ * 0x100000001b3ULL + hash;
    return *this;
  }
  template <class Real>
  Digest& add(const std::vector<Real>& values) {
    return add(hash_bits(std::span<const Real>(values)));
  }
  /// Adds the record of every environment, the solver that answered included. No number of islands: hashes of the
  /// table are older than that field.
  Digest& add(std::span<const EnvStatus> records) {
    for (const EnvStatus& status : records)
      add(std::vector<double>{status.residual, status.residual_absolute, static_cast<double>(status.flags),
                              static_cast<double>(status.iterations), static_cast<double>(status.code),
                              static_cast<double>(status.solver)});
    return *this;
  }
  [[nodiscard]] std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0;
};

/// Adds a row for either precision: compute(Real{}, device) is its hash.
template <class Compute>
void add_precisions(GoldenCases& cases, const std::string& name, Compute compute, const std::string& suffix = "") {
  cases.push_back({name + "/f32" + suffix, [compute](Device device) { return compute(float{}, device); }});
  cases.push_back({name + "/f64" + suffix, [compute](Device device) { return compute(double{}, device); }});
}

/// Adds a row for either precision under one law: compute(Real{}, law, device) is its hash.
template <class Compute>
void add_law(GoldenCases& cases, const std::string& name, Law law, Compute compute) {
  add_precisions(
      cases, name, [compute, law](auto real, Device device) { return compute(real, law, device); },
      std::string("/") + to_string(law));
}

/// Adds a row for each law and precision.
template <class Compute>
void add_laws(GoldenCases& cases, const std::string& name, Compute compute) {
  for (const Law law : {Law::convex, Law::coulomb}) add_law(cases, name, law, compute);
}

}  // namespace stiction::test
