#pragma once

#include "core/algorithm/articulated/lane_contacts.hpp"

/// Rows of equalities, dry friction, limits and contacts: J, the acceleration they aim at, and their compliance (MuJoCo
/// documentation, "Computation", constraint model).
namespace stiction::inline STICTION_ISA {

/// Compliance of a row, and stiffness times its impedance and depth.
template <class Real>
struct RowResponse {
  Real compliance, push;
};

/// x to a small power.
template <class Real>
STICTION_HD Real power_of(Real x, Index power) {
  Real product = x;
  for (Index k = 1; k < power; ++k) product = product * x;
  return product;
}

template <class Real>
STICTION_HD RowResponse<Real> respond(const RowGive<Real>& give, Real depth) {
  const Real one(1);
  const Real x = min_(abs_(depth) * give.inverse_width, one);
  const Real first = power_of(x, give.power) * give.up;
  const Real second = one - power_of(one - x, give.power) * give.down;
  const Real impedance = fma_(select(x <= give.middle, first, second), give.rise, give.low);
  const Real compliance = div_(one - impedance, impedance) * give.weight;
  return {max_(compliance, Real(static_cast<Scalar<Real>>(1e-15))), (give.stiffness * impedance) * depth};
}

/// Writes the numbers of a pack's rows to where Newton's method in velocities has them.
template <class Types>
struct RowWriter {
  using Wide = typename Types::Wide;
  using T = Scalar<Wide>;
  const RobotsOf<Types>& robots;
  const VelocityWorkspace<Types>& to;
  const SlotOf<Types>* slots;
  const Index* groups_of;

  STICTION_HD void put_row(Index row, Mask<Wide> has, Wide target, Wide compliance, Wide mu) const {
    to.target.put(row, select(has, target, Wide(0)));
    to.R.put(row, select(has, compliance, Wide(1)));
    to.mu.put(row, select(has, mu, Wide(1)));
    for (const auto* array : {&to.shift, &to.prox, &to.prox_center}) array->put(row, Wide(0));
  }
  STICTION_HD void put_bounds(Index slot, Mask<Wide> has, Wide low, Wide high) const {
    to.law.put(3 * slot + 1, select(has, low, Wide(0)));
    to.law.put(3 * slot + 2, select(has, high, Wide(0)));
  }
  static STICTION_HD Wide unbounded() { return Wide(static_cast<T>(__builtin_huge_val())); }

  STICTION_HD void write_equality(Index s, const RowClass& rows, const ArticulatedEqualityData<T>& equality) const {
    const auto& work = robots.work;
    const auto has = Wide(0) == Wide(0);
    Wide value(equality.polynomial[0]), slope(0);
    if (equality.dof_b >= 0) {
      const Wide x = work.qpos[equality.q_b] - Wide(equality.reference_b);
      Wide sum(equality.polynomial[4]);
      slope = Wide(0);
      for (Index k = 3; k >= 0; --k) {
        slope = fma_(slope, x, sum);
        sum = fma_(sum, x, Wide(equality.polynomial[k]));
      }
      value = sum;
    }
    const Wide depth = (work.qpos[equality.q_a] - Wide(equality.reference_a)) - value;
    Wide velocity(0);
    for (Index c = 0; c < rows.column_count; ++c) {
      const Index dof = robots.model.column[rows.columns + c];
      const Wide entry = dof == equality.dof_a ? Wide(1) : -slope;
      to.J.put(slots[s].entry + c, entry);
      velocity = fma_(entry, work.qvel[dof], velocity);
    }
    const RowResponse<Wide> response = respond(in_lanes<Wide>(equality.give), depth);
    const Wide target = fma_(Wide(-equality.give.damping), velocity, -response.push);
    put_row(slots[s].row, has, target, response.compliance, Wide(1));
    put_bounds(s, has, -unbounded(), unbounded());
  }

  STICTION_HD void write_loss(Index s, Index index) const {
    const ArticulatedLossData<T>& loss = robots.model.loss[index];
    const Wide most = friction_loss_of(robots, index);
    const auto has = most > Wide(0);
    const RowResponse<Wide> response = respond(in_lanes<Wide>(loss.give), Wide(0));
    to.J.put(slots[s].entry, select(has, Wide(1), Wide(0)));
    const Wide target = Wide(-loss.give.damping) * robots.work.qvel[loss.dof];
    put_row(slots[s].row, has, target, response.compliance, Wide(1));
    put_bounds(s, has, -most, most);
  }

  /// Writes a joint's lower limit in some lanes and its upper one in others.
  STICTION_HD void write_limit(Index s, const RowClass& rows, Index rank) const {
    auto has = Wide(0) > Wide(0);
    Wide sign(0), depth(0);
    for_each_of_rank(robots, rows, rank, [&](const RowGroup& group, Mask<Wide> where) {
      const ArticulatedLimitData<T>& limit = robots.model.limit[group.index];
      const Wide own = (robots.work.qpos[limit.q] - Wide(limit.bound)) * Wide(limit.sign) - Wide(limit.margin);
      has = or_(has, where);
      sign = select(where, Wide(limit.sign), sign);
      depth = select(where, own, depth);
    });
    const ArticulatedLimitData<T>& limit = robots.model.limit[robots.model.group[rows.begin].index];
    const RowResponse<Wide> response = respond(in_lanes<Wide>(limit.give), depth);
    to.J.put(slots[s].entry, sign);
    const Wide velocity = sign * robots.work.qvel[limit.dof];
    const Wide target = fma_(Wide(-limit.give.damping), velocity, -response.push);
    put_row(slots[s].row, has, target, response.compliance, Wide(1));
    put_bounds(s, has, Wide(0), unbounded());
  }

  /// Entries of a degree of freedom in the directions of a contact.
  STICTION_HD void find_entries(const Axes3<Wide>& frame, const Vector3<Wide>& point, Index dof, T side, Index dim,
                                Wide (&entry)[kMaxConeRows]) const {
    const auto& model = robots.model;
    const Twist<Wide>& motion = robots.work.motion[dof];
    const Vector3<Wide>& centre = robots.work.tree_centre[model.body[model.dof[dof].body].root];
    const DofKind kind = model.dof[dof].kind;
    const bool is_linear = kind != DofKind::hinge && kind != DofKind::spin;
    const Vector3<Wide> linear =
        is_linear ? motion.linear : add_cross(motion.linear, motion.angular, subtract(point, centre));
    const Vector3<Wide> directed = side < 0 ? scaled(Wide(-1), linear) : linear;
    entry[0] = dot(frame.x, directed);
    if (dim == 1) return;
    entry[1] = dot(frame.y, directed);
    entry[2] = dot(frame.z, directed);
    if (dim == 3) return;
    const Vector3<Wide> angular = scaled(Wide(side), motion.angular);
    entry[3] = dot(frame.x, angular);
    if (dim == 4) return;
    entry[4] = dot(frame.y, angular);
    entry[5] = dot(frame.z, angular);
  }

  STICTION_HD void write_contact(Index s, const RowClass& rows, Index rank) const {
    const auto& model = robots.model;
    const LaneContacts<Wide> contact = find_contacts(robots, rows, rank);
    const Axes3<Wide> frame = frame_of(contact, rows.dim);
    const bool is_pyramid = rows.dim > 1 && rows.rows == 1;
    Wide velocity[kMaxConeRows];
    for (Index k = 0; k < rows.dim; ++k) velocity[k] = Wide(0);
    const Index columns = rows.column_count;
    for (Index c = 0; c < columns; ++c) {
      const Index dof = model.column[rows.columns + c];
      Wide entry[kMaxConeRows];
      find_entries(frame, contact.point, dof, static_cast<T>(model.column_side[rows.columns + c]), rows.dim, entry);
      for (Index k = 0; k < rows.dim; ++k) {
        entry[k] = select(contact.has, entry[k], Wide(0));
        velocity[k] = fma_(entry[k], robots.work.qvel[dof], velocity[k]);
      }
      const auto column = to.J.from(slots[s].entry + c);
      if (!is_pyramid) {
        for (Index k = 0; k < rows.dim; ++k) column.put(static_cast<Offset>(k) * columns, entry[k]);
      } else {
        for (Index k = 1; k < rows.dim; ++k) {
          const Wide mu = contact.friction[k - 1];
          column.put(static_cast<Offset>(2 * k - 2) * columns, fma_(mu, entry[k], entry[0]));
          column.put(static_cast<Offset>(2 * k - 1) * columns, fma_(-mu, entry[k], entry[0]));
        }
      }
    }
    write_targets(s, rows, contact, velocity);
  }

  STICTION_HD void write_targets(Index s, const RowClass& rows, const LaneContacts<Wide>& contact,
                                 const Wide (&velocity)[kMaxConeRows]) const {
    const RowResponse<Wide> response = respond(contact.give, contact.depth);
    const Wide damping = -contact.give.damping;
    if (rows.dim == 1 || rows.rows > 1) {
      const Index row = slots[s].row;
      put_row(row, contact.has, fma_(damping, velocity[0], -response.push), response.compliance, Wide(1));
      if (rows.dim == 1) put_bounds(s, contact.has, Wide(0), unbounded());
      for (Index k = 1; k < rows.dim; ++k)
        put_row(row + k, contact.has, -(contact.give.tangential_damping * velocity[k]),
                response.compliance * contact.ratio[k], contact.friction[k - 1]);
      return;
    }
    const Wide compliance = response.compliance * contact.ratio[1];
    for (Index k = 1; k < rows.dim; ++k)
      for (Index edge = 0; edge < 2; ++edge) {
        const Wide mu = edge == 0 ? contact.friction[k - 1] : -contact.friction[k - 1];
        const Wide along = fma_(mu, velocity[k], velocity[0]);
        const Index slot = s + 2 * k - 2 + edge;
        put_row(slots[slot].row, contact.has, fma_(damping, along, -response.push), compliance, Wide(1));
        put_bounds(slot, contact.has, Wide(0), unbounded());
      }
  }

  STICTION_HD_OUTLINE void write() const {
    const auto& model = robots.model;
    Index s = 0;
    for (Index c = 0; c < model.classes; ++c) {
      const RowClass& rows = model.row_class[c];
      for (Index rank = 0; rank < groups_of[c]; ++rank, s += rows.cones) {
        if (rows.source == RowSource::equality) write_equality(s, rows, model.equality[model.group[rows.begin].index]);
        if (rows.source == RowSource::loss) write_loss(s, model.group[rows.begin].index);
        if (rows.source == RowSource::limit) write_limit(s, rows, rank);
        if (rows.source == RowSource::contact) write_contact(s, rows, rank);
      }
    }
  }
};

}  // namespace stiction::inline STICTION_ISA
