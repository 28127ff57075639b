#pragma once

#include <vector>

#include "distributed/transport/transport.hpp"
#include "distributed/world/bodies.hpp"
#include "distributed/world/piece_bodies.hpp"

namespace stiction::distributed {

/// A rank's bodies and the ghosts near them.
template <class Real>
struct NearBodies {
  BodyList<Real> list;
  std::vector<int> owner;  ///< of each
  Offset all_bodies = 0;   ///< of all ranks
  Offset most_bodies = 0;  ///< that one rank has
};

/// The rank's own bodies and those of other ranks that may touch them within a step. Ranks exchange the box of their
/// bodies, and then send those whose box overlaps it. Computes the changes of `own` by forces. All ranks call it.
/// \throws RankLost
template <class Real>
NearBodies<Real> find_near_bodies(Transport& transport, const BodyList<Real>& own, PartOfWorld<Real>& part);

/// The contacts of a rank's bodies in a step, as a batch of one environment. Their order and numbers are those of the
/// whole world's contacts, without those that push none of the rank's bodies.
template <class Real>
class StepPiece {
 public:
  /// Finds them. `last`: start of the impulses. `keep`: the share of it that is handed on; 0: nothing is.
  StepPiece(const WorldModelView<Real>& whole, const NearBodies<Real>& near, int rank, const Impulses<Real>& last,
            Real keep);

  [[nodiscard]] const PieceBodies& bodies() const { return bodies_; }
  [[nodiscard]] Offset ghosts() const;
  [[nodiscard]] HostContacts<Real>& contacts() { return contacts_; }
  [[nodiscard]] const HostContacts<Real>& contacts() const { return contacts_; }
  [[nodiscard]] BodyBatchView<Real> batch() const;
  /// Returns true if this rank answers for a contact that two ranks have.
  [[nodiscard]] bool is_home(Offset contact) const;

 private:
  void detect(const WorldModelView<Real>& whole, PartOfWorld<Real>& part, const Impulses<Real>& last, Real keep);
  void choose_bodies(const WorldArrays<Real>& from);

  PieceBodies bodies_;
  std::vector<Offset> body_offsets_;
  std::vector<Real> inv_mass_, inv_inertia_, twist_, twist_change_;
  HostContacts<Real> contacts_;
};

}  // namespace stiction::distributed
