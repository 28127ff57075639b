#pragma once

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

#include "core/base/extents.hpp"
#include "core/runtime/batch/append_environment.hpp"
#include "stiction/solver.hpp"

namespace stiction {

/// Some environments of a host batch as a batch of their own, and the way back.
template <class Real>
class EnvSubset {
 public:
  /// Copies the members out of a batch whose structure is sound. `warm_start` may be null, or where answers go.
  EnvSubset(const ContactBatchView<Real>& batch, std::span<const Offset> members, const Real* warm_start,
            bool with_motion)
      : batch_(batch), members_(members.begin(), members.end()) {
    typename ContactBatch<Real>::Arrays to;
    to.env_row_offsets = to.env_cone_offsets = to.cone_row_offsets = to.row_offsets = {0};
    if (batch.factor_offsets != nullptr) to.factor_offsets = {0};
    for (const Offset env : members_) {
      append_environment(to, batch, env);
      if (warm_start == nullptr) continue;
      const Real* const first = warm_start + batch.env_row_offsets[env];
      warm_start_.insert(warm_start_.end(), first, first + batch.env_rows(env));
    }
    own_ = ContactBatch<Real>::from_arrays(batch.law, std::move(to));
    answer_.lambda.resize(at(own_.row_count()));
    if (with_motion) answer_.w.resize(answer_.lambda.size());
    answer_.status.resize(members_.size());
  }

  [[nodiscard]] ContactBatchView<Real> view() const noexcept {
    ContactBatchView<Real> view = own_.view();
    view.normal_last = batch_.normal_last;
    return view;
  }
  [[nodiscard]] const Real* warm_start() const noexcept { return warm_start_.empty() ? nullptr : warm_start_.data(); }
  /// Returns the arrays for the members' solution.
  [[nodiscard]] SolutionView<Real> answer() noexcept {
    return {answer_.lambda.data(), answer_.w.empty() ? nullptr : answer_.w.data(), answer_.status.data()};
  }

  /// Writes the members' answers where the batch has their rows in use.
  void write(const SolutionView<Real>& solution) const {
    const std::vector<Offset>& rows = own_.arrays().env_row_offsets;
    for (std::size_t k = 0; k < members_.size(); ++k) {
      const Offset env = members_[k], row = batch_.env_row_offsets[env], count = rows[k + 1] - rows[k];
      std::copy_n(answer_.lambda.begin() + rows[k], count, solution.lambda + row);
      if (solution.w != nullptr) std::copy_n(answer_.w.begin() + rows[k], count, solution.w + row);
      solution.status[env] = answer_.status[k];
    }
  }

 private:
  ContactBatchView<Real> batch_;
  std::vector<Offset> members_;
  ContactBatch<Real> own_;
  std::vector<Real> warm_start_;  ///< of the members' rows, or empty
  Solution<Real> answer_;         ///< w is empty where it is not wanted
};

/// Copies an answer. Rows of padded arrays that are not in use are the caller's.
template <class Real>
void write_used_rows(const ContactBatchView<Real>& batch, const SolutionView<Real>& from,
                     const SolutionView<Real>& to) {
  for (Offset env = 0; env < batch.env_count; ++env) {
    const Offset row = batch.env_row_offsets[env];
    std::copy_n(from.lambda + row, batch.env_rows(env), to.lambda + row);
    if (to.w != nullptr) std::copy_n(from.w + row, batch.env_rows(env), to.w + row);
    to.status[env] = from.status[env];
  }
}

}  // namespace stiction
