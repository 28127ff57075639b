#pragma once

#include "tests/fuzz/bytes.hpp"

/// Each makes environments of a few bytes, most of them sound and one spoiled. It solves them together and one by one,
/// and requires the promises of docs/reference/determinism.md and docs/reference/data_layout.md.
namespace stiction::fuzz {

void check_contacts(Bytes& bytes);   ///< contact batches: A, b and cones
void check_jacobians(Bytes& bytes);  ///< Jacobian batches: J, M and velocities
void check_bodies(Bytes& bytes);     ///< bodies and contact points

}  // namespace stiction::fuzz
