#pragma once

#include "core/algorithm/articulated/lane_contacts.hpp"

/// Observations of an evaluation beside the state, in MuJoCo's layouts (MuJoCo documentation, mj_rnePostConstraint).
/// They are places, inertias and velocities of bodies, and the forces of contacts on them.
namespace stiction::inline STICTION_ISA {

/// Adds the reactions of contacts up as forces on bodies.
template <class Types>
struct ContactForces {
  using Wide = typename Types::Wide;
  const RobotsOf<Types>& robots;
  const SlotOf<Types>* slots;
  const Index* groups_of;  ///< of each class

  [[nodiscard]] STICTION_HD Wide reaction(Index slot, Index row) const {
    return robots.work.reaction[slots[slot].row + row];
  }

  /// A contact's force and moment on its second body, in the directions of its frame: three of each.
  STICTION_HD void decode(Index s, const RowClass& rows, const LaneContacts<Wide>& contact,
                          Wide (&along)[kMaxConeRows]) const {
    for (Wide& number : along) number = Wide(0);
    if (rows.dim == 1 || rows.rows > 1) {
      for (Index k = 0; k < rows.dim; ++k) along[k] = reaction(s, k);
    } else {
      for (Index k = 1; k < rows.dim; ++k) {
        const Wide up = reaction(s + 2 * k - 2, 0), down = reaction(s + 2 * k - 1, 0);
        along[0] = along[0] + (up + down);
        along[k] = contact.friction[k - 1] * (up - down);
      }
    }
    for (Wide& number : along) number = select(contact.has, number, Wide(0));
  }

  /// A vector with such components, of which a contact of `dim` directions has the first `count`.
  static STICTION_HD Vector3<Wide> compose(const Axes3<Wide>& frame, const Wide* components, Index count) {
    const Vector3<Wide> first = scaled(components[0], frame.x);
    return count == 1 ? first : add_scaled(add_scaled(first, components[1], frame.y), components[2], frame.z);
  }

  /// Adds a force at a point to a body, in some lanes. The world has none.
  STICTION_HD void add_force(Index body, Mask<Wide> where, const Vector3<Wide>& point, const Twist<Wide>& force) const {
    if (body == 0) return;
    const Vector3<Wide> arm = subtract(point, robots.work.tree_centre[robots.model.body[body].root]);
    const Vector3<Wide> moment = add_cross(force.angular, arm, force.linear);
    const auto masked = [&](const Vector3<Wide>& a) {
      return Vector3<Wide>{select(where, a.x, Wide(0)), select(where, a.y, Wide(0)), select(where, a.z, Wide(0))};
    };
    const auto& sum = robots.work.contact_force;
    sum.put(body, added(sum[body], Twist<Wide>{masked(force.linear), masked(moment)}));
  }

  STICTION_HD void add_contact(Index s, const RowClass& rows, Index rank) const {
    const auto& model = robots.model;
    const LaneContacts<Wide> contact = find_contacts(robots, rows, rank);
    const Axes3<Wide> frame = frame_of(contact, rows.dim);
    Wide along[kMaxConeRows];
    decode(s, rows, contact, along);
    Twist<Wide> force{compose(frame, along, rows.dim == 1 ? 1 : 3), no_vector<Wide>()};
    if (rows.dim > 3) force.angular = compose(frame, along + 3, rows.dim == 4 ? 1 : 3);
    const Twist<Wide> opposite{scaled(Wide(-1), force.linear), scaled(Wide(-1), force.angular)};
    for_each_of_rank(robots, rows, rank, [&](const RowGroup& group, Mask<Wide> where) {
      const auto& pair = model.pair[group.pair];
      add_force(model.geom[pair.geom_a].body, where, contact.point, opposite);
      add_force(model.geom[pair.geom_b].body, where, contact.point, force);
    });
  }

  /// Forces of all contacts. `has_rows`: some lane has a row.
  STICTION_HD_OUTLINE void add_all(bool has_rows) const {
    const auto& model = robots.model;
    for (Index b = 0; b < model.bodies; ++b) robots.work.contact_force.put(b, no_motion<Wide>());
    Index s = 0;
    for (Index c = 0; c < model.classes && has_rows; ++c) {
      const RowClass& rows = model.row_class[c];
      for (Index rank = 0; rank < groups_of[c]; ++rank, s += rows.cones)
        if (rows.source == RowSource::contact) add_contact(s, rows, rank);
    }
  }
};

/// Writes observations as the batch's arrays have them.
template <class Real, int kStride>
struct BodyObserver {
  using Reals = RobotNumbers<Real, kStride>;
  const Robots<Real, kStride>& robots;

  [[nodiscard]] STICTION_HD Reals array(ObservedArray which) const {
    return robots.work.observed[static_cast<std::size_t>(which)];
  }
  static STICTION_HD void put(const Vector3<Real>& from, const Reals& to) {
    to[0] = from.x;
    to[1] = from.y;
    to[2] = from.z;
  }
  static STICTION_HD void put(const Twist<Real>& from, const Reals& to) {
    put(from.angular, to);
    put(from.linear, to.from(3));
  }
  static STICTION_HD void put(const SpatialInertia<Real>& from, Real mass, const Reals& to) {
    put(Vector3<Real>{from.about.xx, from.about.yy, from.about.zz}, to);
    put(Vector3<Real>{from.about.xy, from.about.xz, from.about.yz}, to.from(3));
    put(from.moment, to.from(6));
    to[9] = mass;
  }

  STICTION_HD void write_bodies() const {
    const auto& work = robots.work;
    for (const ObservedArray which : {ObservedArray::xpos, ObservedArray::xipos}) put(no_vector<Real>(), array(which));
    for (const ObservedArray which : {ObservedArray::cvel, ObservedArray::cfrc_ext})
      put(no_motion<Real>(), array(which));
    for (Index k = 0; k < 10; ++k) array(ObservedArray::cinert)[k] = Real(0);
    for (Index b = 1; b < robots.model.bodies; ++b) {
      put(work.position[b], array(ObservedArray::xpos).from(3 * b));
      put(work.centre[b], array(ObservedArray::xipos).from(3 * b));
      put(work.inertia[b], mass_of(robots, b), array(ObservedArray::cinert).from(10 * b));
      put(work.velocity[b], array(ObservedArray::cvel).from(6 * b));
      put(work.contact_force[b], array(ObservedArray::cfrc_ext).from(6 * b));
    }
  }
  STICTION_HD void write_tendons() const {
    const auto& model = robots.model;
    const auto length = array(ObservedArray::ten_length), rate = array(ObservedArray::ten_velocity);
    for (Index t = 0; t < model.observed_width[static_cast<std::size_t>(ObservedArray::ten_length)]; ++t)
      length[t] = rate[t] = Real(0);
    for (Index i = 0; i < model.tendon_terms; ++i) {
      const auto& term = model.tendon_term[i];
      const Real coefficient(term.coefficient);
      length[term.tendon] = fma_(coefficient, robots.work.qpos[term.q], length[term.tendon]);
      rate[term.tendon] = fma_(coefficient, robots.work.qvel[term.dof], rate[term.tendon]);
    }
  }
  STICTION_HD_OUTLINE void write() const {
    write_bodies();
    write_tendons();
    const auto actuator = array(ObservedArray::qfrc_actuator);
    for (Index k = 0; k < robots.model.dof_count; ++k) actuator[k] = robots.work.actuator[k];
  }
};

}  // namespace stiction::inline STICTION_ISA
