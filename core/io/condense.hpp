#pragma once

#include <vector>

#include "stiction/io.hpp"

namespace stiction::io {

/// Largest block of coupled degrees of freedom that condense() factors (dense LU, 128 MiB).
inline constexpr Index kMaxBlock = 4096;
/// Most numbers that condense() holds at once: in a block's M^-1 J', and in all blocks' parts of A together.
inline constexpr std::size_t kMaxEntries = std::size_t{1} << 26;

struct Condensed {
  Csr A;                       ///< J M^-1 J'      (rows x rows)
  std::vector<double> v_free;  ///< M^-1 f         (dofs)
};

/// Eliminates the degrees of freedom. M (dofs x dofs) falls into blocks of coupled degrees of freedom, bodies as a
/// rule. Each is factored densely with partial pivoting, so M need not be symmetric (files carry M that is not by
/// 1e-7) but must be regular. J is rows x dofs, f has one entry per degree of freedom.
/// \throws Error(bad_file) for a singular block or one beyond the limits above; the message lacks the file's name
Condensed condense(const Csr& M, const Csr& J, const std::vector<double>& f);

}  // namespace stiction::io
