#pragma once

#include <string>

#include "stiction/io.hpp"

namespace stiction::test {

/// `count` environments of 1, 2, 3, 1, ... friction cones of three rows on a chain, diagonally dominant, each with
/// another right-hand side. Every solver solves them.
io::Recording chain_recording(int count);

/// `count` environments, each of two such chains that do not act on one another.
io::Recording island_recording(int count);

/// The arrays of a batch, to be spoilt and put back by with_arrays().
io::Recording with_arrays(const io::Recording& recording, ContactBatch<double>::Arrays arrays);

/// Writes a recording and returns the path.
std::string write_batch(const std::string& path, const io::Recording& recording);

}  // namespace stiction::test
