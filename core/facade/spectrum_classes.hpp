#pragma once

#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "core/base/extents.hpp"
#include "core/job/parallel_for.hpp"
#include "stiction/hash.hpp"
#include "stiction/spectrum.hpp"

namespace stiction {

/// Classes that a solver has found, by the place of the environment (SpectrumRules::keep).
class KeptClasses {
 public:
  /// The class of each environment. Environments that keep theirs have the structure that they had.
  template <class Real>
  std::vector<SpectrumClass> of(const ContactBatchView<Real>& batch, const SpectrumRules& rules,
                                const ParallelFor& parallel_for) {
    const std::lock_guard lock(mutex_);
    if (rules.keep) kept_.resize(larger_of(kept_.size(), at(batch.env_count)));
    std::vector<SpectrumClass> found(at(batch.env_count));
    parallel_for(batch.env_count, [&](Offset begin, Offset end) {
      for (Offset env = begin; env < end; ++env) found[at(env)] = class_of(batch, env, rules);
    });
    return found;
  }

 private:
  struct Kept {
    bool is_known = false;
    std::uint64_t structure = 0;
    SpectrumClass found = SpectrumClass::otherwise;
  };

  template <class Real>
  SpectrumClass class_of(const ContactBatchView<Real>& batch, Offset env, const SpectrumRules& rules) {
    if (!rules.keep) return classify(estimate_spectrum(batch, env, rules.steps), rules);
    Kept& kept = kept_[at(env)];
    const std::uint64_t structure = structure_hash(batch, env);
    if (!kept.is_known || kept.structure != structure)
      kept = {true, structure, classify(estimate_spectrum(batch, env, rules.steps), rules)};
    return kept.found;
  }

  /// Returns a hash of the kinds and sizes of cones, and of the stored columns.
  static std::uint64_t structure_hash(const BatchStructure& batch, Offset env) {
    std::vector<double> integers{static_cast<double>(batch.env_rows(env)), static_cast<double>(batch.env_dofs(env))};
    const Offset cone = batch.env_cone_offsets[env], row = batch.env_row_offsets[env];
    for (Offset c = cone; c < cone + batch.env_cones(env); ++c) {
      integers.push_back(static_cast<double>(batch.cone_kind[c]));
      integers.push_back(static_cast<double>(batch.cone_row_offsets[c + 1] - batch.cone_row_offsets[c]));
    }
    for (Offset r = row; r < row + batch.env_rows(env); ++r) {
      const Index entries = batch.row_entries(r);
      integers.push_back(entries);
      integers.insert(integers.end(), batch.row_columns(r), batch.row_columns(r) + entries);
    }
    return hash_bits(std::span<const double>(integers));
  }

  std::mutex mutex_;
  std::vector<Kept> kept_;
};

}  // namespace stiction
