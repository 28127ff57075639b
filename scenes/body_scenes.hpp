#pragma once

#include <cstdint>
#include <vector>

#include "stiction/bodies.hpp"

/// Scenes in body form, and the same environments as contact systems to check one by the other.
namespace stiction::scenes {

/// Makes a heap of spheres in an open box, with about as many contacts as the caller wants (>= 1). It is a shaken
/// close packing in which half of the neighbours touch. No overlaps, so that standing still is always possible.
/// Depends on its arguments alone and has the same bits from every compiler. Time linear in contacts.
BodyEnvironment<double> make_body_pile(std::uint64_t seed, Index contacts);

/// A packing like that of a heap in a tall box: side * side * layers cells of four spheres each (each >= 1).
BodyEnvironment<double> make_body_column(std::uint64_t seed, Index side, Index layers);

/// Some bodies of a packing, those that touch them, and their contacts.
struct BodyPart {
  BodyEnvironment<double> environment;  ///< contacts in the whole's order; their ids are those of this part
  std::vector<Index> body;              ///< the whole's number of each of its bodies, ascending
  Index walls = 0;                      ///< contacts with walls, which come first: all are of bodies asked for
  Index pairs_below = 0;                ///< then pairs whose lower body was not asked for, then those whose was
};

/// Bodies that make_body_column() of these has.
Offset column_bodies(Index side, Index layers);
/// Bodies first .. end - 1 of make_body_column(), with the same bits. Time and memory are those of the
/// part: the others are not made.
BodyPart make_body_column_part(std::uint64_t seed, Index side, Index layers, Index first, Index end);

/// Boxes of random size one on the other, four contacts between neighbours, on a floor that is kinematic and moves.
BodyEnvironment<double> make_body_stack(std::uint64_t seed, Index boxes);

/// The environment with every number rounded.
BodyEnvironment<float> rounded(const BodyEnvironment<double>& environment);
BodyEnvironment<double> widened(const BodyEnvironment<float>& environment);

/// J, M^-1 and velocities of a body environment, written out from the definitions.
struct BodyMatrices {
  Index rows = 0, dofs = 0;
  std::vector<double> J;       ///< rows n, t1, t2 of each contact; six columns for each body      (rows x dofs)
  std::vector<double> inv_M;   ///< block-diagonal, zero for bodies that nothing pushes            (dofs x dofs)
  std::vector<double> v_free;  ///< twists after the step without reactions                        (dofs)
};
BodyMatrices body_matrices(const BodyEnvironment<double>& environment);

/// The contact system of one step without sub-steps: A = J M^-1 J', b = J v_free - target, R = cfm / dt.
Environment<double> delassus_form(const BodyEnvironment<double>& environment, const TimeStepping& stepping);

}  // namespace stiction::scenes
