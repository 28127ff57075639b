#include "stiction/batch.hpp"

#include <algorithm>
#include <limits>
#include <string>
#include <utility>

#include "core/base/fp_env.hpp"
#include "core/runtime/batch/append_environment.hpp"
#include "core/runtime/check/expect.hpp"
#include "stiction/batch_arrays.hpp"

namespace stiction {
namespace {

/// R, mu, lo and hi of one environment may be left out.
void expect_length_or_empty(const char* name, std::size_t got, std::size_t rows) {
  if (got != 0) expect_length(name, got, rows, "one per row, as b has; or leave it empty for zeros");
}

template <class T>
void append(std::vector<T>& to, const std::vector<T>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

/// Appends `from`, or as many zeros as there are rows where `from` was left out.
template <class Real>
void append_or_zeros(std::vector<Real>& to, const std::vector<Real>& from, std::size_t rows) {
  if (from.empty()) {
    to.resize(to.size() + rows, Real(0));
  } else {
    append(to, from);
  }
}

/// Offsets of one environment, appended so that they go on from the last entry: entries (begin, end] of `from`.
template <class T>
void append_offsets(std::vector<Offset>& to, const std::vector<T>& from, Offset begin, Offset end) {
  const Offset shift = to.back() - static_cast<Offset>(from[static_cast<std::size_t>(begin)]);
  for (Offset i = begin + 1; i <= end; ++i)
    to.push_back(static_cast<Offset>(from[static_cast<std::size_t>(i)]) + shift);
}

/// An environment's part [begin, end) of an array, by its offsets. gather() copies batches that validate() has not
/// seen yet, so that an environment with broken offsets must not make it read outside of the arrays.
struct Part {
  Offset begin, end;
};

Part part_of(const std::vector<Offset>& offsets, const char* name, Offset from, Offset to, std::size_t length) {
  const Part part{offsets[static_cast<std::size_t>(from)], offsets[static_cast<std::size_t>(to)]};
  const bool increasing = std::is_sorted(offsets.begin() + from, offsets.begin() + to + 1);
  if (part.begin < 0 || part.end > static_cast<Offset>(length) || !increasing) {
    refuse(std::string(name) + "[" + std::to_string(from) + "] = " + std::to_string(part.begin) + " to " + name + "[" +
           std::to_string(to) + "] = " + std::to_string(part.end) + " do not lead forward through an array of " +
           std::to_string(length) + " entries; fix the offsets (validate() lists every defect)");
  }
  return part;
}

template <class Real>
void check_shape(const Environment<Real>& environment) {
  const std::size_t rows = environment.b.size();
  expect_length("row_offsets", environment.row_offsets.size(), rows + 1, "one per row of b, and one");
  if (environment.row_offsets.front() != 0) {
    refuse("row_offsets[0] = " + std::to_string(environment.row_offsets.front()) +
           ", expected 0: an environment's offsets count from its own zero");
  }
  if (environment.row_offsets.back() < 0) {
    refuse("row_offsets[" + std::to_string(rows) + "] = " + std::to_string(environment.row_offsets.back()) +
           ", expected the number of stored entries");
  }
  const auto nonzeros = static_cast<std::size_t>(environment.row_offsets.back());
  expect_length("column", environment.column.size(), nonzeros, "the last entry of row_offsets");
  expect_length("A", environment.A.size(), nonzeros, "the last entry of row_offsets");
  expect_length_or_empty("R", environment.R.size(), rows);
  expect_length_or_empty("mu", environment.mu.size(), rows);
  expect_length_or_empty("lo", environment.lo.size(), rows);
  expect_length_or_empty("hi", environment.hi.size(), rows);

  Offset tiled = 0;
  for (std::size_t c = 0; c < environment.cones.size(); ++c) {
    if (environment.cones[c].row_count < 1) {
      refuse("cones[" + std::to_string(c) + "].row_count = " + std::to_string(environment.cones[c].row_count) +
             ", expected at least 1");
    }
    tiled += environment.cones[c].row_count;
  }
  if (tiled != static_cast<Offset>(rows)) {
    refuse("cones tile " + std::to_string(tiled) + " rows, expected " + std::to_string(rows) + " (one per entry of b)");
  }
}

}  // namespace

template <class Real>
void Environment<Real>::set_dense(std::span<const Real> matrix, Index n) {
  const ScopedFpEnv fp_env;
  if (n < 0) refuse("n = " + std::to_string(n) + ", expected a number of rows >= 0");
  const auto size = static_cast<std::size_t>(n);
  expect_length("matrix", matrix.size(), size * size, "n * n, row by row");
  const auto zeros = static_cast<std::size_t>(std::count(matrix.begin(), matrix.end(), Real(0)));
  const std::size_t nonzeros = matrix.size() - zeros;
  if (nonzeros > static_cast<std::size_t>(std::numeric_limits<Index>::max())) {
    refuse("matrix has " + std::to_string(nonzeros) + " entries that are not zero, more than one environment can hold");
  }
  row_offsets.assign(1, 0);
  column.clear();
  A.clear();
  column.reserve(nonzeros);
  A.reserve(nonzeros);
  for (std::size_t i = 0; i < size; ++i) {
    for (std::size_t j = 0; j < size; ++j) {
      const Real value = matrix[i * size + j];
      if (value == Real(0)) continue;
      column.push_back(static_cast<Index>(j));
      A.push_back(value);
    }
    row_offsets.push_back(static_cast<Index>(A.size()));
  }
}

template <class Real>
ContactBatch<Real> ContactBatch<Real>::from_arrays(Law law, Arrays arrays) {
  if (arrays.env_row_offsets.empty()) {
    refuse("env_row_offsets has 0 entries, expected one per environment, and one");
  }
  expect_length("env_cone_offsets", arrays.env_cone_offsets.size(), arrays.env_row_offsets.size(),
                "as many as env_row_offsets");
  const std::size_t cones = arrays.cone_kind.size();
  expect_length("cone_row_offsets", arrays.cone_row_offsets.size(), cones + 1, "one per entry of cone_kind, and one");
  if (!arrays.cone_group.empty()) {
    expect_length("cone_group", arrays.cone_group.size(), cones, "one per entry of cone_kind, or none at all");
  }
  const std::size_t rows = arrays.b.size();
  expect_length("row_offsets", arrays.row_offsets.size(), rows + 1, "one per row of b, and one");
  expect_length("A", arrays.A.size(), arrays.column.size(), "as many as column");
  expect_length("R", arrays.R.size(), rows, "one per row, as b has");
  expect_length("mu", arrays.mu.size(), rows, "one per row, as b has");
  expect_length("lo", arrays.lo.size(), rows, "one per row, as b has");
  expect_length("hi", arrays.hi.size(), rows, "one per row, as b has");
  if (!arrays.env_flags.empty()) {
    expect_length("env_flags", arrays.env_flags.size(), arrays.env_row_offsets.size() - 1,
                  "one per environment, or none at all");
  }
  if (!arrays.env_tolerance.empty()) {
    expect_length("env_tolerance", arrays.env_tolerance.size(), arrays.env_row_offsets.size() - 1,
                  "one per environment, or none at all");
  }
  if (!arrays.env_max_iterations.empty()) {
    expect_length("env_max_iterations", arrays.env_max_iterations.size(), arrays.env_row_offsets.size() - 1,
                  "one per environment, or none at all");
  }
  if (!arrays.factor_offsets.empty()) {
    expect_length("factor_offsets", arrays.factor_offsets.size(), arrays.env_row_offsets.size(),
                  "as many as env_row_offsets, or none at all");
  }

  ContactBatch batch(law);
  batch.arrays_ = std::move(arrays);
  return batch;
}

template <class Real>
void ContactBatch<Real>::add(const Environment<Real>& environment) {
  check_shape(environment);
  const std::size_t rows = environment.b.size();
  const bool grouped =
      std::any_of(environment.cones.begin(), environment.cones.end(), [](const auto& cone) { return cone.group >= 0; });
  if (grouped) arrays_.cone_group.resize(arrays_.cone_kind.size(), -1);
  const bool store_groups = grouped || !arrays_.cone_group.empty();

  for (const auto& cone : environment.cones) {
    arrays_.cone_kind.push_back(cone.kind);
    arrays_.cone_row_offsets.push_back(arrays_.cone_row_offsets.back() + cone.row_count);
    if (store_groups) arrays_.cone_group.push_back(cone.group);
  }
  append_offsets(arrays_.row_offsets, environment.row_offsets, 0, static_cast<Offset>(rows));
  append(arrays_.column, environment.column);
  append(arrays_.A, environment.A);
  append(arrays_.b, environment.b);
  append_or_zeros(arrays_.R, environment.R, rows);
  append_or_zeros(arrays_.mu, environment.mu, rows);
  append_or_zeros(arrays_.lo, environment.lo, rows);
  append_or_zeros(arrays_.hi, environment.hi, rows);
  arrays_.env_row_offsets.push_back(static_cast<Offset>(arrays_.b.size()));
  arrays_.env_cone_offsets.push_back(static_cast<Offset>(arrays_.cone_kind.size()));
  if (!arrays_.env_flags.empty()) arrays_.env_flags.push_back(0);
  if (!arrays_.env_tolerance.empty()) arrays_.env_tolerance.push_back(-1.0);
  if (!arrays_.env_max_iterations.empty()) arrays_.env_max_iterations.push_back(-1);
  if (!arrays_.factor_offsets.empty()) arrays_.factor_offsets.push_back(arrays_.factor_offsets.back());
}

template <class Real>
ContactBatchView<Real> ContactBatch<Real>::view() const noexcept {
  ContactBatchView<Real> view;
  view.env_count = env_count();
  view.cone_count = static_cast<Offset>(arrays_.cone_kind.size());
  view.row_count = static_cast<Offset>(arrays_.b.size());
  view.nonzero_count = static_cast<Offset>(arrays_.column.size());
  view.factor_count = static_cast<Offset>(arrays_.factor.size());
  for_each_held_array(view, PointAt{}, view, arrays_);
  view.law = law_;
  return view;
}

template <class To, class From>
ContactBatch<To> convert(const ContactBatch<From>& batch) {
  const ScopedFpEnv fp_env;
  const auto& from = batch.arrays();
  typename ContactBatch<To>::Arrays to;
  for_each_held_array(
      batch.view(),
      []<class T, class F>(const BatchArray&, std::vector<T>& target, const std::vector<F>& source) {
        target.resize(source.size());
        std::transform(source.begin(), source.end(), target.begin(), [](F value) { return static_cast<T>(value); });
      },
      to, from);
  return ContactBatch<To>::from_arrays(batch.law(), std::move(to));
}

template <class Real>
ContactBatch<Real> gather(const ContactBatch<Real>& batch, std::span<const Offset> order) {
  const auto& from = batch.arrays();
  const ContactBatchView<Real> view = batch.view();
  typename ContactBatch<Real>::Arrays to;
  to.env_row_offsets = to.env_cone_offsets = to.cone_row_offsets = to.row_offsets = {0};
  if (!from.factor_offsets.empty()) to.factor_offsets = {0};
  for (std::size_t k = 0; k < order.size(); ++k) {
    const Offset env = order[k];
    if (env < 0 || env >= batch.env_count()) {
      refuse("order[" + std::to_string(k) + "] = " + std::to_string(env) + ", expected an environment in 0.." +
             std::to_string(batch.env_count() - 1));
    }
    const Part rows = part_of(from.env_row_offsets, "env_row_offsets", env, env + 1, from.b.size());
    const Part cones = part_of(from.env_cone_offsets, "env_cone_offsets", env, env + 1, from.cone_kind.size());
    (void)part_of(from.row_offsets, "row_offsets", rows.begin, rows.end, from.column.size());

    // Offsets are shared by neighbours: one that is wrong here would be wrong for the next environment of `order`.
    const Part tiled = part_of(from.cone_row_offsets, "cone_row_offsets", cones.begin, cones.end, from.b.size());
    if (tiled.begin != rows.begin || tiled.end != rows.end) {
      refuse("the cones of env " + std::to_string(env) + " tile rows " + std::to_string(tiled.begin) + ".." +
             std::to_string(tiled.end) + ", expected " + std::to_string(rows.begin) + ".." + std::to_string(rows.end) +
             "; fix cone_row_offsets (validate() lists every defect)");
    }

    if (!from.factor_offsets.empty())
      (void)part_of(from.factor_offsets, "factor_offsets", env, env + 1, from.factor.size());
    append_environment(to, view, env);
  }
  return ContactBatch<Real>::from_arrays(batch.law(), std::move(to));
}

template struct Environment<float>;
template struct Environment<double>;
template class ContactBatch<float>;
template class ContactBatch<double>;
template ContactBatch<float> convert(const ContactBatch<float>&);
template ContactBatch<float> convert(const ContactBatch<double>&);
template ContactBatch<double> convert(const ContactBatch<float>&);
template ContactBatch<double> convert(const ContactBatch<double>&);
template ContactBatch<float> gather(const ContactBatch<float>&, std::span<const Offset>);
template ContactBatch<double> gather(const ContactBatch<double>&, std::span<const Offset>);

}  // namespace stiction
