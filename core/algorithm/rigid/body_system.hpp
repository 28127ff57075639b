#pragma once

#include "core/algorithm/rigid/body_env.hpp"
#include "core/team/phases.hpp"

namespace stiction::inline STICTION_ISA {

/// Contacts whose numbers of one field lie side by side: a cache line of single precision, half a warp.
inline constexpr Index kTileContacts = 16;

/// Layout of an array that several systems share, number by number: each seen separately, with a stride, or all of
/// them at once, as packs.
template <class Real, int kStride>
inline constexpr bool kInterleaved = kStride > 1 || RealTraits<Real>::kLanes > 1;

/// Numbers of the contacts, by position, field by field in tiles: reads of neighbouring lanes are together, and so are
/// those of one visit. Interleaved, neighbouring lanes read neighbouring environments, and a tile is one contact.
template <class Real, int kStride>
struct ContactTiles {
  static constexpr Index kTile = kInterleaved<Real, kStride> ? 1 : kTileContacts;
  Real* data = nullptr;
  Index fields = 0;
  [[nodiscard]] STICTION_HD Real& at(Index field, Index p) const {
    return data[((static_cast<Offset>(p / kTile) * fields + field) * kTile + p % kTile) * kStride];
  }
  /// Numbers of a field, those that fill the last tile included.
  static STICTION_HD constexpr Offset padded(Offset contacts) { return (contacts + kTile - 1) / kTile * kTile; }
};

/// Fields of a contact that a sweep reads. Fields from kFieldBlock on depend on the law.
enum ContactField : Index {
  kFieldArmA = 0,    ///< x, y, z
  kFieldArmB = 3,    ///< x, y, z
  kFieldNormal = 6,  ///< x, y, z
  kFieldMu = 9,
  kFieldBias = 10,     ///< target velocity of the normal row, negative
  kFieldWeight = 11,   ///< mean diagonal of the block and R, before mu: weight of steps in units of w
  kFieldShare = 12,    ///< of its island: the largest error scale over the island's
  kFieldPress = 13,    ///< ConeMetric: a, then the weights of reactions of t1, t2
  kFieldInverse = 16,  ///< 1 / normal diagonal, 1 / bound of the tangential block; boxed: of t1
  kFieldBlock = 18,    ///< coulomb: n1, n2; convex: damping and share of BlockMetric, then nn, n1, n2, t11, t12, t22;
                       ///< boxed: n1, n2, t12, 1 / bound of t2
};

template <Law kLaw>
inline constexpr Index kContactFields = kFieldBlock + (kLaw == Law::coulomb   ? 2
                                                       : kLaw == kBoxFriction ? 4
                                                                              : 8);

/// The twist whose six numbers begin an array, of one precision, in another.
template <class T, class Array>
STICTION_HD Twist<T> twist_at(const Array& row) {
  return {{static_cast<T>(row[0]), static_cast<T>(row[1]), static_cast<T>(row[2])},
          {static_cast<T>(row[3]), static_cast<T>(row[4]), static_cast<T>(row[5])}};
}
template <class Array, class T>
STICTION_HD void put_twist(const Array& row, const Twist<T>& twist) {
  row[0] = twist.linear.x;
  row[1] = twist.linear.y;
  row[2] = twist.linear.z;
  row[3] = twist.angular.x;
  row[4] = twist.angular.y;
  row[5] = twist.angular.z;
}

/// Working arrays of a team: the contacts in visiting order, the bodies, and the world as a last body that stands
/// still. x are impulses in coordinates in which the friction cone is the unit cone: x_t = lambda_t / mu.
///
/// With a stride above 1 that many systems interleave their numbers. Each belongs to one lane, which visits its
/// contacts in order. Lanes in lock-step touch neighbouring addresses whichever bodies they are at.
template <class RealType, Law kLawValue, int kStrideValue = 1>
struct BodySystem {
  using Real = RealType;
  static constexpr Law kLaw = kLawValue;
  static constexpr int kStride = kStrideValue;
  using Numbers = Strided<Real, kStride>;
  using Tiles = ContactTiles<Real, kStride>;
  /// Places of a body's numbers. A single system has whole sectors of memory in single precision. Interleaved, the
  /// memory is scarce and a sector holds one number of many bodies.
  static constexpr Index kMassRow = kInterleaved<Real, kStride> ? 7 : 8;
  static constexpr Index kTwistRow = kInterleaved<Real, kStride> ? 6 : 8;

  Index contacts;                  ///< that are solved
  Index bodies;                    ///< without the world
  Real compliance;                 ///< R
  Tiles field;                     ///< ContactField
  Tiles x;                         ///< the iterate, rows n, t1, t2
  Tiles best;                      ///< the iterate with the smallest residual recorded
  Tiles before;                    ///< momentum: the iterate before
  Tiles depth;                     ///< at the beginning of the sub-step
  Numbers mass;                    ///< inverse mass and inertia; zeros where nothing pushes         (bodies + 1 rows)
  Numbers start;                   ///< twists at the beginning of the sub-step                      (bodies + 1 rows)
  Numbers motion;                  ///< twists under x                                               (bodies + 1 rows)
  Numbers motion_before;           ///< momentum: those under `before`                               (bodies + 1 rows)
  Strided<double, kStride> exact;  ///< twists under the returned impulses                           (6 * (bodies + 1))

  /// Numbers of Real an environment needs.
  static STICTION_HD constexpr Offset elements(Offset contacts, Offset bodies, bool momentum) {
    return Tiles::padded(contacts) * (kContactFields<kLaw> + (momentum ? 10 : 7)) +
           (bodies + 1) * (kMassRow + kTwistRow * (momentum ? 3 : 2));
  }
  /// Elements of one contact that a sweep reads or writes.
  static constexpr Offset swept_elements(bool momentum) { return kContactFields<kLaw> + (momentum ? 6 : 3); }
  /// Numbers of double it needs besides.
  static STICTION_HD constexpr Offset exact_elements(Offset bodies) { return 6 * (bodies + 1); }

  STICTION_HD BodySystem(Index contact_count, Index body_count, const SiParams& params, Real* memory,
                         double* exact_memory)
      : contacts(contact_count),
        bodies(body_count),
        compliance(static_cast<Real>(div_(params.cfm, params.step))),
        exact{exact_memory} {
    const Offset slots = Tiles::padded(contacts);
    const Offset rows = static_cast<Offset>(bodies) + 1;
    const auto take = [&memory](Offset count) {
      Real* const part = memory;
      memory += count * kStride;
      return part;
    };
    // Tiles first: they begin on cache lines when the memory does.
    field = {take(slots * kContactFields<kLaw>), kContactFields<kLaw>};
    x = {take(slots * 3), 3};
    best = {take(slots * 3), 3};
    before = {params.momentum ? take(slots * 3) : nullptr, 3};
    depth = {take(slots), 1};
    mass = {take(rows * kMassRow)};
    start = {take(rows * kTwistRow)};
    motion = {take(rows * kTwistRow)};
    motion_before = {params.momentum ? take(rows * kTwistRow) : nullptr};
  }

  [[nodiscard]] STICTION_HD bool has_momentum() const { return motion_before.data != nullptr; }
  [[nodiscard]] STICTION_HD Vector3<Real> vector(Index first_field, Index p) const {
    return {field.at(first_field, p), field.at(first_field + 1, p), field.at(first_field + 2, p)};
  }
  [[nodiscard]] STICTION_HD ContactFrame<Real> frame(Index p) const { return frame_of(vector(kFieldNormal, p)); }
  /// The numbers of one body.
  [[nodiscard]] STICTION_HD Numbers mass_row(Index slot) const {
    return mass.from(static_cast<Offset>(slot) * kMassRow);
  }
  [[nodiscard]] static STICTION_HD Numbers twist_row(const Numbers& twists, Index slot) {
    return twists.from(static_cast<Offset>(slot) * kTwistRow);
  }
  [[nodiscard]] STICTION_HD Strided<double, kStride> exact_row(Index slot) const {
    return exact.from(6 * static_cast<Offset>(slot));
  }
  [[nodiscard]] static STICTION_HD Twist<Real> twist(const Numbers& twists, Index slot) {
    return twist_at<Real>(twist_row(twists, slot));
  }
  static STICTION_HD void set_twist(const Numbers& twists, Index slot, const Twist<Real>& twist) {
    put_twist(twist_row(twists, slot), twist);
  }
  [[nodiscard]] STICTION_HD InverseMass<Real> inverse_mass(Index slot) const {
    const Numbers row = mass_row(slot);
    return {row[0], load6<Real>(row.from(1))};
  }
  /// Moves a side of a contact, which is pushed; `where` has nothing to add.
  STICTION_HD void move_side(Index side, bool, const Twist<Real>&, const Twist<Real>& twist) const {
    set_twist(motion, side, twist);
  }
};

/// f(i) for every i in [0, n), shared out in runs of neighbours as long as the team takes them; ends in a sync. The
/// f(i) must not depend on each other.
template <Team TeamT, class F>
STICTION_HD void for_each_tiled(TeamT& team, Index n, F&& f) {
  constexpr Index kRun = TeamT::kRowTile;
  const Index runs = (n + kRun - 1) / kRun;
  for (Index run = team.rank(); run < runs; run += team.size()) {
    const Index end = (run + 1) * kRun < n ? (run + 1) * kRun : n;
    for (Index i = run * kRun; i < end; ++i) f(i);
  }
  team.sync();
}

}  // namespace stiction::inline STICTION_ISA
