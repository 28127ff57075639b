#pragma once

#include "core/algorithm/rigid/pack_sides.hpp"
#include "core/algorithm/rigid/sequential_impulses.hpp"

/// Body systems in the lanes of a pack: contact p of every lane is visited at once, whichever bodies it is between.
/// Each lane's numbers are those of a BodySystem with a stride, so one system can also be worked on alone. Each lane
/// performs such a system's operations in the same order, so its bits are the same. Host only.
namespace stiction::inline STICTION_ISA {

/// The systems of a pack. Besides each system's numbers, it keeps those that one system computes whenever it needs
/// them: tangents, and the twists without reactions. It keeps those of the batch's own numbers that a check of all
/// lanes wants.
template <class T, int W, Law kLawValue>
struct BodyPack : BodySystem<Pack<T, W>, kLawValue> {
  using Base = BodySystem<Pack<T, W>, kLawValue>;
  using Real = Pack<T, W>;
  using OneLane = BodySystem<T, kLawValue, W>;
  using Numbers = typename Base::Numbers;

  typename Base::Tiles tangents;  ///< t1, t2
  typename Base::Tiles masses;    ///< inverse mass and inertia of a, of b, where lanes have different bodies
  Numbers restitution;            ///< of each contact
  Numbers free;                   ///< twists after the sub-step without reactions        (bodies + 1 rows)
  Numbers sums;                   ///< impulses on the bodies, while twists are computed   (bodies + 1 rows)

  /// Numbers of T for each lane.
  static constexpr Offset elements(Offset contacts, Offset bodies, bool momentum) {
    return Base::elements(contacts, bodies, momentum) + (6 + 14 + 1) * contacts + 2 * Base::kTwistRow * (bodies + 1);
  }

  BodyPack(Index most_contacts, Index most_bodies, const SiParams& params, T* numbers)
      : Base(most_contacts, most_bodies, params, reinterpret_cast<Real*>(numbers), nullptr) {
    Real* more = reinterpret_cast<Real*>(numbers) + Base::elements(most_contacts, most_bodies, params.momentum);
    tangents = {more, 6};
    more += 6 * static_cast<Offset>(most_contacts);
    masses = {more, 14};
    more += 14 * static_cast<Offset>(most_contacts);
    restitution = {more};
    free = {more + most_contacts};
    sums = free.from(Base::kTwistRow * (static_cast<Offset>(most_bodies) + 1));
  }

  [[nodiscard]] STICTION_HD ContactFrame<Real> frame(Index p) const {
    return {this->vector(kFieldNormal, p),
            {tangents.at(0, p), tangents.at(1, p), tangents.at(2, p)},
            {tangents.at(3, p), tangents.at(4, p), tangents.at(5, p)}};
  }

  using Base::inverse_mass;
  using Base::set_twist;
  using Base::twist;
  [[nodiscard]] STICTION_HD Twist<Real> twist(const Numbers& twists, const LaneSlots<T, W>& at) const {
    if (at.is_uniform) return Base::twist(twists, static_cast<Index>(at.slot[0]));
    Real row[6];
    gather_row<Base::kTwistRow>(twists, at, row);
    return twist_at<Real>(row);
  }
  [[nodiscard]] STICTION_HD InverseMass<Real> inverse_mass(const LaneSlots<T, W>& at) const {
    if (at.is_uniform) return Base::inverse_mass(static_cast<Index>(at.slot[0]));
    const Real* const row = mass_of(at.side_index);
    return {row[0], load6<Real>(row + 1)};
  }
  /// Looks up the masses on a side that is not uniform, once for all sweeps.
  STICTION_HD void keep_masses(const LaneSlots<T, W>& at) const {
    Real row[Base::kMassRow];
    gather_row<Base::kMassRow>(this->mass, at, row);
    for (Index k = 0; k < Base::kMassRow; ++k) mass_of(at.side_index)[k] = row[k];
  }
  /// twists[slot] = twist where it is requested, and `old`, which is there, elsewhere.
  STICTION_HD void set_twist(const Numbers& twists, const LaneSlots<T, W>& at, PackMask<T, W> where,
                             const Twist<Real>& old, const Twist<Real>& value) const {
    const Twist<Real> kept = blend(where, value, old);
    if (at.is_uniform) {
      set_twist(twists, static_cast<Index>(at.slot[0]), kept);
    } else {
      const PackIndices<T, W> index = indices<Base::kTwistRow>(at);
      Real row[6];
      Real* const numbers = row;
      put_twist(numbers, kept);
      for (int k = 0; k < 6; ++k) scatter<T, W>(reinterpret_cast<T*>(twists.data + k), index, row[k]);
    }
  }
  STICTION_HD void move_side(const UniformSide<T, W>& side, PackMask<T, W> where, const Twist<Real>& old,
                             const Twist<Real>& value) const {
    set_twist(this->motion, side.slot, blend(where, value, old));
  }
  STICTION_HD void move_side(const LaneSides<T, W>& side, PackMask<T, W> where, const Twist<Real>& old,
                             const Twist<Real>& value) const {
    set_twist(this->motion, slot_of(side), where, old, value);
  }

 private:
  static STICTION_HD Twist<Real> blend(PackMask<T, W> where, const Twist<Real>& a, const Twist<Real>& b) {
    const auto parts = [where](const Vector3<Real>& u, const Vector3<Real>& v) {
      return Vector3<Real>{select(where, u.x, v.x), select(where, u.y, v.y), select(where, u.z, v.z)};
    };
    return {parts(a.linear, b.linear), parts(a.angular, b.angular)};
  }
  [[nodiscard]] STICTION_HD Real* mass_of(Offset side_index) const {
    return &masses.at(static_cast<Index>(side_index % 2) * Base::kMassRow, static_cast<Index>(side_index / 2));
  }
  /// Places of the first number of each lane's row.
  template <Index kRow>
  static STICTION_HD PackIndices<T, W> indices(const LaneSlots<T, W>& at) {
    PackIndices<T, W> lane;
    for (int l = 0; l < W; ++l) lane[l] = l;
    return at.slot * (kRow * W) + lane;
  }
  template <Index kRow, int kCount>
  static STICTION_HD void gather_row(const Numbers& numbers, const LaneSlots<T, W>& at, Real (&row)[kCount]) {
    const PackIndices<T, W> index = indices<kRow>(at);
    for (int k = 0; k < kCount; ++k) row[k] = gather<T, W>(reinterpret_cast<const T*>(numbers.data + k), index);
  }
};

/// start_momentum() in the lanes of `due`.
template <class T, int W, Law kLaw>
STICTION_HD void start_momentum_in(const BodyPack<T, W, kLaw>& s, PackMask<T, W> due) {
  for (Index p = 0; p < s.contacts; ++p)
    for (Index k = 0; k < 3; ++k) s.before.at(k, p) = select(due, s.x.at(k, p), s.before.at(k, p));
  for (Index body = 0; body < s.bodies; ++body)
    for (Index k = 0; k < 6; ++k) {
      Pack<T, W>& before = s.twist_row(s.motion_before, body)[k];
      before = select(due, s.twist_row(s.motion, body)[k], before);
    }
}

/// Sets an earlier environment's contacts and bodies in a lane to rest. These are `contacts` and the numbers behind
/// `bodies` and the world, as far as there is room. These contacts and bodies stay at rest and are visited with those
/// of other lanes. A single NaN would spread to others.
template <class T, int W, Law kLaw>
STICTION_HD void rest_from(const BodyPack<T, W, kLaw>& pack, Index contacts, Index bodies, Index most_contacts,
                           Index most_bodies, int lane) {
  for (Index p = contacts; p < most_contacts; ++p) {
    for (Index k = 0; k < kContactFields<kLaw>; ++k) pack.field.at(k, p).v[lane] = T(0);
    for (Index k = 0; k < 3; ++k) {
      pack.x.at(k, p).v[lane] = T(0);
      if (pack.has_momentum()) pack.before.at(k, p).v[lane] = T(0);
    }
  }
  for (Index body = bodies + 1; body <= most_bodies; ++body) {
    for (Index k = 0; k < BodyPack<T, W, kLaw>::kMassRow; ++k) pack.mass_row(body)[k].v[lane] = T(0);
    for (const auto& twists : {pack.start, pack.motion, pack.motion_before, pack.free})
      for (Index k = 0; k < 6 && twists.data != nullptr; ++k) pack.twist_row(twists, body)[k].v[lane] = T(0);
  }
}

/// The numbers of an environment that enters a lane, as the batch has them.
template <class T, int W, Law kLaw>
STICTION_HD void take_lane(const BodyPack<T, W, kLaw>& pack, const BodyEnv<T>& env, const BodySystem<T, kLaw, W>& s,
                           bool warm, int lane) {
  SerialTeam team;
  load_masses(team, env, s);
  for (Index p = 0; p < s.contacts; ++p) {
    take_contact(env, s, p, warm);
    pack.restitution[p].v[lane] = env.restitution[env.contact_order[p]];
  }
}

/// The free twists of a lane's environment, which has entered or begins another sub-step.
template <class T, int W, Law kLaw>
STICTION_HD void load_lane_free(const BodyPack<T, W, kLaw>& pack, const BodyEnv<T>& env,
                                const BodySystem<T, kLaw, W>& s, const SiParams& params, int lane) {
  for (Index body = 0; body <= s.bodies; ++body) {
    double twist[6];
    double* const numbers = twist;
    put_twist(numbers, free_twist(env, s, params, body));
    const auto row = pack.twist_row(pack.free, body);
    for (Index k = 0; k < 6; ++k) row[k].v[lane] = static_cast<T>(twist[k]);
  }
}

}  // namespace stiction::inline STICTION_ISA
