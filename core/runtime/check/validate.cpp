#include <algorithm>
#include <limits>
#include <string>
#include <utility>

#include "core/base/fp_env.hpp"
#include "core/runtime/check/defects.hpp"
#include "core/runtime/check/stored_columns.hpp"
#include "core/runtime/check/survey.hpp"
#include "core/runtime/check/validate_values.hpp"
#include "stiction/batch.hpp"
#include "stiction/error.hpp"
#include "stiction/status.hpp"

namespace stiction {
namespace {

/// Which environment owns position i, by offsets that are sound; empty environments own nothing.
Offset owner_of(const Offset* offsets, Offset env_count, Offset i) {
  return std::upper_bound(offsets, offsets + env_count + 1, i) - offsets - 1;
}

/// Goes through a batch's arrays in order. Nothing is indexed by an array that was not found sound before.
template <class Real>
class Validator {
 public:
  Validator(const ContactBatchView<Real>& batch, std::size_t limit, SolverKind solver)
      : batch_(batch), report_(limit), pivots_(solver == SolverKind::lemke || solver == SolverKind::automatic) {}

  /// `with_values`: numbers too; without, the arrays of numbers may be null. `full_rows`: the kinds of rows, or null;
  /// of account if there is no structural defect.
  std::vector<Defect> run(bool with_values, const ParallelFor& parallel_for,
                          std::vector<FullRows>* full_rows = nullptr) {
    Survey<Real> survey(batch_, with_values, pivots_);
    bool passes = false;
    if (check_view(with_values)) {
      check_all_offsets();
      passes = offsets_are_sound() && survey.passes(parallel_for);
      if (!passes) check_environments(with_values);
    }
    if (full_rows != nullptr) {
      full_rows->clear();
      const auto note = [&](StoredColumns columns) {
        full_rows->push_back(columns == StoredColumns::full ? FullRows::known : FullRows::unknown);
      };
      full_rows->reserve(found_.size());
      for (std::size_t env = 0; env < found_.size(); ++env) note(passes ? survey.columns()[env] : found_[env].columns);
    }
    return report_.take();
  }

  /// Offsets and cones alone, by which columns are found.
  std::vector<Defect> run_without_columns() {
    if (check_view(false)) {
      check_all_offsets();
      if (env_rows_sound_ && env_cones_sound_ && cone_rows_sound_) check_cones();
    }
    return report_.take();
  }

 private:
  [[nodiscard]] bool offsets_are_sound() const {
    return env_rows_sound_ && env_cones_sound_ && cone_rows_sound_ && rows_sound_;
  }

  /// Describes environments that failed a look at all of them, if there is a defect.
  void check_environments(bool with_values) {
    if (env_rows_sound_ && env_cones_sound_ && cone_rows_sound_) check_cones();
    if (env_rows_sound_ && rows_sound_) check_columns();
    if (with_values && offsets_are_sound() && !report_.full())
      ValueValidator<Real>(batch_, found_, pivots_, report_).run();
  }

  /// Counts and pointers, before anything is read through them.
  bool check_view(bool with_values) {
    bool sound = true;
    const auto fail = [&](const std::string& message) {
      sound = false;
      report_.add({-1, -1, -1, true, message});
    };
    const auto count = [&](const char* name, Offset value) {
      if (value < 0) fail(std::string(name) + " = " + std::to_string(value) + ": a count must be >= 0; fix the view");
    };
    count("env_count", batch_.env_count);
    count("cone_count", batch_.cone_count);
    count("row_count", batch_.row_count);
    count("nonzero_count", batch_.nonzero_count);
    if (batch_.column_offsets != nullptr) count("column_count", batch_.column_count);
    if (batch_.factor_offsets != nullptr) count("factor_count", batch_.factor_count);
    if (batch_.mu_offsets != nullptr) count("mu_count", batch_.mu_count);
    const auto array = [&](const char* name, const void* pointer, bool needed) {
      if (needed && pointer == nullptr) fail(std::string(name) + " is null; point it to the batch's array");
    };
    array("env_row_offsets", batch_.env_row_offsets, true);
    array("env_cone_offsets", batch_.env_cone_offsets, true);
    array("cone_kind", batch_.cone_kind, batch_.cone_count > 0);
    array("cone_row_offsets", batch_.cone_row_offsets, true);
    array("row_offsets", batch_.row_offsets, true);
    array("column", batch_.column, batch_.nonzero_count > 0 || batch_.columns_stored() > 0);
    array("factor", batch_.factor, with_values && batch_.factor_offsets != nullptr && batch_.factor_count > 0);
    array("A", batch_.A, with_values && batch_.nonzero_count > 0);
    array("b", batch_.b, with_values && batch_.row_count > 0);
    array("R", batch_.R, with_values && batch_.row_count > 0);
    array("mu", batch_.mu, with_values && batch_.row_count > 0);
    array("lo", batch_.lo, with_values && batch_.row_count > 0);
    array("hi", batch_.hi, with_values && batch_.row_count > 0);
    return sound;
  }

  void check_all_offsets() {
    const auto offsets = [](const Offset* begin, Offset count) {
      return std::span(begin, static_cast<std::size_t>(count) + 1);
    };
    const auto env_place = [&](Offset i) { return i < batch_.env_count ? Defect{i, -1, -1, true, {}} : Defect{}; };
    env_rows_sound_ = check_offsets("env_row_offsets", offsets(batch_.env_row_offsets, batch_.env_count),
                                    batch_.row_count, "rows", env_place, report_);
    env_cones_sound_ = check_offsets("env_cone_offsets", offsets(batch_.env_cone_offsets, batch_.env_count),
                                     batch_.cone_count, "cones", env_place, report_);
    const auto cone_block = [&](Offset i) {
      if (!env_cones_sound_ || i >= batch_.cone_count) return Defect{};
      const Offset env = owner_of(batch_.env_cone_offsets, batch_.env_count, i);
      return Defect{env, static_cast<Index>(i - batch_.env_cone_offsets[env]), -1, true, {}};
    };
    cone_rows_sound_ = check_offsets("cone_row_offsets", offsets(batch_.cone_row_offsets, batch_.cone_count),
                                     batch_.row_count, "rows", cone_block, report_);
    const auto row_place = [&](Offset i) {
      if (!env_rows_sound_ || i >= batch_.row_count) return Defect{};
      const Offset env = owner_of(batch_.env_row_offsets, batch_.env_count, i);
      return Defect{env, -1, static_cast<Index>(i - batch_.env_row_offsets[env]), true, {}};
    };
    rows_sound_ = check_offsets("row_offsets", offsets(batch_.row_offsets, batch_.row_count), batch_.nonzero_count,
                                "stored entries", row_place, report_);
    if (env_rows_sound_ && batch_.env_row_counts != nullptr)
      env_rows_sound_ =
          check_counts("env_row_counts", batch_.env_row_counts, batch_.env_row_offsets, batch_.env_count, env_place);
    if (env_cones_sound_ && batch_.env_cone_counts != nullptr)
      env_cones_sound_ =
          check_counts("env_cone_counts", batch_.env_cone_counts, batch_.env_cone_offsets, batch_.env_count, env_place);
    if (rows_sound_ && batch_.row_counts != nullptr)
      rows_sound_ = check_counts("row_counts", batch_.row_counts, batch_.row_offsets, batch_.row_count, row_place);
    if (rows_sound_ && batch_.column_offsets != nullptr) rows_sound_ = check_column_offsets(row_place);
    if (env_rows_sound_ && rows_sound_ && batch_.factor_offsets != nullptr) {
      rows_sound_ = check_offsets("factor_offsets", offsets(batch_.factor_offsets, batch_.env_count),
                                  batch_.factor_count, "factor entries", env_place, report_);
      for (Offset env = 0; rows_sound_ && env < batch_.env_count; ++env) rows_sound_ = check_factor(env);
    }
    found_.assign(static_cast<std::size_t>(batch_.env_count), EnvStructure{});
  }

  /// A factor has as many entries in every row, and takes the place of stored ones.
  bool check_factor(Offset env) {
    const Offset entries = batch_.factor_offsets[env + 1] - batch_.factor_offsets[env], rows = rows_of(env);
    if (entries == 0) return true;
    bool stored = false;
    for (Offset row = batch_.env_row_offsets[env]; row < batch_.env_row_offsets[env] + rows; ++row)
      stored = stored || batch_.row_entries(row) > 0;
    if (rows > 0 && entries % rows == 0 && !stored) return true;
    fail_at({env, -1, -1, true, {}}, "env " + std::to_string(env) + " has " + std::to_string(entries) +
                                         " entries of a factor for " + std::to_string(rows) +
                                         (stored ? " rows, and stored entries as well: keep one of the two"
                                                 : " rows: every row has as many; fix factor_offsets"));
    return false;
  }

  /// Checks that the part in use lies within its room.
  template <class Place>
  bool check_counts(const char* name, const Index* counts, const Offset* offsets, Offset count, const Place& place) {
    bool sound = true;
    for (Offset i = 0; i < count && !report_.full(); ++i) {
      const Offset room = offsets[i + 1] - offsets[i];
      if (counts[i] >= 0 && counts[i] <= room) continue;
      sound = false;
      fail_at(place(i), std::string(name) + "[" + std::to_string(i) + "] = " + std::to_string(counts[i]) +
                            " is not in 0.." + std::to_string(room) +
                            ", the room its offsets give it; fix the count or give it more room");
    }
    return sound;
  }

  template <class Place>
  bool check_column_offsets(const Place& place) {
    bool sound = true;
    for (Offset row = 0; row < batch_.row_count && !report_.full(); ++row) {
      const Offset begin = batch_.column_offsets[row], last = batch_.column_count - batch_.row_entries(row);
      if (begin >= 0 && begin <= last) continue;
      sound = false;
      fail_at(place(row), "column_offsets[" + std::to_string(row) + "] = " + std::to_string(begin) + " is not in 0.." +
                              std::to_string(last) + ": the columns of " + std::to_string(batch_.row_entries(row)) +
                              " entries do not fit into column_count = " + std::to_string(batch_.column_count) +
                              "; fix the offset");
    }
    return sound;
  }

  void fail_at(Defect defect, std::string message) {
    defect.structural = true;
    defect.message = std::move(message);
    report_.add(std::move(defect));
  }

  void fail_env(Offset env, Index cone, Index row, std::string message) {
    found_[static_cast<std::size_t>(env)].broken = true;
    report_.add({env, cone, row, true, std::move(message)});
  }

  void check_cones() {
    for (Offset env = 0; env < batch_.env_count && !report_.full(); ++env) {
      const Offset row = batch_.env_row_offsets[env], row_end = row + batch_.env_rows(env);
      const Offset cone = batch_.env_cone_offsets[env], cone_end = cone + batch_.env_cones(env);
      const Offset tiled = batch_.cone_row_offsets[cone], tiled_end = batch_.cone_row_offsets[cone_end];
      if (tiled != row || tiled_end != row_end) {
        fail_env(env, -1, -1,
                 "the cones of env " + std::to_string(env) + " cover rows " + std::to_string(tiled) + ".." +
                     std::to_string(tiled_end) + " of the batch, but the environment has rows " + std::to_string(row) +
                     ".." + std::to_string(row_end) + ": cones must tile their environment; rebuild cone_row_offsets");
      }
      for (Offset c = cone; c < cone_end && !report_.full(); ++c) check_cone(env, static_cast<Index>(c - cone), c);
    }
  }

  void check_cone(Offset env, Index cone, Offset c) {
    const Offset rows = batch_.cone_row_offsets[c + 1] - batch_.cone_row_offsets[c];
    const ConeKind kind = batch_.cone_kind[c];
    const bool friction = carries_friction(kind);
    const bool is_matrix = kind == ConeKind::semidefinite;
    if (is_cone(kind, rows) && !(is_matrix && batch_.normal_last)) {
      if (friction && batch_.mu_offsets != nullptr) check_mu_offsets(env, cone, c);
      return;
    }

    const std::string where = "[env " + std::to_string(env) + ", cone " + std::to_string(cone) + "]";
    if (is_cone(kind, rows)) {
      fail_env(env, cone, -1,
               "the semidefinite cone" + where +
                   " is in a batch with the normal last, but its rows have one order; put the normal first");
    } else if (kind > ConeKind::semidefinite) {
      fail_env(env, cone, -1,
               "cone_kind" + where + " = " + std::to_string(static_cast<int>(kind)) +
                   ": kinds are 0 free, 1 unilateral, 2 box, 3 friction, 4 box_friction, 5 semidefinite; fix the kind");
    } else {
      fail_env(env, cone, -1,
               std::string("the ") + to_string(kind) + " cone" + where + " has " + std::to_string(rows) +
                   (rows == 1 ? " row: " : " rows: ") +
                   (friction    ? "friction has 2 to 6"
                    : is_matrix ? "matrices of order 2 and 3 have 3 and 6"
                                : "this kind has 1") +
                   "; fix cone_kind or cone_row_offsets");
    }
  }

  void check_mu_offsets(Offset env, Index cone, Offset c) {
    for (Offset row = batch_.cone_row_offsets[c]; row < batch_.cone_row_offsets[c + 1]; ++row) {
      const Offset place = batch_.mu_offsets[row];
      if (row == batch_.normal_row(c) || (place >= 0 && place < batch_.mu_count)) continue;
      fail_env(env, cone, static_cast<Index>(row - batch_.env_row_offsets[env]),
               "mu_offsets[" + std::to_string(row) + "] = " + std::to_string(place) + " is not in 0.." +
                   std::to_string(batch_.mu_count - 1) + ", where mu is; fix the offset or mu_count");
    }
  }

  /// Only dense systems are put into an order of their own, in which the normal can come first.
  void check_row_order(Offset env, Offset first, Offset rows) {
    Offset entries = 0;
    for (Offset row = first; row < first + rows; ++row) entries += batch_.row_entries(row);
    const bool factor = batch_.factor_offsets != nullptr && batch_.factor_offsets[env + 1] > batch_.factor_offsets[env];
    if (rows == 0 || (!factor && choose_path(rows, entries) == EnvPath::dense)) return;
    fail_env(env, -1, -1,
             "env " + std::to_string(env) + " has " + std::to_string(rows) +
                 " rows and is not solved densely, which rows with the normal last must be; put the normal first");
  }

  /// Columns, and that rows and entries of one environment can be counted by Index at all.
  void check_columns() {
    constexpr Offset kMostOfOneEnv = std::numeric_limits<Index>::max();
    for (Offset env = 0; env < batch_.env_count && !report_.full(); ++env) {
      const Offset first = batch_.env_row_offsets[env], rows = rows_of(env);
      const Offset entries = batch_.row_offsets[first + rows] - batch_.row_offsets[first];
      if (rows > kMostOfOneEnv || entries > kMostOfOneEnv) {
        fail_env(env, -1, -1,
                 "env " + std::to_string(env) + " has " + std::to_string(rows) + " rows and " +
                     std::to_string(entries) + " stored entries, but one environment holds at most " +
                     std::to_string(kMostOfOneEnv) + " of each; split it");
        continue;
      }
      if (batch_.normal_last) check_row_order(env, first, rows);
      const StoredColumns stored = stored_columns(batch_, first, static_cast<Index>(rows));
      found_[static_cast<std::size_t>(env)].columns = stored;
      if (stored != StoredColumns::any ||
          columns_below(batch_, first, static_cast<Index>(rows), static_cast<std::size_t>(entries)))
        continue;
      for (Offset i = 0; i < rows; ++i) {
        const Index* columns = batch_.row_columns(first + i);
        for (Index t = 0; t < batch_.row_entries(first + i); ++t) {
          const Index column = columns[t];
          const Offset k = columns - batch_.column + t;
          if (column >= 0 && column < rows) continue;
          if (report_.full()) return;
          fail_env(env, -1, static_cast<Index>(i),
                   "column[env " + std::to_string(env) + ", row " + std::to_string(i) + "] = " +
                       std::to_string(column) + " (entry " + std::to_string(k) + " of the batch) is not in 0.." +
                       std::to_string(rows - 1) + ": columns count from the environment's first row; fix the column");
        }
      }
    }
  }

  /// Rows of an environment, which Index may not be able to count yet.
  [[nodiscard]] Offset rows_of(Offset env) const {
    return batch_.env_row_counts != nullptr ? batch_.env_row_counts[env]
                                            : batch_.env_row_offsets[env + 1] - batch_.env_row_offsets[env];
  }

  const ContactBatchView<Real>& batch_;
  DefectReport report_;
  bool pivots_;  ///< the solver is one that takes rows without a positive diagonal
  bool env_rows_sound_ = false, env_cones_sound_ = false, cone_rows_sound_ = false, rows_sound_ = false;
  std::vector<EnvStructure> found_;  ///< of each environment's cones and columns  (env_count)
};

template <class Real>
void expect_host(const ContactBatchView<Real>& batch) {
  if (batch.space == MemorySpace::host) return;
  throw Error(ErrorCode::invalid_argument,
              "batch is in device memory, but validate() reads host memory; copy the batch to the host first");
}

}  // namespace

template <class Real>
std::vector<Defect> validate(const ContactBatchView<Real>& batch, std::size_t limit, SolverKind solver) {
  const ScopedFpEnv fp_env;
  expect_host(batch);
  return Validator<Real>(batch, limit, solver).run(true, all_at_once);
}

template <class Real>
std::vector<Defect> validate(const ContactBatchView<Real>& batch, std::size_t limit, SolverKind solver,
                             const ParallelFor& parallel_for, std::vector<FullRows>& full_rows) {
  expect_host(batch);
  return Validator<Real>(batch, limit, solver).run(true, parallel_for, &full_rows);
}

template <class Real>
std::vector<Defect> validate_structure(const ContactBatchView<Real>& batch, std::size_t limit,
                                       const ParallelFor& parallel_for, std::vector<FullRows>* full_rows) {
  expect_host(batch);
  return Validator<Real>(batch, limit, SolverKind::npgs).run(false, parallel_for, full_rows);
}

template <class Real>
std::vector<Defect> validate_offsets(const ContactBatchView<Real>& batch, std::size_t limit) {
  expect_host(batch);
  return Validator<Real>(batch, limit, SolverKind::npgs).run_without_columns();
}

template std::vector<Defect> validate_offsets(const ContactBatchView<float>&, std::size_t);
template std::vector<Defect> validate_offsets(const ContactBatchView<double>&, std::size_t);
template std::vector<Defect> validate(const ContactBatchView<float>&, std::size_t, SolverKind);
template std::vector<Defect> validate(const ContactBatchView<double>&, std::size_t, SolverKind);
template std::vector<Defect> validate(const ContactBatchView<float>&, std::size_t, SolverKind, const ParallelFor&,
                                      std::vector<FullRows>&);
template std::vector<Defect> validate(const ContactBatchView<double>&, std::size_t, SolverKind, const ParallelFor&,
                                      std::vector<FullRows>&);
template std::vector<Defect> validate_structure(const ContactBatchView<float>&, std::size_t, const ParallelFor&,
                                                std::vector<FullRows>*);
template std::vector<Defect> validate_structure(const ContactBatchView<double>&, std::size_t, const ParallelFor&,
                                                std::vector<FullRows>*);

}  // namespace stiction
