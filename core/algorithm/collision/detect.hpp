#pragma once

#include "core/algorithm/collision/collide.hpp"
#include "core/algorithm/plan/sort_network.hpp"
#include "core/algorithm/rigid/contact_point.hpp"
#include "core/team/phases.hpp"

/// What a step begins with: inverse inertias in world axes, what forces do to the twists, and the contacts.
namespace stiction::inline STICTION_ISA {

/// A shape where it is, and how far its surface may come within a step.
template <class Real>
struct MovingShape {
  PlacedShape<Real> placed;
  Real bound;   ///< of WorldShapeData
  Real travel;  ///< bound on the path of its points within a step [m]
};

/// Memory of one environment while its contacts are found.
template <class Real>
struct DetectWorkspace {
  MovingShape<Real>* shape;  ///< (shapes)
  Manifold<Real>* manifold;  ///< (pairs)
  Index* first;              ///< contacts of the pairs before each  (pairs)

  static_assert(alignof(MovingShape<Real>) == alignof(Manifold<Real>) && alignof(Manifold<Real>) >= alignof(Index));
  static STICTION_HD Offset bytes(const WorldModelView<Real>& model) {
    return Offset{model.shapes} * static_cast<Offset>(sizeof(MovingShape<Real>)) +
           Offset{model.pairs} * static_cast<Offset>(sizeof(Manifold<Real>) + sizeof(Index));
  }
  STICTION_HD DetectWorkspace(const WorldModelView<Real>& model, void* memory)
      : shape(static_cast<MovingShape<Real>*>(memory)),
        manifold(reinterpret_cast<Manifold<Real>*>(shape + model.shapes)),
        first(reinterpret_cast<Index*>(manifold + model.pairs)) {}
};

template <class Real>
STICTION_HD Twist<Real> twist_of(const Real* p) {
  return {load3<Real>(p), load3<Real>(p + 3)};
}

/// Twist a body would have after the step without contacts.
template <class Real>
STICTION_HD Twist<Real> free_twist(const WorldJob<Real>& job, Offset body) {
  const Twist<Real> now = twist_of(job.twist + 6 * body);
  const Twist<Real> change = twist_of(job.twist_change + 6 * body);
  return {added(now.linear, change.linear), added(now.angular, change.angular)};
}

/// Zero, or NaN if a number is not finite.
template <class Real>
STICTION_HD Real nothing_if_finite(const Real* values, Index count) {
  Real sum(0);
  for (Index k = 0; k < count; ++k) sum = sum + (values[k] - values[k]);
  return sum;
}

/// Writes inv_inertia and twist_change of one environment.
template <Team TeamT, class Real>
STICTION_HD void prepare_world(TeamT& team, const WorldJob<Real>& job, Offset env) {
  const WorldModelView<Real>& model = job.model;
  for_each(team, model.bodies, [&](Index body) {
    const Offset slot = env * model.bodies + body;
    const WorldBodyData<Real>& data = model.body[body];
    const Axes3<Real> axes = axes_of(load_quaternion(job.orientation + 4 * slot));
    const Vector3<Real> d = load3<Real>(data.inv_inertia);
    const Symmetric3<Real> inverse =
        data.isotropic ? Symmetric3<Real>{d.x, Real(0), Real(0), d.x, Real(0), d.x} : spread(axes, d);
    Real* const inertia = job.inv_inertia + 6 * slot;
    inertia[0] = inverse.xx;
    inertia[1] = inverse.xy;
    inertia[2] = inverse.xz;
    inertia[3] = inverse.yy;
    inertia[4] = inverse.yz;
    inertia[5] = inverse.zz;
    const Vector3<Real> force = load3<Real>(job.wrench + 6 * slot);
    const Vector3<Real> torque = load3<Real>(job.wrench + 6 * slot + 3);
    Vector3<Real> pull = scaled(model.step, add_scaled(load3<Real>(model.gravity), data.inv_mass, force));
    // A body that is nowhere touches nothing, so its environment would go on as if it were sound. The solver's own
    // check of its numbers is made to find it.
    pull.x = pull.x + nothing_if_finite(job.position + 3 * slot, 3);
    pull.y = pull.y + nothing_if_finite(job.orientation + 4 * slot, 4);
    const Vector3<Real> twist =
        scaled(model.step, add_product(Vector3<Real>{Real(0), Real(0), Real(0)}, inverse, torque));
    Real* const change = job.twist_change + 6 * slot;
    change[0] = canonical_zero(pull.x);
    change[1] = canonical_zero(pull.y);
    change[2] = canonical_zero(pull.z);
    change[3] = canonical_zero(twist.x);
    change[4] = canonical_zero(twist.y);
    change[5] = canonical_zero(twist.z);
  });
}

template <class Real>
STICTION_HD MovingShape<Real> pose_shape(const WorldJob<Real>& job, Offset env, Index shape) {
  const WorldShapeData<Real>& data = job.model.shape[shape];
  MovingShape<Real> moving{{data.kind,
                            load3<Real>(data.position),
                            {load3<Real>(data.axes), load3<Real>(data.axes + 3), load3<Real>(data.axes + 6)},
                            {data.size[0], data.size[1], data.size[2]}},
                           data.bound,
                           Real(0)};
  if (data.body < 0) return moving;
  const Offset body = env * job.model.bodies + data.body;
  const Axes3<Real> axes = axes_of(load_quaternion(job.orientation + 4 * body));
  PlacedShape<Real>& placed = moving.placed;
  placed.centre = added(load3<Real>(job.position + 3 * body), along(axes, placed.centre));
  placed.axes = {along(axes, placed.axes.x), along(axes, placed.axes.y), along(axes, placed.axes.z)};
  const Twist<Real> twist = free_twist(job, body);
  moving.travel = job.model.step * fma_(length(twist.angular), data.reach, length(twist.linear));
  return moving;
}

/// Whether two shapes are near enough to look closer.
template <class Real>
STICTION_HD bool bounds_overlap(const MovingShape<Real>& a, const MovingShape<Real>& b, Real margin) {
  const Vector3<Real> apart = subtract(b.placed.centre, a.placed.centre);
  const Real reach = (a.bound + b.bound) + margin;
  if (a.placed.kind == ShapeKind::plane) return dot(apart, a.placed.axes.z) <= reach;
  if (b.placed.kind == ShapeKind::plane) return -dot(apart, b.placed.axes.z) <= reach;
  return dot(apart, apart) <= reach * reach;
}

/// Keeps the contacts that lie within the model's margin or would come there within the step.
template <class Real>
STICTION_HD void cull_separating(const WorldJob<Real>& job, Offset env, const WorldPair<Real>& pair,
                                 Manifold<Real>& found) {
  const auto velocity = [&](Index body, const Vector3<Real>& point) {
    if (body < 0) return Vector3<Real>{Real(0), Real(0), Real(0)};
    const Offset slot = env * job.model.bodies + body;
    return point_velocity(free_twist(job, slot), subtract(point, load3<Real>(job.position + 3 * slot)));
  };
  Index count = 0;
  for (Index k = 0; k < found.count; ++k) {
    const ContactCandidate<Real> point = found.at[k];
    const Real approach =
        dot(point.normal, subtract(velocity(pair.body_a, point.point), velocity(pair.body_b, point.point)));
    if (fma_(job.model.step, max_(approach, Real(0)), point.depth + job.model.margin) >= Real(0))
      found.at[count++] = point;
  }
  found.count = count;
}

/// Fills the workspace; returns how many contacts there are.
template <Team TeamT, class Real>
STICTION_HD Index find_contacts(TeamT& team, const WorldJob<Real>& job, Offset env,
                                const DetectWorkspace<Real>& workspace) {
  const WorldModelView<Real>& model = job.model;
  for_each(team, model.shapes, [&](Index shape) { workspace.shape[shape] = pose_shape(job, env, shape); });
  for_each(team, model.pairs, [&](Index p) {
    const WorldPair<Real>& pair = model.pair[p];
    const MovingShape<Real>& a = workspace.shape[pair.shape_a];
    const MovingShape<Real>& b = workspace.shape[pair.shape_b];
    Manifold<Real>& found = workspace.manifold[p];
    found.count = 0;
    const Real margin = model.margin + (a.travel + b.travel);
    if (!bounds_overlap(a, b, margin)) return;
    found = collide(a.placed, b.placed, margin);
    cull_separating(job, env, pair, found);
  });
  return team.broadcast([&] {
    Index count = 0;
    for (Index p = 0; p < model.pairs; ++p) {
      workspace.first[p] = count;
      count += workspace.manifold[p].count;
    }
    return count;
  });
}

/// Writes them in order of pair and feature.
template <Team TeamT, class Real>
STICTION_HD void list_contacts(TeamT& team, const WorldJob<Real>& job, Offset env,
                               const DetectWorkspace<Real>& workspace, FoundContact<Real>* out) {
  const auto put_arm = [&](Real(&arm)[3], Index body, const Vector3<Real>& point) {
    const Vector3<Real> centre = body < 0 ? Vector3<Real>{Real(0), Real(0), Real(0)}
                                          : load3<Real>(job.position + 3 * (env * job.model.bodies + body));
    arm[0] = canonical_zero(point.x - centre.x);
    arm[1] = canonical_zero(point.y - centre.y);
    arm[2] = canonical_zero(point.z - centre.z);
  };
  for_each(team, job.model.pairs, [&](Index p) {
    for (Index k = 0; k < workspace.manifold[p].count; ++k) {
      const ContactCandidate<Real>& point = workspace.manifold[p].at[k];
      FoundContact<Real>& contact = out[workspace.first[p] + k];
      contact.pair = p;
      contact.feature = point.feature;
      put_arm(contact.arm_a, job.model.pair[p].body_a, point.point);
      put_arm(contact.arm_b, job.model.pair[p].body_b, point.point);
      contact.normal[0] = canonical_zero(point.normal.x);
      contact.normal[1] = canonical_zero(point.normal.y);
      contact.normal[2] = canonical_zero(point.normal.z);
      contact.depth = point.depth;
    }
  });
}

/// Moves one environment's found contacts into the batch, each with the impulse of its previous one.
template <Team TeamT, class Real>
STICTION_HD void emit_contacts(TeamT& team, const WorldModelView<Real>& model, const ContactSink<Real>& sink,
                               Offset env, const FoundContact<Real>* found) {
  const WorldContacts<Real>& now = sink.now;
  const WorldContacts<Real>& last = sink.last;
  const bool remembers = last.offsets != nullptr;
  const Offset begin = now.offsets[env];
  const Offset first = remembers ? last.offsets[env] : 0;
  const Index remembered = remembers ? static_cast<Index>(last.offsets[env + 1] - first) : 0;
  for_each(team, static_cast<Index>(now.offsets[env + 1] - begin), [&](Index k) {
    const Offset c = begin + k;
    const FoundContact<Real>& contact = found[k];
    const WorldPair<Real>& pair = model.pair[contact.pair];
    const std::uint64_t id =
        static_cast<std::uint64_t>(contact.pair) * kFeatures + static_cast<std::uint64_t>(contact.feature);
    // Ids ascend.
    const Offset previous = first + lower_bound(last.id + first, remembered, id,
                                                [](std::uint64_t one, std::uint64_t other) { return one < other; });
    const bool has_namesake = previous < first + remembered && last.id[previous] == id;
    now.body_a[c] = pair.body_a;
    now.body_b[c] = pair.body_b;
    for (Index j = 0; j < 3; ++j) {
      now.arm_a[3 * c + j] = contact.arm_a[j];
      now.arm_b[3 * c + j] = contact.arm_b[j];
      now.normal[3 * c + j] = contact.normal[j];
      now.guess[3 * c + j] = has_namesake ? sink.keep * last.impulse[3 * previous + j] : Real(0);
    }
    now.mu[c] = pair.mu;
    now.depth[c] = contact.depth;
    now.restitution[c] = pair.restitution;
    now.id[c] = id;
  });
}

}  // namespace stiction::inline STICTION_ISA
