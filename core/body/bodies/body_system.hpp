#pragma once

#include "core/block/phases.hpp"
#include "core/body/bodies/body_env.hpp"

namespace stiction::inline STICTION_ISA {

/// Contacts whose numbers of one field lie side by side: a cache line of single precision, half a warp.
inline constexpr Index kTileContacts = 16;

/// Numbers of the contacts, by position, field by field in tiles: what neighbouring lanes read is together, and so is
/// what one visit reads.
template <class Real>
struct ContactTiles {
  Real* data = nullptr;
  Index fields = 0;
  [[nodiscard]] STICTION_HD Real& at(Index field, Index p) const {
    return data[(static_cast<Offset>(p / kTileContacts) * fields + field) * kTileContacts + p % kTileContacts];
  }
};

/// Fields of a contact that a sweep reads. Those from kFieldBlock on depend on the law.
enum ContactField : Index {
  kFieldArmA = 0,    ///< x, y, z
  kFieldArmB = 3,    ///< x, y, z
  kFieldNormal = 6,  ///< x, y, z
  kFieldMu = 9,
  kFieldBias = 10,     ///< target velocity of the normal row, negative
  kFieldWeight = 11,   ///< mean diagonal of the block and R, before mu: the residual's a
  kFieldInverse = 12,  ///< coulomb: 1 / normal diagonal; convex: 1 / bound on the block's largest eigenvalue
  kFieldBlock = 13,    ///< coulomb: 1 / bound of the tangential block, then n1, n2; convex: nn, n1, n2, t11, t12, t22
};

template <Law kLaw>
inline constexpr Index kContactFields = kFieldBlock + (kLaw == Law::coulomb ? 3 : 6);

/// Places of a body's numbers in an array with a row of kBodyRow for each slot: one sector of memory in single
/// precision.
inline constexpr Index kBodyRow = 8;

/// What a block works on: the contacts in visiting order, the bodies, and the world as a last body that stands still.
/// x are impulses in coordinates in which the friction cone is the unit cone: x_t = lambda_t / mu.
template <class RealType, Law kLawValue>
struct BodySystem {
  using Real = RealType;
  static constexpr Law kLaw = kLawValue;

  Index contacts;             ///< that are solved
  Index bodies;               ///< without the world
  Real compliance;            ///< R
  ContactTiles<Real> field;   ///< ContactField
  ContactTiles<Real> x;       ///< the iterate, rows n, t1, t2
  ContactTiles<Real> best;    ///< the iterate with the smallest residual recorded
  ContactTiles<Real> before;  ///< momentum: the iterate before
  ContactTiles<Real> depth;   ///< at the beginning of the sub-step
  Real* mass;                 ///< inverse mass and inertia; zeros where nothing pushes         (bodies + 1 rows)
  Real* start;                ///< twists at the beginning of the sub-step                      (bodies + 1 rows)
  Real* motion;               ///< twists under x                                               (bodies + 1 rows)
  Real* motion_before;        ///< momentum: those under `before`                               (bodies + 1 rows)
  double* exact;              ///< twists under the returned impulses                           (6 * (bodies + 1))

  /// Numbers of Real an environment needs.
  static STICTION_HD constexpr Offset elements(Offset contacts, Offset bodies, bool momentum) {
    const Offset tiles = (contacts + kTileContacts - 1) / kTileContacts * kTileContacts;
    return tiles * (kContactFields<kLaw> + (momentum ? 10 : 7)) + kBodyRow * (bodies + 1) * (momentum ? 4 : 3);
  }
  /// Those of one contact that a sweep reads or writes.
  static constexpr Offset swept_elements(bool momentum) { return kContactFields<kLaw> + (momentum ? 6 : 3); }
  /// Numbers of double it needs besides.
  static constexpr Offset exact_elements(Offset bodies) { return 6 * (bodies + 1); }

  STICTION_HD BodySystem(Index contact_count, Index body_count, bool momentum, Real* memory, double* exact_memory)
      : contacts(contact_count), bodies(body_count), compliance(0), exact(exact_memory) {
    const Offset tiles = static_cast<Offset>((contacts + kTileContacts - 1) / kTileContacts) * kTileContacts;
    const Offset rows = static_cast<Offset>(kBodyRow) * (bodies + 1);
    const auto take = [&memory](Offset count) {
      Real* const part = memory;
      memory += count;
      return part;
    };
    // Tiles first: they begin on cache lines when the memory does.
    field = {take(tiles * kContactFields<kLaw>), kContactFields<kLaw>};
    x = {take(tiles * 3), 3};
    best = {take(tiles * 3), 3};
    before = {momentum ? take(tiles * 3) : nullptr, 3};
    depth = {take(tiles), 1};
    mass = take(rows);
    start = take(rows);
    motion = take(rows);
    motion_before = momentum ? take(rows) : nullptr;
  }

  [[nodiscard]] STICTION_HD Vector3<Real> vector(Index first_field, Index p) const {
    return {field.at(first_field, p), field.at(first_field + 1, p), field.at(first_field + 2, p)};
  }
  [[nodiscard]] static STICTION_HD Twist<Real> twist(const Real* array, Index slot) {
    const Real* row = array + static_cast<Offset>(slot) * kBodyRow;
    return {{row[0], row[1], row[2]}, {row[3], row[4], row[5]}};
  }
  static STICTION_HD void set_twist(Real* array, Index slot, const Twist<Real>& twist) {
    Real* row = array + static_cast<Offset>(slot) * kBodyRow;
    row[0] = twist.linear.x;
    row[1] = twist.linear.y;
    row[2] = twist.linear.z;
    row[3] = twist.angular.x;
    row[4] = twist.angular.y;
    row[5] = twist.angular.z;
  }
  [[nodiscard]] STICTION_HD InverseMass<Real> inverse_mass(Index slot) const {
    const Real* row = mass + static_cast<Offset>(slot) * kBodyRow;
    return {row[0], load6<Real>(row + 1)};
  }
};

/// f(i) for every i in [0, n), shared out in runs of neighbours as long as the block likes them; ends in a sync. The
/// f(i) must not depend on each other.
template <Block B, class F>
STICTION_HD void share_out(B& block, Index n, F&& f) {
  constexpr Index kRun = B::kRowTile;
  const Index runs = (n + kRun - 1) / kRun;
  for (Index run = block.rank(); run < runs; run += block.size()) {
    const Index end = (run + 1) * kRun < n ? (run + 1) * kRun : n;
    for (Index i = run * kRun; i < end; ++i) f(i);
  }
  block.sync();
}

}  // namespace stiction::inline STICTION_ISA
