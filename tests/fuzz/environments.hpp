#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "stiction/batch.hpp"
#include "tests/fuzz/numbers.hpp"

namespace stiction::fuzz {

/// One environment and its parts: its limits, and its start.
template <class Real>
struct Case {
  Environment<Real> environment;
  std::vector<Real> warm_start;
  double tolerance = -1;
  Index max_iterations = -1;
};

/// Cones of all kinds, 1 to `most` of them.
template <class Real>
std::vector<typename Environment<Real>::Cone> cones(Bytes& bytes, int most) {
  std::vector<typename Environment<Real>::Cone> result(static_cast<std::size_t>(1 + bytes.below(most)));
  for (auto& cone : result) {
    cone.kind = static_cast<ConeKind>(bytes.below(5));
    if (carries_friction(cone.kind)) cone.row_count = 2 + bytes.below(5);
    if (bytes.once_in(8)) cone.group = bytes.below(2);
  }
  return result;
}

template <class Real>
Index rows_of(const std::vector<typename Environment<Real>::Cone>& all) {
  Index rows = 0;
  for (const auto& cone : all) rows += cone.row_count;
  return rows;
}

/// Sound numbers. A is symmetric and its diagonal outweighs the rest of each row. A share of it is stored, so that
/// there are environments of several islands and some that are not solved densely.
template <class Real>
Case<Real> sound_case(Bytes& bytes) {
  Case<Real> result;
  Environment<Real>& environment = result.environment;
  environment.cones = cones<Real>(bytes, bytes.once_in(16) ? 40 : 4);
  const auto n = static_cast<std::size_t>(rows_of<Real>(environment.cones));
  const int stored = bytes.below(5);
  std::vector<Real> matrix(n * n, Real(0));
  const Real scale = Real(0.5) / static_cast<Real>(8 * n);
  for (std::size_t i = 0; i < n; ++i) {
    matrix[i * n + i] = Real(1) + share<Real>(bytes);
    for (std::size_t j = 0; j < i; ++j) {
      if (stored != 4 && (i + j) % 4 >= static_cast<std::size_t>(stored) && j + 1 != i) continue;
      matrix[i * n + j] = matrix[j * n + i] = scale * tame<Real>(bytes);
    }
  }
  environment.set_dense(matrix, static_cast<Index>(n));
  for (std::size_t i = 0; i < n; ++i) {
    environment.b.push_back(tame<Real>(bytes));
    environment.mu.push_back(share<Real>(bytes));
    environment.R.push_back(bytes.once_in(2) ? share<Real>(bytes) : Real(0));
    environment.lo.push_back(-share<Real>(bytes));
    environment.hi.push_back(share<Real>(bytes));
    result.warm_start.push_back(tame<Real>(bytes));
  }
  return result;
}

/// Some numbers of a sound case replaced by any others.
template <class Real>
void spoil(Case<Real>& spoiled, Bytes& bytes) {
  Environment<Real>& environment = spoiled.environment;
  std::vector<Real>* arrays[] = {&environment.A,  &environment.b,  &environment.R,      &environment.mu,
                                 &environment.lo, &environment.hi, &spoiled.warm_start, &environment.A};
  for (int edits = bytes.below(8); edits > 0; --edits) {
    std::vector<Real>& array = *bytes.one_of(arrays);
    array[bytes.byte() % array.size()] = wild<Real>(bytes);
  }
  if (bytes.once_in(8)) {
    const Real factor = wild<Real>(bytes);
    for (Real& value : environment.A) value *= factor;
  }
  if (bytes.once_in(8)) {
    const Real factor = wild<Real>(bytes);
    for (Real& value : environment.b) value *= factor;
  }
  if (bytes.once_in(8)) spoiled.tolerance = wild<double>(bytes);
  if (bytes.once_in(8)) spoiled.max_iterations = bytes.below(40) - 8;
}

template <class Real>
ContactBatch<Real> batch_of(Law law, const std::vector<Case<Real>>& cases) {
  ContactBatch<Real> plain(law);
  for (const auto& one : cases) plain.add(one.environment);
  typename ContactBatch<Real>::Arrays arrays = plain.arrays();
  for (const auto& one : cases) {
    arrays.env_tolerance.push_back(one.tolerance);
    arrays.env_max_iterations.push_back(one.max_iterations);
  }
  return ContactBatch<Real>::from_arrays(law, arrays);
}

template <class Real>
std::vector<Real> warm_starts_of(const std::vector<Case<Real>>& cases) {
  std::vector<Real> all;
  for (const auto& one : cases) all.insert(all.end(), one.warm_start.begin(), one.warm_start.end());
  return all;
}

}  // namespace stiction::fuzz
