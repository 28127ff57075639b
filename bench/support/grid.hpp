#pragma once

#include <string>

#include "bench/support/contact_batch.hpp"

namespace stiction::bench {

inline constexpr Index kContacts[] = {1, 2, 4, 8, 16, 32, 64};  ///< contacts of each environment
inline constexpr Offset kEnvs[] = {1, 16, 256, 4096, 16384};    ///< environments of a batch
inline constexpr Index kSweeps = 20;                            ///< iterations of every environment

/// Entries of A a batch of the grid may hold; larger combinations run with fewer environments, given in their names.
inline constexpr Offset kEntries = Offset{4} << 20;

/// The batch of the benchmark that runs now. Making one costs more than solving it, and neighbours in the order of
/// registration ask for the same.
template <class Real>
const ContactBatch<Real>& cached_contacts(const std::string& family, Index contacts, Offset envs) {
  static std::string key;
  static ContactBatch<Real> batch;
  const std::string wanted = family + "/" + std::to_string(contacts) + "/" + std::to_string(envs);
  if (key != wanted) {
    batch = make_contacts<Real>(family, contacts, envs);
    key = wanted;
  }
  return batch;
}

/// f(contacts, envs) for every point of the grid once, after the cap.
template <class F>
void for_each_grid_point(F&& f) {
  for (const Index contacts : kContacts) {
    Offset before = 0;
    for (const Offset wanted : kEnvs) {
      const Offset envs = capped_envs(contacts, wanted, kEntries);
      if (envs != before) f(contacts, envs);
      before = envs;
    }
  }
}

/// "f32" or "f64".
template <class Real>
std::string precision_name() {
  return to_string(sizeof(Real) == sizeof(float) ? Precision::f32 : Precision::f64);
}

}  // namespace stiction::bench
