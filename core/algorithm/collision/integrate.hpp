#pragma once

#include "core/algorithm/collision/detect.hpp"

/// The second half of a step, and quantities of a state (docs/howto/stepping.md).
namespace stiction::inline STICTION_ISA {

template <class Real>
STICTION_HD void store3(Real* p, const Vector3<Real>& a) {
  p[0] = canonical_zero(a.x);
  p[1] = canonical_zero(a.y);
  p[2] = canonical_zero(a.z);
}

/// Carries positions and orientations on with the twists that were solved for. A body that is not alike about its axes
/// keeps its angular momentum instead of its spin, which is the gyroscopic term. It turns with the spin it has half
/// way, and ends with the spin its momentum is in the axes it ends with.
template <Team TeamT, class Real>
STICTION_HD void integrate_world(TeamT& team, const WorldJob<Real>& job, Offset env) {
  const WorldModelView<Real>& model = job.model;
  const EnvCode code = job.status[env].code;
  if (code == EnvCode::invalid_input || code == EnvCode::unsupported) return;
  for_each(team, model.bodies, [&](Index body) {
    const Offset slot = env * model.bodies + body;
    const WorldBodyData<Real>& data = model.body[body];
    const Twist<Real> solved = twist_of(job.solved_twist + 6 * slot);
    store3(job.position + 3 * slot, add_scaled(load3<Real>(job.position + 3 * slot), model.step, solved.linear));
    const Quaternion<Real> before = load_quaternion(job.orientation + 4 * slot);
    Vector3<Real> spin = solved.angular;
    Quaternion<Real> after;
    if (data.isotropic) {
      after = turned(before, spin, model.step);
    } else {
      const Vector3<Real> inverse = load3<Real>(data.inv_inertia);
      const Vector3<Real> momentum = stretched(axes_of(before), load3<Real>(data.inertia), spin);
      const Quaternion<Real> half_way = turned(before, spin, model.step * Real(0.5));
      after = turned(before, stretched(axes_of(half_way), inverse, momentum), model.step);
      spin = stretched(axes_of(after), inverse, momentum);
    }
    Real* const orientation = job.orientation + 4 * slot;
    orientation[0] = canonical_zero(after.w);
    orientation[1] = canonical_zero(after.x);
    orientation[2] = canonical_zero(after.y);
    orientation[3] = canonical_zero(after.z);
    store3(job.twist + 6 * slot, solved.linear);
    store3(job.twist + 6 * slot + 3, spin);
  });
}

/// Energy and momentum of one environment, bodies added in their order.
template <class Real>
STICTION_HD WorldMotion motion_of(const WorldJob<Real>& job, Offset env) {
  WorldMotion sum{};
  const Vector3<double> gravity = load3<double>(job.model.gravity);
  Vector3<double> momentum{0.0, 0.0, 0.0};
  Vector3<double> angular{0.0, 0.0, 0.0};
  for (Index body = 0; body < job.model.bodies; ++body) {
    const Offset slot = env * job.model.bodies + body;
    const WorldBodyData<Real>& data = job.model.body[body];
    const Vector3<double> position = load3<double>(job.position + 3 * slot);
    const Vector3<double> velocity = load3<double>(job.twist + 6 * slot);
    const Vector3<double> spin = load3<double>(job.twist + 6 * slot + 3);
    const Real* q = job.orientation + 4 * slot;
    const Axes3<double> axes = axes_of(Quaternion<double>{static_cast<double>(q[0]), static_cast<double>(q[1]),
                                                          static_cast<double>(q[2]), static_cast<double>(q[3])});
    const Vector3<double> own = stretched(axes, load3<double>(data.inertia), spin);
    const Vector3<double> push = scaled(data.mass, velocity);
    sum.kinetic += 0.5 * (dot(push, velocity) + dot(own, spin));
    sum.potential -= data.mass * dot(gravity, position);
    momentum = added(momentum, push);
    angular = add_cross(added(angular, own), position, push);
  }
  store3(sum.momentum, momentum);
  store3(sum.angular_momentum, angular);
  return sum;
}

}  // namespace stiction::inline STICTION_ISA
