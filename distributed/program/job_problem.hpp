#pragma once

#include <vector>

#include "distributed/program/commands.hpp"
#include "stiction/jacobian_bodies.hpp"

namespace stiction::distributed {

/// Problem of `stiction-mpi solve`, as every rank has it: bodies and contacts. Matrices of a file or a scene are not
/// kept.
template <class Real>
struct JobProblem {
  JacobianBodies<Real> bodies;  ///< without tangents where rows are the contacts' own
  std::vector<Real> first;      ///< impulses to start from, by contact; empty: zero
  std::vector<Offset> env_row_offsets;
  Law law = Law::coulomb;

  /// Impulses or motions of contacts, in the order of a solution file.
  [[nodiscard]] std::vector<Real> rows(std::vector<Real> by_contact) const;
};

/// Read or made by this rank itself. \throws Error
template <class Real>
JobProblem<Real> job_problem(const SolveArguments& arguments);

}  // namespace stiction::distributed
