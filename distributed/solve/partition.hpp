#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "stiction/bodies.hpp"

/// Which rank owns which body. It reaches messages, and no bit.
namespace stiction::distributed {

using Point = std::array<double, 3>;

/// Positions of a batch's bodies, relative to one another: arms give the distance of the two bodies of a contact.
/// Groups of bodies that no contacts join, but for the world's, are set side by side along x. A body that touches no
/// other is where the one before it is.   (body_count)
template <class Real>
std::vector<Point> centres_by_arms(const BodyBatchView<Real>& batch);

/// Recursive coordinate bisection: points are halved across their longest extent until there is a part for each rank.
/// Points of equal coordinate go by their number. Parts of n points differ by log2(ranks) points at most.  (point
/// count)
/// \throws Error(invalid_argument) unless ranks >= 1
std::vector<int> bisect(std::span<const Point> points, int ranks);

/// The owner of a body, drawn at random: a function of the three alone.
int random_owner(Offset body, int ranks, std::uint64_t seed);

/// Owners drawn at random, the same on every machine.   (count)
std::vector<int> random_owners(Offset count, int ranks, std::uint64_t seed);

}  // namespace stiction::distributed
