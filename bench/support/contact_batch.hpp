#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stiction/stiction.hpp"

namespace stiction::bench {

/// Makes contact systems of a wanted size (bench/results/README.md).
///   stack   scenes' `stack` of just enough boxes: A is block tridiagonal, so larger systems are sparse
///   face    scenes' `adversarial`, crowded face: every contact acts on one body, so A is full at any size
std::vector<std::string> families();

inline constexpr Offset kDistinct = 64;
inline constexpr std::uint64_t kSeed = 7;  ///< of the scenes behind every committed table

/// `envs` environments of exactly `contacts` friction cones of three rows (mu alike on both axes), law coulomb. They
/// are the first ones of each environment of the scene. The first kDistinct environments differ, then they repeat.
/// \throws Error(invalid_argument) for an unknown family, contacts outside 1..64 or envs < 1.
template <class Real>
ContactBatch<Real> make_contacts(const std::string& family, Index contacts, Offset envs, std::uint64_t seed = kSeed);

/// Returns the number of environments of that many contacts to solve when the caller wants `wanted`. All dense
/// matrices together hold at most `entries` numbers. There are at least 16, so that a pack of lanes is full.
Offset capped_envs(Index contacts, Offset wanted, Offset entries);

/// Options of a run that takes exactly `sweeps` iterations in every environment.
SolverOptions fixed_sweeps(SolverKind solver, Index sweeps);

/// The largest relative residual over the batch, recomputed in f64.
template <class Real>
double worst_residual(const ContactBatch<Real>& batch, const std::vector<Real>& lambda);

/// hash_bits(lambda) as 16 hexadecimal digits.
template <class Real>
std::string hash_text(const std::vector<Real>& lambda);

}  // namespace stiction::bench
