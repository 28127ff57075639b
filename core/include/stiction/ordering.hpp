#pragma once

/// \file
/// Orders of elimination for factorisations.

#include <cstdint>

namespace stiction {

/// The order in which a factorisation eliminates the rows of a symmetric matrix. It decides how many entries its
/// factor has, and in which order its sums are made. The same name is the same algorithm of the same library in every
/// build. Hence no bit depends on the libraries found when the build was configured (docs/explanation/design/0006).
enum class Ordering : std::uint8_t {
  natural,                     ///< as the rows are numbered
  reverse_cuthill_mckee,       ///< narrow bands (Cuthill and McKee 1969; George 1971)
  minimum_degree,              ///< approximate minimum degree (Amestoy, Davis and Duff 1996), Eigen's
  suitesparse_minimum_degree,  ///< the same authors' own code, AMD of SuiteSparse
  nested_dissection,           ///< METIS (Karypis and Kumar 1998), with a fixed seed
};
/// Number of Ordering values.
inline constexpr int kOrderingCount = 5;

/// In every build, because the library is built without any other.
inline constexpr Ordering kDefaultOrdering = Ordering::reverse_cuthill_mckee;

/// Name of an ordering, as reports print it ("natural", "minimum_degree", ...).
const char* to_string(Ordering ordering) noexcept;

/// Returns true if this build has it.
bool is_available(Ordering ordering) noexcept;

}  // namespace stiction
