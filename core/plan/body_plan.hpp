#pragma once

#include <memory>
#include <vector>

#include "core/job/body_plan_view.hpp"
#include "core/job/parallel_for.hpp"
#include "stiction/bodies.hpp"

namespace stiction {

/// Contacts of a run of one body pair that are visited as one vertex: a face against a face has four.
inline constexpr Index kManifoldContacts = 4;

/// Everything decided in integers before a body solve. A "position" is a place in an environment's visiting order.
/// Each array begins, for environment e, at the batch's own offset. It has one more entry per environment where the
/// last one closes the others, so that environments can be filled in any order.
struct BodyPlanData {
  std::vector<Offset> env_body_offsets, env_contact_offsets;  ///< copies of the batch's           (env_count + 1)
  std::vector<Index> kept;           ///< contacts that are solved, all unless over capacity      (env_count)
  std::vector<Index> contact_order;  ///< position -> contact, environment-local; -1 past `kept`  (contact_count)
  std::vector<Index> sides;          ///< position -> slots of a and b: a body that moves is its number, one that is not
                                     ///< pushed ~number, the world ~(bodies)                     (2 * contact_count)
  std::vector<Index>
      vertex_offsets;  ///< position where each vertex begins, closed by `kept`     (contact_count + env_count)
  std::vector<Index>
      color_offsets;  ///< vertex where each colour begins, closed by their count  (contact_count + env_count)
  std::vector<Index> color_count;  ///<                                                         (env_count)
  std::vector<Index>
      body_offsets;  ///< where each body's entries begin in body_contacts        (body_count + env_count)
  std::vector<Index> body_contacts;  ///< of each body that is pushed, in order of position: the position where it is b,
                                     ///< ~position where it is a                                 (2 * contact_count)

  bool has_newton = false;             ///< whether the arrays below are there
  BodySpaceOptions space;              ///< options that it was made for
  std::vector<Index> newton_stream;    ///< integers of Newton's method in body space (core/job/newton_stream.hpp)
  std::vector<Offset> newton_offsets;  ///< where each environment's begin in it                   (env_count + 1)

  [[nodiscard]] Offset env_count() const { return static_cast<Offset>(kept.size()); }
  [[nodiscard]] BodyPlanView view() const {
    return {kept.data(),          contact_order.data(), sides.data(),        vertex_offsets.data(),
            color_offsets.data(), color_count.data(),   body_offsets.data(), body_contacts.data(),
            newton_stream.data(), newton_offsets.data()};
  }
};

/// Plans a host batch whose structure is sound. Vertices are runs of up to kManifoldContacts neighbouring contacts of
/// one body pair. They are coloured so that those of a colour share no body that is pushed. The colouring is greedy:
/// the larger sum of the bodies' vertex counts first, then the lower index. Each gets the smallest colour free at both
/// bodies. In a colour they are ordered by their lower pushed body. Time linear in contacts for bodies with few
/// contacts; a body with d contacts adds d^2 / 64.
///
/// An environment with more than `capacity` contacts (0: no limit) keeps the deepest, the lower index among equals.
template <class Real>
BodyPlanData make_body_plan(const BodyBatchView<Real>& batch, Index capacity,
                            const ParallelFor& parallel_for = all_at_once);

/// Returns true if a plan was made for bodies and contacts like this host batch's.
template <class Real>
bool fits(const BodyPlanData& plan, const BodyBatchView<Real>& batch);

}  // namespace stiction
