#include "python/src/mujoco_system.hpp"

namespace stiction::python {

namespace {

/// Offsets behind others, which end with the number of their items.
void append_offsets(std::vector<Offset>& to, const std::vector<Offset>& from) {
  const Offset end = to.back();
  for (std::size_t i = 1; i < from.size(); ++i) to.push_back(end + from[i]);
}

template <class Number>
void append_all(std::vector<Number>& to, const std::vector<Number>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

}  // namespace

MujocoSystem::MujocoSystem(MassForm form) : mass_form(form) {
  for (auto* offsets :
       {&env_row_offsets, &env_cone_offsets, &env_dof_offsets, &env_mass_offsets, &cone_row_offsets, &row_offsets})
    offsets->assign(1, 0);
  for (auto* numbers : {&J, &M, &v_free, &target, &R, &mu, &lo, &hi, &start, &lambda, &velocity}) numbers->reserve(1);
  cone_kind.reserve(1);
  cone_id.reserve(1);
}

BatchLayout MujocoSystem::layout() const {
  BatchLayout layout;
  layout.env_count = static_cast<Offset>(env_row_offsets.size()) - 1;
  layout.cone_count = static_cast<Offset>(cone_kind.size());
  layout.row_count = static_cast<Offset>(R.size());
  layout.env_row_offsets = env_row_offsets.data();
  layout.env_cone_offsets = env_cone_offsets.data();
  layout.cone_kind = reinterpret_cast<const ConeKind*>(cone_kind.data());
  layout.cone_row_offsets = cone_row_offsets.data();
  return layout;
}

JacobianBatchView<double> MujocoSystem::view() const {
  JacobianBatchView<double> view;
  static_cast<BatchLayout&>(view) = layout();
  view.dof_count = static_cast<Offset>(v_free.size());
  view.entry_count = static_cast<Offset>(J.size());
  view.mass_count = static_cast<Offset>(M.size());
  view.env_dof_offsets = env_dof_offsets.data();
  view.env_mass_offsets = env_mass_offsets.data();
  view.row_offsets = row_offsets.data();
  view.J = J.data();
  view.M = M.data();
  view.v_free = v_free.data();
  view.target = target.data();
  view.R = R.data();
  view.mu = mu.data();
  view.lo = lo.data();
  view.hi = hi.data();
  view.mass_form = mass_form;
  return view;
}

void MujocoSystem::append(const MujocoSystem& other) {
  append_offsets(env_row_offsets, other.env_row_offsets);
  append_offsets(env_cone_offsets, other.env_cone_offsets);
  append_offsets(env_dof_offsets, other.env_dof_offsets);
  append_offsets(env_mass_offsets, other.env_mass_offsets);
  append_offsets(cone_row_offsets, other.cone_row_offsets);
  append_offsets(row_offsets, other.row_offsets);
  append_all(cone_kind, other.cone_kind);
  append_all(cone_id, other.cone_id);
  append_all(J, other.J);
  append_all(M, other.M);
  append_all(v_free, other.v_free);
  append_all(target, other.target);
  append_all(R, other.R);
  append_all(mu, other.mu);
  append_all(lo, other.lo);
  append_all(hi, other.hi);
  append_all(start, other.start);
  append_all(lambda, other.lambda);
  append_all(velocity, other.velocity);
  append_all(status, other.status);
}

}  // namespace stiction::python
