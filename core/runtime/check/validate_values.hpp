#pragma once

#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <string_view>

#include "core/job/cone_counts.hpp"
#include "core/runtime/check/defects.hpp"
#include "core/runtime/check/diagonals.hpp"
#include "core/runtime/check/stored_columns.hpp"
#include "stiction/batch.hpp"
#include "stiction/status.hpp"

namespace stiction {

/// Facts about an environment whose offsets are sound.
struct EnvStructure {
  bool broken = false;  ///< a cone or a column has a defect
  StoredColumns columns = StoredColumns::any;
};

/// Reports defects of a batch's numbers. Offsets are sound, and environments whose structure is broken are left out.
template <class Real>
class ValueValidator {
 public:
  /// `pivots`: the solver is one that takes rows without a positive diagonal.
  ValueValidator(const ContactBatchView<Real>& batch, std::span<const EnvStructure> structure, bool pivots,
                 DefectReport& report)
      : batch_(batch), structure_(structure), pivots_(pivots), report_(report) {}

  void run() {
    check_flags();
    check_entries();
    check_factor_values();
    check_row_arrays();
    check_diagonals();
  }

 private:
  static constexpr const char* kFixOrIsolate =
      "; fix the value or solve with isolation (--isolate) to flag this environment and go on";

  /// Reports flags set when the batch was made.
  void check_flags() {
    for (Offset env = 0; batch_.env_flags != nullptr && env < batch_.env_count && !report_.full(); ++env) {
      for (int bit = 0; bit < kEnvFlagCount; ++bit) {
        const auto flag = static_cast<EnvFlag>(1U << bit);
        if (flag == kFlagContactsDropped || (batch_.env_flags[env] & flag) == 0) continue;
        report_.add({env, -1, -1, false,
                     "env " + std::to_string(env) + " was marked " + flag_name(flag) +
                         " when the batch was made; fix its input or solve with isolation (--isolate) to flag this "
                         "environment and go on"});
      }
    }
  }

  void check_entries() {
    if (all_finite(std::span(batch_.A, static_cast<std::size_t>(batch_.nonzero_count)))) return;
    for_each_row([&](Offset env, Offset cone, Offset row) {
      for (Index k = 0; k < batch_.row_entries(row); ++k) {
        const Real value = batch_.A[batch_.row_offsets[row] + k];
        if (std::isfinite(value)) continue;
        add_value("A", env, cone, row, ", column " + std::to_string(batch_.row_columns(row)[k]), value,
                  "must be finite");
      }
    });
  }

  void check_row_arrays() {
    check_rows("b", batch_.b, [&](Offset, Offset row) { return std::isfinite(batch_.b[row]) ? "" : "must be finite"; });
    check_rows("R", batch_.R, [&](Offset, Offset row) {
      if (!std::isfinite(batch_.R[row])) return "must be finite";
      return batch_.R[row] < 0 ? "compliance must be >= 0" : "";
    });
    check_rows(
        "mu", batch_.mu,
        [&](Offset cone, Offset row) {
          if (!carries_friction(batch_.cone_kind[cone]) || row == batch_.normal_row(cone)) return "";
          const Real mu = batch_.mu[batch_.mu_at(row)];
          if (!std::isfinite(mu)) return "friction must be finite";
          return mu < 0 ? "friction must be >= 0" : "";
        },
        batch_.mu_offsets);
    check_rows("lo", batch_.lo, [&](Offset cone, Offset row) -> std::string {
      if (batch_.cone_kind[cone] != ConeKind::box) return {};
      const Real lo = batch_.lo[row], hi = batch_.hi[row];
      if (std::isnan(lo)) return "a bound must be a number (-inf: no bound)";
      if (lo > hi) return "the lower bound must not be above the upper, hi = " + shortest_text(hi);
      return lo > std::numeric_limits<Real>::max() ? "no finite reaction reaches this lower bound" : "";
    });
    check_rows("hi", batch_.hi, [&](Offset cone, Offset row) {
      if (batch_.cone_kind[cone] != ConeKind::box) return "";
      const Real hi = batch_.hi[row];
      if (std::isnan(hi)) return "a bound must be a number (inf: no bound)";
      return hi < std::numeric_limits<Real>::lowest() ? "no finite reaction stays below this upper bound" : "";
    });
  }

  void check_factor_values() {
    if (batch_.factor_offsets == nullptr ||
        all_finite(std::span(batch_.factor, static_cast<std::size_t>(batch_.factor_count))))
      return;
    for_each_row([&](Offset env, Offset cone, Offset row) {
      for (const Real value : factor_row(batch_, env, row))
        if (!std::isfinite(value)) add_value("factor", env, cone, row, "", value, "must be finite");
    });
  }

  /// A + R needs a positive diagonal wherever a cone bounds the reaction, unless the environment is one for pivoting.
  /// A cone whose row is zero as a whole cannot move, and no method is given it. Values that are not finite were
  /// reported before.
  void check_diagonals() {
    Offset looked_at = -1;
    bool takes_any = false;
    for_each_row([&](Offset env, Offset cone, Offset row) {
      if (batch_.cone_kind[cone] == ConeKind::free) return;
      if (pivots_ && env != looked_at) {
        looked_at = env;
        takes_any = !has_friction_cones(batch_, env);
      }
      if (takes_any) return;
      const bool runs = structure_[static_cast<std::size_t>(env)].columns != StoredColumns::any;
      const Real diagonal = diagonal_of(batch_, env, row, runs);
      if (diagonal > 0 || !std::isfinite(diagonal)) return;
      if (diagonal == 0 && batch_.cone_kind[cone] != ConeKind::semidefinite &&
          is_flat(batch_, env, batch_.normal_row(cone)))
        return;
      add_value("diagonal of A + R", env, cone, row, "", diagonal, "must be > 0 on every row that is not free");
    });
  }

  /// Calls fault(cone, row) for every row; a text that is not empty is the fault of values[row].
  template <class Fault>
  void check_rows(const char* array, const Real* values, const Fault& fault, const Offset* places = nullptr) {
    for_each_row([&](Offset env, Offset cone, Offset row) {
      const auto what = fault(cone, row);  // text that need not be copied, where it is always the same
      if (std::string_view(what).empty()) return;
      add_value(array, env, cone, row, "", values[places == nullptr ? row : places[row]], std::string(what));
    });
  }

  /// Calls visit(env, cone, row), positions in the batch, for every row of the environments whose structure holds.
  template <class Visit>
  void for_each_row(const Visit& visit) const {
    for (Offset env = 0; env < batch_.env_count; ++env) {
      if (structure_[static_cast<std::size_t>(env)].broken) continue;
      const Offset first_cone = batch_.env_cone_offsets[env];
      for (Offset cone = first_cone; cone < first_cone + batch_.env_cones(env); ++cone) {
        for (Offset row = batch_.cone_row_offsets[cone]; row < batch_.cone_row_offsets[cone + 1]; ++row) {
          if (report_.full()) return;
          visit(env, cone, row);
        }
      }
    }
  }

  void add_value(const char* array, Offset env, Offset cone, Offset row, const std::string& column, Real value,
                 const std::string& fault) {
    const auto env_cone = static_cast<Index>(cone - batch_.env_cone_offsets[env]);
    const auto env_row = static_cast<Index>(row - batch_.env_row_offsets[env]);
    report_.add({env, env_cone, env_row, false,
                 std::string(array) + "[env " + std::to_string(env) + ", cone " + std::to_string(env_cone) + ", row " +
                     std::to_string(env_row) + column + "] = " + shortest_text(value) + ": " + fault + kFixOrIsolate});
  }

  const ContactBatchView<Real>& batch_;
  std::span<const EnvStructure> structure_;  ///< (env_count)
  bool pivots_;
  DefectReport& report_;
};

}  // namespace stiction
