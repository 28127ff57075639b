#pragma once

#include <vector>

#include "core/job/multigrid_view.hpp"

namespace stiction {

/// A level with at most this many coupled bodies is the coarsest and is factorised: 360 rows, a megabyte of doubles.
inline constexpr Index kCoarsestBodies = 60;

/// Appends to `stream` the hierarchy of a symmetric pattern with its diagonal and ascending columns. It has aggregates
/// (aggregates.hpp), patterns of prolongations, their transposes and Galerkin products, level by level until one has
/// at most kCoarsestBodies coupled bodies. Each level has at most half the coupled bodies of the one before. From
/// integers alone; read by MultigridView. Vanek, Mandel and Brezina 1996.
void append_multigrid(std::vector<Index>& stream, const BlockPattern& finest, Prolongation prolongation);

}  // namespace stiction
