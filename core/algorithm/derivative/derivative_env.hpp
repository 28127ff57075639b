#pragma once

#include "core/algorithm/problem/env_view.hpp"
#include "core/job/derivative_job.hpp"
#include "core/team/scan.hpp"

/// One environment of which derivatives are taken, and the scratch that they take.
namespace stiction::inline STICTION_ISA {

/// Scratch of one environment. Unknown k of a cone has number first[cone] + k, and column k of E and F in its rows.
struct DerivativeScratch {
  double* w;                ///< residual motion [w]                               (n)
  double* E;                ///< how reactions follow the unknowns                 (n x kMaxConeRows)
  double* F;                ///< which motions stay zero                           (n x kMaxConeRows)
  double* D;                ///< of unknown k of a cone, at the cone's first row + k  (n)
  double* seed;             ///< right-hand side pulled back or pushed forward     (n)
  double* nu;               ///< adjoint reaction, or change of the reaction       (n)
  double* image;            ///< product with A                                    (n)
  double* still;            ///< change of the motion while reactions rest         (n)
  double* K;                ///< the system's matrix, column by column             (most x most)
  double* pivots;           ///<                                                   (most)
  double* row_scale;        ///< powers of two                                     (most)
  double* column_scale;     ///<                                                   (most)
  double* unknown;          ///<                                                   (most)
  double* velocity;         ///< Y' times a vector                                 (dofs)
  double* velocity_change;  ///< dY' times the reactions                        (dofs)
  double* left;             ///< Y' F, unknown by unknown                          (most x dofs)
  double* right;            ///< Y' E                                              (most x dofs)
  Index* first;             ///< first unknown of each cone                        (cone_count + 1)
  Index* mode;              ///< ConeMode                                          (cone_count)
  Index* degenerate;        ///< 1 of a cone between two modes                     (cone_count)
  Index* cone_of_row;       ///<                                                   (n)
  Index* moving;            ///< rows of cones that have unknowns, in order; behind all, how many  (n + 1)
  Index* parts;             ///< of a scan                                         (kScanParts)
};

/// The most unknowns that an environment's scratch is for.
template <class Real>
STICTION_HD Index most_unknowns(const DerivativeJob<Real>& job, Offset env) {
  const Index n = job.batch.env_rows(env);
  return n < job.max_unknowns ? n : job.max_unknowns;
}

/// Scratch of an environment of that size, in doubles.
STICTION_HD constexpr Offset derivative_elements(Offset rows, Offset cones, Offset dofs, Offset most) {
  const Offset integers = (cones + 1) + 2 * cones + 2 * rows + 1 + kScanParts;
  return rows * (6 + 2 * kMaxConeRows) + most * (most + 4) + dofs * (2 * most + 2) + (integers + 1) / 2;
}
template <class Real>
STICTION_HD Offset derivative_elements(const DerivativeJob<Real>& job, Offset env) {
  return derivative_elements(job.batch.env_rows(env), job.batch.env_cones(env), job.batch.env_dofs(env),
                             most_unknowns(job, env));
}

/// Divides that scratch into its arrays.
STICTION_HD DerivativeScratch lay_out(Offset n, Offset cones, Offset dofs, Offset most, double* memory) {
  const auto take = [&](Offset count) {
    double* const begin = memory;
    memory += count;
    return begin;
  };
  DerivativeScratch s;
  s.K = take(most * most);
  s.E = take(n * kMaxConeRows);
  s.F = take(n * kMaxConeRows);
  s.w = take(n);
  s.D = take(n);
  s.seed = take(n);
  s.nu = take(n);
  s.image = take(n);
  s.still = take(n);
  s.pivots = take(most);
  s.row_scale = take(most);
  s.column_scale = take(most);
  s.unknown = take(most);
  s.velocity = take(dofs);
  s.velocity_change = take(dofs);
  s.left = take(most * dofs);
  s.right = take(most * dofs);
  auto* integers = reinterpret_cast<Index*>(memory);
  const auto take_integers = [&](Offset count) {
    Index* const begin = integers;
    integers += count;
    return begin;
  };
  s.first = take_integers(cones + 1);
  s.mode = take_integers(cones);
  s.degenerate = take_integers(cones);
  s.cone_of_row = take_integers(n);
  s.moving = take_integers(n + 1);
  s.parts = take_integers(kScanParts);
  return s;
}
template <class Real>
STICTION_HD DerivativeScratch lay_out(const DerivativeJob<Real>& job, Offset env, double* memory) {
  return lay_out(job.batch.env_rows(env), job.batch.env_cones(env), job.batch.env_dofs(env), most_unknowns(job, env),
                 memory);
}

}  // namespace stiction::inline STICTION_ISA
