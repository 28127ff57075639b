#pragma once

#include "core/algorithm/collision/collide.hpp"
#include "core/algorithm/collision/near_pairs.hpp"

/// Prepares a step: inverse inertias in world axes, changes of the twists by forces, and the contacts.
namespace stiction::inline STICTION_ISA {

/// Manifolds of the pairs of one environment.
template <class Real>
struct FoundManifolds {
  Manifold<Real>* manifold;  ///< (pairs)
  Index* first;              ///< contacts of the pairs before each  (pairs)

  static_assert(alignof(Manifold<Real>) >= alignof(Index));
  static STICTION_HD Offset bytes(Offset pairs) {
    return pairs * static_cast<Offset>(sizeof(Manifold<Real>) + sizeof(Index));
  }
  STICTION_HD FoundManifolds(Offset pairs, void* memory)
      : manifold(static_cast<Manifold<Real>*>(memory)), first(reinterpret_cast<Index*>(manifold + pairs)) {}
};

/// All pairs of a small environment, with memory for their contacts.
template <class Real>
struct ListedPairs {
  MovingShape<Real>* shape;  ///< (shapes)
  FoundManifolds<Real> found;
  const WorldPair<Real>* pair;  ///< (count)
  Index count;

  static_assert(alignof(MovingShape<Real>) == alignof(Manifold<Real>));
  static STICTION_HD Offset bytes(const WorldModelView<Real>& model) {
    return Offset{model.shapes} * static_cast<Offset>(sizeof(MovingShape<Real>)) +
           FoundManifolds<Real>::bytes(model.pairs);
  }
  STICTION_HD ListedPairs(const WorldModelView<Real>& model, void* memory)
      : shape(static_cast<MovingShape<Real>*>(memory)),
        found(model.pairs, shape + model.shapes),
        pair(model.pair),
        count(model.pairs) {}
  [[nodiscard]] STICTION_HD const ShapePair& shapes_of(Index p) const { return pair[p].shapes; }
  [[nodiscard]] STICTION_HD Offset number_of(Index p) const { return p; }
};

/// Near pairs of a large one.
template <class Real>
struct NearPairs {
  MovingShape<Real>* shape;  ///< (shapes)
  NearPair* pair;            ///< (count)
  FoundManifolds<Real> found;
  const WorldModelView<Real>* model;
  Index count;

  static STICTION_HD Offset bytes(Offset pairs) {
    return pairs * static_cast<Offset>(sizeof(NearPair)) + FoundManifolds<Real>::bytes(pairs);
  }
  STICTION_HD NearPairs(const WorldModelView<Real>& world, const NearWorkspace<Real>& workspace, Index pairs,
                        void* memory)
      : shape(workspace.tree.shape),
        pair(static_cast<NearPair*>(memory)),
        found(pairs, pair + pairs),
        model(&world),
        count(pairs) {}
  [[nodiscard]] STICTION_HD ShapePair shapes_of(Index p) const {
    return shape_pair(*model, pair[p].shape_a, pair[p].shape_b);
  }
  [[nodiscard]] STICTION_HD Offset number_of(Index p) const { return pair[p].number; }
};

/// Zero, or NaN if a number is not finite.
template <class Real>
STICTION_HD Real nothing_if_finite(const Real* values, Index count) {
  Real sum(0);
  for (Index k = 0; k < count; ++k) sum = sum + (values[k] - values[k]);
  return sum;
}

/// Zero, or NaN for a quaternion without a length: spins whose squares overflow leave one behind.
template <class Real>
STICTION_HD Real nothing_if_turned(const Quaternion<Real>& q) {
  const Real inverse = div_(Real(1), (q.w * q.w + q.x * q.x) + (q.y * q.y + q.z * q.z));
  return inverse - inverse;
}

/// Writes inv_inertia and twist_change of one environment.
template <Team TeamT, class Real>
STICTION_HD void prepare_world(TeamT& team, const WorldJob<Real>& job, Offset env) {
  const WorldModelView<Real>& model = job.model;
  for_each(team, model.bodies, [&](Index body) {
    const Offset slot = env * model.bodies + body;
    const WorldBodyData<Real>& data = model.body[body];
    const Quaternion<Real> orientation = load_quaternion(job.orientation + 4 * slot);
    const Axes3<Real> axes = axes_of(orientation);
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
    // A body that is nowhere, or turned no way, touches nothing, so its environment would go on as if it were sound.
    // The solver's own check of its numbers is made to find it.
    pull.x = pull.x + nothing_if_finite(job.position + 3 * slot, 3);
    pull.y = pull.y + nothing_if_finite(job.orientation + 4 * slot, 4);
    pull.y = pull.y + nothing_if_turned(orientation);
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

/// Keeps the contacts that lie within the model's margin or would come there within the step.
template <class Real>
STICTION_HD void cull_separating(const WorldJob<Real>& job, Offset env, const ShapePair& pair, Manifold<Real>& found) {
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

/// Finds the manifolds of pairs whose shapes are where they are; returns how many contacts there are.
template <Team TeamT, class Real, class Pairs>
STICTION_HD Index collide_pairs(TeamT& team, const WorldJob<Real>& job, Offset env, const Pairs& pairs) {
  for_each(team, pairs.count, [&](Index p) {
    const ShapePair pair = pairs.shapes_of(p);
    const MovingShape<Real>& a = pairs.shape[pair.shape_a];
    const MovingShape<Real>& b = pairs.shape[pair.shape_b];
    Manifold<Real>& found = pairs.found.manifold[p];
    found.count = 0;
    const Real margin = pair_margin(job.model, a, b);
    if (!bounds_overlap(a, b, margin)) return;
    found = collide(a.placed, b.placed, margin);
    cull_separating(job, env, pair, found);
  });
  return team.broadcast([&] {
    Index count = 0;
    for (Index p = 0; p < pairs.count; ++p) {
      pairs.found.first[p] = count;
      count += pairs.found.manifold[p].count;
    }
    return count;
  });
}

/// Finds the manifolds of all pairs; returns how many contacts there are.
template <Team TeamT, class Real>
STICTION_HD Index find_contacts(TeamT& team, const WorldJob<Real>& job, Offset env, const ListedPairs<Real>& pairs) {
  pose_shapes(team, job, env, pairs.shape);
  return collide_pairs(team, job, env, pairs);
}

/// Finds those of that many near pairs, which were counted and get memory in `pairs`.
template <Team TeamT, class Real>
STICTION_HD Index find_near_contacts(TeamT& team, const WorldJob<Real>& job, Offset env, NearWorkspace<Real>& workspace,
                                     Index count, void* pairs) {
  workspace.tree.measure(job.model.shapes);
  const NearPairs<Real> near(job.model, workspace, count, pairs);
  list_near_pairs(team, job.model, workspace, near.pair);
  return collide_pairs(team, job, env, near);
}

/// Writes contacts in order of pair and feature.
template <Team TeamT, class Real, class Pairs>
STICTION_HD void list_contacts(TeamT& team, const WorldJob<Real>& job, Offset env, const Pairs& pairs,
                               FoundContact<Real>* out) {
  const auto put_arm = [&](Real(&arm)[3], Index body, const Vector3<Real>& point) {
    const Vector3<Real> centre = body < 0 ? Vector3<Real>{Real(0), Real(0), Real(0)}
                                          : load3<Real>(job.position + 3 * (env * job.model.bodies + body));
    arm[0] = canonical_zero(point.x - centre.x);
    arm[1] = canonical_zero(point.y - centre.y);
    arm[2] = canonical_zero(point.z - centre.z);
  };
  for_each(team, pairs.count, [&](Index p) {
    const Manifold<Real>& manifold = pairs.found.manifold[p];
    const ShapePair pair = pairs.shapes_of(p);
    for (Index k = 0; k < manifold.count; ++k) {
      const ContactCandidate<Real>& point = manifold.at[k];
      FoundContact<Real>& contact = out[pairs.found.first[p] + k];
      contact.pair = pairs.number_of(p);
      contact.feature = point.feature;
      put_arm(contact.arm_a, pair.body_a, point.point);
      put_arm(contact.arm_b, pair.body_b, point.point);
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
    const WorldPair<Real> pair = world_pair(model, contact.pair);
    const std::uint64_t id =
        static_cast<std::uint64_t>(contact.pair) * kFeatures + static_cast<std::uint64_t>(contact.feature);
    // Ids ascend.
    const Offset previous = first + lower_bound(last.id + first, remembered, id,
                                                [](std::uint64_t one, std::uint64_t other) { return one < other; });
    const bool has_namesake = previous < first + remembered && last.id[previous] == id;
    now.body_a[c] = pair.shapes.body_a;
    now.body_b[c] = pair.shapes.body_b;
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
