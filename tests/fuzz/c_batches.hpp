#pragma once

#include "tests/fuzz/c_form.hpp"

/// Sound batches of the C interface: kEnvs environments that are alike, each with one friction cone of three rows and
/// one unilateral row. Entries of an array that belong to one environment lie together.
namespace stiction::fuzz {

inline constexpr int kEnvs = 3, kRows = 4, kCones = 2, kDofs = 2, kBodies = 2, kContacts = 3;

template <class Real>
constexpr std::int32_t kPrecisionOf = std::is_same_v<Real, double> ? STICTION_F64 : STICTION_F32;

template <class T>
std::vector<T> repeated(std::vector<T> one, int times) {
  std::vector<T> all;
  for (int i = 0; i < times; ++i) all.insert(all.end(), one.begin(), one.end());
  return all;
}

/// 0, step, 2 step, ...
template <class T>
std::vector<T> steps(int count, T step) {
  std::vector<T> all;
  for (int i = 0; i < count; ++i) all.push_back(static_cast<T>(i) * step);
  return all;
}

template <class Real, class View>
void add_cones(CForm<View>& form) {
  form.view.precision = kPrecisionOf<Real>;
  form.view.law = STICTION_LAW_COULOMB;
  form.view.env_count = kEnvs;
  form.view.cone_count = kEnvs * kCones;
  form.view.row_count = kEnvs * kRows;
  form.length(offsetof(View, env_count));
  form.length(offsetof(View, cone_count));
  form.length(offsetof(View, row_count));
  form.choice(offsetof(View, space));
  form.choice(offsetof(View, law));
  std::vector<std::int64_t> cone_rows;
  for (int env = 0; env < kEnvs; ++env) cone_rows.insert(cone_rows.end(), {kRows * env, kRows * env + 3});
  cone_rows.push_back(kEnvs * kRows);
  form.array(offsetof(View, env_row_offsets), steps<std::int64_t>(kEnvs + 1, kRows));
  form.array(offsetof(View, env_cone_offsets), steps<std::int64_t>(kEnvs + 1, kCones));
  form.array(offsetof(View, env_row_counts), repeated<std::int32_t>({kRows}, kEnvs), true);
  form.array(offsetof(View, env_cone_counts), repeated<std::int32_t>({kCones}, kEnvs), true);
  form.array(offsetof(View, env_flags), repeated<std::uint32_t>({0}, kEnvs), true);
  form.array(offsetof(View, env_tolerance), repeated<double>({-1}, kEnvs), true);
  form.array(offsetof(View, cone_kind),
             repeated<std::uint8_t>({STICTION_CONE_FRICTION, STICTION_CONE_UNILATERAL}, kEnvs));
  form.array(offsetof(View, cone_row_offsets), cone_rows);
  form.array(offsetof(View, cone_group), repeated<std::int32_t>({-1}, kEnvs * kCones), true);
  form.array(offsetof(View, R), repeated<Real>({0, 0.125, 0, 0}, kEnvs));
  form.array(offsetof(View, mu), repeated<Real>({0, 0.5, 0.75, 0}, kEnvs));
  form.array(offsetof(View, lo), repeated<Real>({0, 0, 0, -1}, kEnvs));
  form.array(offsetof(View, hi), repeated<Real>({0, 0, 0, 1}, kEnvs));
}

template <class Real>
CForm<stiction_batch_view> contact_form() {
  using View = stiction_batch_view;
  CForm<View> form;
  stiction_batch_view_init(&form.view, sizeof form.view);
  add_cones<Real>(form);
  constexpr int kEntries = kRows * kRows;
  form.view.nonzero_count = kEnvs * kEntries;
  form.view.column_count = kEnvs * kEntries;
  form.view.mu_count = kEnvs * kRows;
  form.view.factor_count = kEnvs * kRows;
  form.length(offsetof(View, nonzero_count));
  form.length(offsetof(View, column_count));
  form.length(offsetof(View, mu_count));
  form.length(offsetof(View, factor_count));
  form.choice(offsetof(View, normal_last));
  std::vector<std::int32_t> columns;
  for (int row = 0; row < kRows; ++row) columns.insert(columns.end(), {0, 1, 2, 3});
  form.array(offsetof(View, row_offsets), steps<std::int64_t>(kEnvs * kRows + 1, kRows));
  form.array(offsetof(View, row_counts), repeated<std::int32_t>({kRows}, kEnvs * kRows), true);
  form.array(offsetof(View, column), repeated(columns, kEnvs));
  form.array(offsetof(View, column_offsets), steps<std::int64_t>(kEnvs * kRows, kRows), true);
  form.array(offsetof(View, A),
             repeated<Real>({2, 0.5, 0, 0.25, 0.5, 1.5, 0, 0, 0, 0, 1, -0.5, 0.25, 0, -0.5, 3}, kEnvs));
  form.array(offsetof(View, b), repeated<Real>({-9.75, 2, 0.5, -1}, kEnvs));
  form.array(offsetof(View, mu_offsets), steps<std::int64_t>(kEnvs * kRows, 1), true);
  form.array(offsetof(View, factor_offsets), repeated<std::int64_t>({0}, kEnvs + 1), true);
  form.array(offsetof(View, factor), repeated<Real>({1, 0, 0.5, 2}, kEnvs), true);
  return form;
}

template <class Real>
CForm<stiction_jacobian_view> jacobian_form() {
  using View = stiction_jacobian_view;
  CForm<View> form;
  stiction_jacobian_view_init(&form.view, sizeof form.view);
  add_cones<Real>(form);
  form.view.dof_count = kEnvs * kDofs;
  form.view.entry_count = kEnvs * kRows * kDofs;
  form.view.mass_count = kEnvs * kDofs * kDofs;
  form.length(offsetof(View, dof_count));
  form.length(offsetof(View, entry_count));
  form.length(offsetof(View, mass_count));
  form.choice(offsetof(View, mass_form));
  form.choice(offsetof(View, mass_block));
  form.choice(offsetof(View, reserved));
  form.array(offsetof(View, env_dof_offsets), steps<std::int64_t>(kEnvs + 1, kDofs));
  form.array(offsetof(View, env_mass_offsets), steps<std::int64_t>(kEnvs + 1, kDofs * kDofs));
  form.array(offsetof(View, row_offsets), steps<std::int64_t>(kEnvs * kRows + 1, kDofs));
  form.array(offsetof(View, column), repeated<std::int32_t>({0, 1}, kEnvs * kRows), true);
  form.array(offsetof(View, J), repeated<Real>({1, 0, 0, 1, 0.5, 0.5, -1, 2}, kEnvs));
  form.array(offsetof(View, M), repeated<Real>({2, 0.5, 0.5, 1}, kEnvs));
  form.array(offsetof(View, v_free), repeated<Real>({-1, 0.5}, kEnvs));
  form.array(offsetof(View, target), repeated<Real>({0, 0, 0, 0.25}, kEnvs), true);
  return form;
}

template <class Real>
CForm<stiction_body_view> body_form() {
  using View = stiction_body_view;
  CForm<View> form;
  stiction_body_view_init(&form.view, sizeof form.view);
  form.view.precision = kPrecisionOf<Real>;
  form.view.env_count = kEnvs;
  form.view.body_count = kEnvs * kBodies;
  form.view.contact_count = kEnvs * kContacts;
  form.length(offsetof(View, env_count));
  form.length(offsetof(View, body_count));
  form.length(offsetof(View, contact_count));
  form.choice(offsetof(View, space));
  form.array(offsetof(View, env_body_offsets), steps<std::int64_t>(kEnvs + 1, kBodies));
  form.array(offsetof(View, env_contact_offsets), steps<std::int64_t>(kEnvs + 1, kContacts));
  form.array(offsetof(View, inv_mass), repeated<Real>({1, 0.5}, kEnvs));
  form.array(offsetof(View, inv_inertia), repeated<Real>({1, 0, 0, 2, 0.5, 3}, kEnvs * kBodies));
  form.array(offsetof(View, twist), repeated<Real>({0, 0.25, -1, 0, 0, 0.5}, kEnvs * kBodies));
  form.array(offsetof(View, twist_change), repeated<Real>({0, 0, -0.0625, 0, 0, 0}, kEnvs * kBodies), true);
  form.array(offsetof(View, kinematic), repeated<std::uint8_t>({0}, kEnvs * kBodies), true);
  form.array(offsetof(View, body_a), repeated<std::int32_t>({-1, -1, 0}, kEnvs));
  form.array(offsetof(View, body_b), repeated<std::int32_t>({0, 1, 1}, kEnvs));
  form.array(offsetof(View, arm_a), repeated<Real>({0, 0, 0.5}, kEnvs * kContacts));
  form.array(offsetof(View, arm_b), repeated<Real>({0, 0.25, -0.5}, kEnvs * kContacts));
  form.array(offsetof(View, normal), repeated<Real>({0, 0, 1}, kEnvs * kContacts));
  form.array(offsetof(View, mu), repeated<Real>({0.5, 0, 1}, kEnvs));
  form.array(offsetof(View, depth), repeated<Real>({0.0625, 0, -0.0625}, kEnvs));
  form.array(offsetof(View, restitution), repeated<Real>({0, 0.5, 1}, kEnvs));
  return form;
}

}  // namespace stiction::fuzz
