#include "core/runtime/articulated/articulated_model.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>
#include <utility>

#include "core/base/extents.hpp"
#include "core/runtime/articulated/ground_plane.hpp"
#include "core/runtime/articulated/hull_faces.hpp"
#include "core/runtime/articulated/implicit_forces.hpp"
#include "core/runtime/articulated/observed_arrays.hpp"
#include "core/runtime/articulated/pair_shapes.hpp"
#include "core/runtime/articulated/row_give.hpp"
#include "core/runtime/articulated/varied_arrays.hpp"
#include "stiction/error.hpp"

namespace stiction {

namespace {

template <class T, std::size_t kCount>
void put(T (&to)[kCount], const std::array<double, kCount>& from) {
  for (std::size_t k = 0; k < kCount; ++k) to[k] = static_cast<T>(from[k]);
}

/// Inertia as a round part and the excess of some principal axes.
template <class T>
void put_inertia(ArticulatedBodyData<T>& to, const ArticulatedBody& from, bool has_all_axes) {
  const std::array<double, 3>& d = from.inertia;
  const Matrix3 axes = axes_from(from.inertia_axes);
  const double same = kSameMoments * (d[0] + d[1] + d[2]);
  const std::size_t round = std::fabs(d[1] - d[2]) < same ? 1 : 0;
  to.round = static_cast<T>(d[round]);
  to.moment[0] = static_cast<Index>(round);
  to.more_axes = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (axis == round || (!has_all_axes && std::fabs(d[axis] - d[round]) < same)) continue;
    const auto place = at(to.more_axes++);
    to.more[place] = static_cast<T>(d[axis] - d[round]);
    to.moment[place + 1] = static_cast<Index>(axis);
    for (std::size_t k = 0; k < 3; ++k) to.axis[place][k] = static_cast<T>(axes[3 * axis + k]);
  }
}

}  // namespace

template <class T>
ArticulatedModel<T>::ArticulatedModel(const ArticulatedDescription& description, VariedSet varies) : varies_(varies) {
  add_bodies(description);
  add_actuators(description);
  add_limits(description);
  add_pairs(description);
  add_groups(description);
  tendon_terms_ = tendon_terms_of(description, joints_);
  put_observed_widths(description, view_);
  put_varied_widths(description, view_);
}

template <class T>
void ArticulatedModel<T>::add_bodies(const ArticulatedDescription& from) {
  Index joint = 0, q = 0, dof = 0;
  for (std::size_t b = 0; b < from.bodies.size(); ++b) {
    const ArticulatedBody& body = from.bodies[b];
    ArticulatedBodyData<T> to{};
    to.parent = body.parent;
    to.root = body.parent == 0 ? static_cast<Index>(b) : bodies_[at(body.parent)].root;
    to.joint_begin = joint;
    to.joint_end = joint + body.joints;
    to.dof_begin = dof;
    put(to.position, body.position);
    put(to.orientation, body.orientation);
    put(to.centre, body.centre);
    to.mass = to.subtree_mass = static_cast<T>(body.mass);
    to.held_share = static_cast<T>(body.gravity_compensation);
    const bool may_weigh = body.mass != 0 || varies(VariedArray::body_mass);
    view_.holds_weight = view_.holds_weight || (to.held_share != 0 && may_weigh);
    to.is_turned = body.orientation != std::array<double, 4>{1, 0, 0, 0};
    put_inertia(to, body, varies(VariedArray::body_inertia));
    for (; joint < to.joint_end; ++joint) {
      const ArticulatedJoint& own = from.joints[at(joint)];
      ArticulatedJointData<T> data{};
      data.kind = own.kind;
      data.body = static_cast<Index>(b);
      data.q = q;
      data.dof = dof;
      data.is_offset = own.position != std::array<double, 3>{};
      data.is_force_limited = own.is_force_limited;
      put(data.position, own.position);
      put(data.axis, own.axis);
      data.reference = static_cast<T>(own.reference);
      data.stiffness = static_cast<T>(own.stiffness);
      data.rest = static_cast<T>(own.rest);
      put(data.force_range, own.force_range);
      joints_.push_back(data);
      const bool is_free = own.kind == JointKind::free, is_spin = is_free || own.kind == JointKind::ball;
      if (is_free)
        for (std::size_t k = 0; k < 3; ++k) qpos0_.push_back(static_cast<T>(body.position[k]));
      if (is_spin) {
        const std::array<double, 4> start = is_free ? body.orientation : std::array<double, 4>{1, 0, 0, 0};
        for (const double number : start) qpos0_.push_back(static_cast<T>(number));
      } else {
        qpos0_.push_back(data.reference);
      }
      const Index count = is_free ? 6 : is_spin ? 3 : 1;
      for (Index k = 0; k < count; ++k, ++dof) {
        const ArticulatedDof& number = from.dofs[at(dof)];
        ArticulatedDofData<T> one{};
        one.body = static_cast<Index>(b);
        one.joint = joint;
        const std::vector<Index> before = chain_of(body.parent);
        one.parent = dof > to.dof_begin ? dof - 1 : before.empty() ? -1 : before.back();
        one.kind = is_free && k < 3               ? static_cast<DofKind>(k)
                   : is_spin                      ? DofKind::spin
                   : own.kind == JointKind::slide ? DofKind::slide
                                                  : DofKind::hinge;
        one.armature = static_cast<T>(number.armature);
        one.damping = static_cast<T>(number.damping);
        one.step_damping = static_cast<T>(from.timestep * number.damping);
        dofs_.push_back(one);
      }
      q = static_cast<Index>(qpos0_.size());
    }
    to.dof_end = dof;
    bodies_.push_back(to);
  }
  std::vector<double> mass;
  for (const ArticulatedBody& body : from.bodies) mass.push_back(body.mass);
  for (std::size_t b = bodies_.size() - 1; b > 0; --b) {
    bodies_[b].subtree_mass = static_cast<T>(mass[b]);
    mass[at(bodies_[b].parent)] += mass[b];
  }
  Index trees = 0;  // that move
  for (std::size_t b = 1; b < bodies_.size(); ++b)
    if (bodies_[b].dof_end > bodies_[b].dof_begin && chain_of(bodies_[b].parent).empty()) ++trees;
  view_.is_one_tree = trees == 1;
  view_.step = static_cast<T>(from.timestep);
  put(view_.gravity, from.gravity);
  view_.impratio = static_cast<T>(from.impratio);
  view_.is_elliptic = from.is_elliptic;
  view_.is_rk4 = from.is_rk4;
  put_implicit_forces(from, varies_, joints_, view_);
}

template <class T>
std::vector<Index> ArticulatedModel<T>::chain_of(Index body) const {
  std::vector<Index> chain;
  for (; body > 0; body = bodies_[at(body)].parent)
    for (Index dof = bodies_[at(body)].dof_end - 1; dof >= bodies_[at(body)].dof_begin; --dof) chain.push_back(dof);
  std::reverse(chain.begin(), chain.end());
  return chain;
}

template <class T>
void ArticulatedModel<T>::add_actuators(const ArticulatedDescription& from) {
  for (const ArticulatedActuator& one : from.actuators) {
    const ArticulatedJointData<T>& joint = joints_[at(one.joint)];
    ArticulatedActuatorData<T> to{};
    to.q = joint.q;
    to.dof = joint.dof;
    to.gear = static_cast<T>(one.gear);
    put(to.gain, one.gain);
    put(to.bias, one.bias);
    put(to.control, one.control);
    put(to.force, one.force);
    actuators_.push_back(to);
  }
}

template <class T>
void ArticulatedModel<T>::add_limits(const ArticulatedDescription& from) {
  for (const ArticulatedEquality& one : from.equalities) {
    const ArticulatedJointData<T>& a = joints_[at(one.joint_a)];
    ArticulatedEqualityData<T> to{a.q, a.dof, -1, -1, a.reference, T(0), {}, {}};
    double weight = from.dofs[at(a.dof)].inverse_weight;
    if (one.joint_b >= 0) {
      const ArticulatedJointData<T>& b = joints_[at(one.joint_b)];
      to.q_b = b.q;
      to.dof_b = b.dof;
      to.reference_b = b.reference;
      weight += from.dofs[at(b.dof)].inverse_weight;
    }
    put(to.polynomial, one.polynomial);
    to.give = give_of<T>(from, one.give, weight);
    equalities_.push_back(to);
  }
  for (std::size_t dof = 0; dof < from.dofs.size(); ++dof) {
    const ArticulatedDof& one = from.dofs[dof];
    if (!(one.friction_loss > 0) && !varies(VariedArray::dof_friction_loss)) continue;
    losses_.push_back(
        {static_cast<Index>(dof), static_cast<T>(one.friction_loss), give_of<T>(from, one.loss, one.inverse_weight)});
  }
  for (std::size_t j = 0; j < from.joints.size(); ++j) {
    const ArticulatedJoint& joint = from.joints[j];
    if (!joint.is_limited) continue;
    const Index dof = joints_[j].dof;
    const RowGive<T> give = give_of<T>(from, joint.limit, from.dofs[at(dof)].inverse_weight);
    for (std::size_t side = 0; side < 2; ++side)
      limits_.push_back({joints_[j].q, dof, side == 0 ? T(1) : T(-1), static_cast<T>(joint.range[side]),
                         static_cast<T>(joint.margin), give});
  }
}

template <class T>
void ArticulatedModel<T>::add_pairs(const ArticulatedDescription& from) {
  for (const ArticulatedGeom& one : from.geoms) {
    ArticulatedGeomData<T> to{};
    to.body = one.body;
    to.kind = one.kind;
    put(to.size, one.size);
    put(to.position, one.position);
    put(to.axes, axes_from(one.orientation));
    to.field = one.field;
    add_hull(from, one, to, vertices_, faces_, corners_);
    geoms_.push_back(to);
  }
  for (const ArticulatedHeightField& one : from.fields) {
    ArticulatedFieldData<T> to{one.rows, one.columns, static_cast<Offset>(heights_.size()), {}, {}, {}};
    put(to.half, one.half);
    put(to.cell, {2 * one.half[0] / (one.columns - 1), 2 * one.half[1] / (one.rows - 1)});
    to.base = static_cast<T>(one.base);
    fields_.push_back(to);
    for (const double height : one.heights) heights_.push_back(static_cast<T>(height));
  }
  for (const ArticulatedPair& one : from.pairs) {
    const ArticulatedGeom &a = from.geoms[at(one.geom_a)], &b = from.geoms[at(one.geom_b)];
    const auto& weight_a = from.bodies[at(a.body)].inverse_weight;
    const auto& weight_b = from.bodies[at(b.body)].inverse_weight;
    ArticulatedPairData<T> to{};
    to.geom_a = one.geom_a;
    to.geom_b = one.geom_b;
    to.dim = one.dim;
    to.first = view_.points;
    to.points = points_of(a, b);
    view_.points += to.points;
    if (a.kind == GeomKind::plane) {
      const GroundPlane ground = ground_plane(from, a);
      put(to.normal, ground.normal);
      to.offset = static_cast<T>(ground.offset);
    }
    to.margin = static_cast<T>(one.margin);
    to.reach = static_cast<T>(one.reach);
    const double most = one.margin > one.reach ? one.margin : one.reach;
    const double bound = height_of(from, a) + radius_of(from, b) + most;
    to.bound = static_cast<T>(bound * (1 + 1e-6));
    put(to.friction, one.friction);
    const double slide = one.friction[0] * one.friction[0];
    to.ratio[0] = T(1);
    if (from.is_elliptic) {
      for (std::size_t k = 1; k < 6; ++k)
        to.ratio[k] = static_cast<T>(slide / (one.friction[k - 1] * one.friction[k - 1]) / from.impratio);
    } else {
      to.ratio[1] = static_cast<T>(2 * slide / from.impratio);
    }
    double weight = weight_a[0] + weight_b[0];
    if (!from.is_elliptic && one.dim > 1 && !varies(VariedArray::pair_friction)) weight += slide * weight;
    to.give = give_of<T>(from, one.give, weight, one.friction_solref);
    pairs_.push_back(to);
  }
}

template <class T>
void ArticulatedModel<T>::put_columns(RowClass& rows, const std::vector<int>& side) {
  rows.columns = static_cast<Index>(columns_.size());
  for (std::size_t dof = 0; dof < side.size(); ++dof) {
    if (side[dof] == 0) continue;
    columns_.push_back(static_cast<Index>(dof));
    sides_.push_back(static_cast<std::int8_t>(side[dof]));
  }
  rows.column_count = static_cast<Index>(columns_.size()) - rows.columns;
}

namespace {

/// A group of rows before it has a place.
struct LooseGroup {
  RowClass rows;
  RowGroup group;
  std::vector<int> side;  ///< of each degree of freedom: which body it moves, 0: neither
  Index power;            ///< of the impedance; of an equality its number
};

/// The key that all groups of a class have.
auto class_of(const LooseGroup& one) {
  const RowClass& rows = one.rows;
  return std::tie(rows.rows, rows.dofs, rows.source, rows.dim, rows.cones, one.power, one.side);
}

}  // namespace

template <class T>
void ArticulatedModel<T>::add_groups(const ArticulatedDescription& from) {
  std::vector<LooseGroup> loose;
  const auto add = [&](RowClass rows, RowGroup group, std::vector<int> side, Index power) {
    for (std::size_t dof = 0; dof < side.size(); ++dof)
      if (side[dof] != 0) rows.dofs |= std::uint64_t{1} << dof;
    if (rows.dofs != 0) loose.push_back({rows, group, std::move(side), power});
  };
  const auto only = [&](Index dof) {
    std::vector<int> side(dofs_.size());
    side[at(dof)] = 1;
    return side;
  };
  // A class of its own for each: their polynomials differ.
  for (std::size_t i = 0; i < equalities_.size(); ++i) {
    std::vector<int> side = only(equalities_[i].dof_a);
    if (equalities_[i].dof_b >= 0) side[at(equalities_[i].dof_b)] = -1;
    const auto index = static_cast<Index>(i);
    add({RowSource::equality, 0, 0, 1, 1, 1, 0, 0, 0}, {index, -1}, std::move(side), index);
  }
  for (std::size_t i = 0; i < losses_.size(); ++i)
    add({RowSource::loss, 0, 0, 1, 1, 1, 0, 0, 0}, {static_cast<Index>(i), -1}, only(losses_[i].dof), 0);
  for (std::size_t i = 0; i < limits_.size(); ++i)
    add({RowSource::limit, 0, 0, 1, 1, 1, 0, 0, 0}, {static_cast<Index>(i), -1}, only(limits_[i].dof), 0);
  for (std::size_t p = 0; p < pairs_.size(); ++p) {
    const ArticulatedPairData<T>& pair = pairs_[p];
    std::vector<int> side(dofs_.size());
    for (const Index dof : chain_of(geoms_[at(pair.geom_b)].body)) side[at(dof)] += 1;
    for (const Index dof : chain_of(geoms_[at(pair.geom_a)].body)) side[at(dof)] -= 1;
    const bool is_cone = from.is_elliptic && pair.dim > 1;
    const Index cones = is_cone || pair.dim == 1 ? 1 : 2 * (pair.dim - 1);
    for (Index k = 0; k < pair.points; ++k)
      add({RowSource::contact, 0, 0, pair.dim, cones, is_cone ? pair.dim : 1, 0, 0, 0},
          {pair.first + k, static_cast<Index>(p)}, side, pair.give.power);
  }
  std::stable_sort(loose.begin(), loose.end(),
                   [](const LooseGroup& a, const LooseGroup& b) { return class_of(a) < class_of(b); });
  Offset rows = 0;
  for (std::size_t i = 0; i < loose.size(); ++i) {
    if (i == 0 || class_of(loose[i - 1]) != class_of(loose[i])) {
      classes_.push_back(loose[i].rows);
      classes_.back().begin = static_cast<Index>(i);
      put_columns(classes_.back(), loose[i].side);
    }
    classes_.back().end = static_cast<Index>(i) + 1;
    groups_.push_back(loose[i].group);
    rows += Offset{loose[i].rows.cones} * loose[i].rows.rows;
  }
  if (rows > kMostArticulatedRows)
    throw Error(ErrorCode::unsupported, "pairs, limits and friction losses have " + std::to_string(rows) +
                                            " rows: at most " + std::to_string(kMostArticulatedRows) +
                                            " of an environment are stepped in lanes; exclude pairs that never touch");
  view_.most_rows = static_cast<Index>(rows);
}

template <class T>
ArticulatedModelView<T> ArticulatedModel<T>::view() const {
  ArticulatedModelView<T> view = view_;
  const auto put_array = [](Index& count, auto*& pointer, const auto& array) {
    count = static_cast<Index>(array.size());
    pointer = array.data();
  };
  view.q_count = static_cast<Index>(qpos0_.size());
  put_array(view.bodies, view.body, bodies_);
  put_array(view.joints, view.joint, joints_);
  put_array(view.dof_count, view.dof, dofs_);
  put_array(view.actuator_count, view.actuator, actuators_);
  put_array(view.geoms, view.geom, geoms_);
  put_array(view.fields, view.field, fields_);
  put_array(view.heights, view.height, heights_);
  put_array(view.vertices, view.vertex, vertices_);
  put_array(view.faces, view.face, faces_);
  put_array(view.corners, view.corner, corners_);
  put_array(view.pairs, view.pair, pairs_);
  put_array(view.equalities, view.equality, equalities_);
  put_array(view.limits, view.limit, limits_);
  put_array(view.losses, view.loss, losses_);
  put_array(view.tendon_terms, view.tendon_term, tendon_terms_);
  put_array(view.groups, view.group, groups_);
  put_array(view.classes, view.row_class, classes_);
  view.column = columns_.data();
  view.column_side = sides_.data();
  return view;
}

template class ArticulatedModel<float>;
template class ArticulatedModel<double>;

}  // namespace stiction
