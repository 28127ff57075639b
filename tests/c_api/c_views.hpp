#pragma once

#include <type_traits>
#include <vector>

#include "stiction.h"
#include "stiction/batch_arrays.hpp"
#include "stiction/jacobian_solver.hpp"
#include "tests/support/systems/body_systems.hpp"
#include "tests/support/systems/random_systems.hpp"

/// For a program that has GoogleTest.
#define STICTION_OK_OR_SAY(call) ASSERT_EQ(call, STICTION_OK) << stiction_last_error()

/// Batches, and views of C++ as structs of C.
namespace stiction::test {

template <class Real>
constexpr std::int32_t kPrecision = std::is_same_v<Real, double> ? STICTION_F64 : STICTION_F32;

inline stiction_status* records(std::vector<EnvStatus>& status) {
  return reinterpret_cast<stiction_status*>(status.data());
}

template <class Real>
Solution<Real> room_for(Offset rows, Offset envs) {
  return {std::vector<Real>(static_cast<std::size_t>(rows)), std::vector<Real>(static_cast<std::size_t>(rows)),
          std::vector<EnvStatus>(static_cast<std::size_t>(envs))};
}

template <class Real>
stiction_solution c_view(Solution<Real>& solution) {
  stiction_solution c;
  stiction_solution_init(&c, sizeof c);
  c.lambda = solution.lambda.data();
  c.w = solution.w.data();
  c.status = records(solution.status);
  return c;
}

/// An array of C++ as one of C, which may have no type.
struct ToC {
  template <class T, class Untyped>
  void operator()(const BatchArray&, const T* cpp, const Untyped*& c) const {
    c = reinterpret_cast<const Untyped*>(cpp);
  }
};

template <class C>
void copy_layout(C& c, const BatchLayout& cpp) {
  c.law = static_cast<std::int32_t>(cpp.law);
  c.env_count = cpp.env_count;
  c.cone_count = cpp.cone_count;
  c.row_count = cpp.row_count;
}

template <class Real>
stiction_batch_view c_view(const ContactBatchView<Real>& batch) {
  stiction_batch_view c;
  stiction_batch_view_init(&c, sizeof c);
  copy_layout(c, batch);
  c.precision = kPrecision<Real>;
  c.nonzero_count = batch.nonzero_count;
  c.factor_count = batch.factor_count;
  for_each_array(batch, ToC{}, batch, c);
  return c;
}

inline stiction_jacobian_view c_view(const JacobianBatchView<double>& batch) {
  stiction_jacobian_view c;
  stiction_jacobian_view_init(&c, sizeof c);
  copy_layout(c, batch);
  c.precision = STICTION_F64;
  c.mass_form = static_cast<std::int32_t>(batch.mass_form);
  c.mass_block = batch.mass_block;
  c.dof_count = batch.dof_count;
  c.entry_count = batch.entry_count;
  c.mass_count = batch.mass_count;
  for_each_array(batch, ToC{}, batch, c);
  return c;
}

inline stiction_body_view c_view(const BodyBatchView<double>& batch) {
  stiction_body_view c;
  stiction_body_view_init(&c, sizeof c);
  c.precision = STICTION_F64;
  c.env_count = batch.env_count;
  c.body_count = batch.body_count;
  c.contact_count = batch.contact_count;
  for_each_array(batch, ToC{}, batch, c);
  return c;
}

inline ContactBatch<double> contacts() {
  ContactBatch<double> batch(Law::coulomb);
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    Recipe recipe;
    recipe.seed = seed;
    batch.add(random_contacts(recipe));
  }
  return batch;
}

/// `press`: depth of each contact beyond the one before, beside its random depth [m].
inline BodyBatch<double> thrown_bodies(std::uint64_t seed, double press) {
  BodyBatch<double> batch;
  for (std::uint64_t env = 0; env < 3; ++env) {
    BodyEnvironment<double> thrown = random_bodies(seed + env, 6, 12);
    for (std::size_t k = 0; k < thrown.contacts.size(); ++k) thrown.contacts[k].depth += press * static_cast<double>(k);
    batch.add(thrown);
  }
  return batch;
}

}  // namespace stiction::test
