#pragma once

#include "core/algorithm/linear/block/incomplete_cholesky.hpp"
#include "core/algorithm/linear/block/natural_levels.hpp"
#include "core/algorithm/linear/krylov/bicgstab.hpp"
#include "core/algorithm/velocity/blocks/hessian_pattern.hpp"
#include "core/algorithm/velocity/blocks/mass_blocks.hpp"

namespace stiction::inline STICTION_ISA {

/// Sizes of an environment's arrays. The memory follows from them alone.
struct BlockExtent {
  Index rows = 0;
  Index cones = 0;
  Index dofs = 0;
};

/// Which cones a sweep may visit at once, level by level.
struct SweepLists {
  Index levels = 0;
  Index* level;          ///< of each cone                                             (cones)
  Index* level_offsets;  ///< first of each level in `order`                           (cones + 1)
  Index* order;          ///< cones by level                                           (cones)
  Index* last;           ///< the last level that pushed each block                    (blocks)

  static STICTION_HD constexpr Offset integers(Offset cones, Offset dofs) {
    return 3 * (cones + 1) + DofBlocks::most(dofs);
  }
  STICTION_HD SweepLists(Index cones, Index dofs, Index*& memory) {
    level = memory;
    level_offsets = level + cones + 1;
    order = level_offsets + cones + 1;
    last = order + cones + 1;
    memory = last + DofBlocks::most(dofs);
  }
};

/// The integers of an environment: blocks, touches, the pattern of H and the levels of its incomplete factor.
struct BlockLists {
  DofBlocks dofs;
  ConeTouches touches;
  HessianPattern H;
  SweepLists sweeps;
  NaturalLevels levels;
  Index* level_memory;

  static STICTION_HD constexpr Offset integers(const BlockExtent& extent) {
    return DofBlocks::integers(extent.dofs) + ConeTouches::integers(extent.cones, extent.dofs) +
           HessianPattern::integers(extent.rows, extent.dofs) + SweepLists::integers(extent.cones, extent.dofs) +
           NaturalLevels::integers(DofBlocks::most(extent.dofs), kBlocksPerRow * extent.rows);
  }
  STICTION_HD BlockLists(const BlockExtent& extent, Index* memory)
      : dofs(extent.dofs, memory),
        touches(extent.cones, extent.dofs, memory),
        H(extent.rows, extent.dofs, memory),
        sweeps(extent.cones, extent.dofs, memory),
        level_memory(memory) {}
};

/// The numbers of an environment, in double whatever the batch's precision. Rows are in the batch's units and order.
struct BlockWorkspace {
  static constexpr Index kSteps = 4;
  static constexpr Offset kByRow = 22 + kMaxConeRows, kByCone = 14, kByUnknown = 7 + kStabilizedVectors;

  double* J;              ///< of each touch, kBodyBlock numbers for each of its cone's rows
  double* Y;              ///< M^-1 J' of each cone, for the blocks that it pushes
  double* target;         ///< targets of rows                                              (rows)
  double* b;              ///< J v_free - target                                            (rows)
  double* R;              ///< compliance                                                   (rows)
  double* mu;             ///< friction; 1 on a cone's first row                            (rows)
  double* prox;           ///< weight of the proximal term                                  (rows)
  double* prox_center;    ///< its centre                                                   (rows)
  double* shift;          ///< term added to the motion                                     (rows)
  double* z;              ///< motion with its shift                                        (rows)
  double* x;              ///< reactions at z                                               (rows)
  double* G_rows;         ///< a row's slope; of a cone, the normal's, and direction of -z_t  (rows)
  double* Jp;             ///< J step                                                       (rows)
  double* GJp;            ///< G J step                                                     (rows)
  double* diagonal;       ///< of J M^-1 J'                                                 (rows)
  double* motion;         ///< w of the reactions last evaluated                            (rows)
  double* answer;         ///< reactions as the batch's precision has them                  (rows)
  double* best;           ///< the best of them                                             (rows)
  double* x_before;       ///< reactions one sweep ago                                      (rows)
  double* unit_x;         ///< reactions in the coordinates of the unit cone                (rows)
  double* B;              ///< of a cone: its block of A + R in those, row by row           (kMaxConeRows rows)
  double* sigma;          ///< direction of slip times mu, where it follows                 (rows)
  double* feedback;       ///< of reactions on the slip                                     (rows)
  double* law;            ///< RowLaw or ConeLaw                                            (3 cones)
  double* G_cones;        ///< of a friction cone: across, slide, bend                      (3 cones)
  double* steps;          ///< of a sweep: inv_n, inv_t, damping, share                     (kSteps cones)
  double* axis_press;     ///< ConeMetric's weights                                         (rows)
  double* axis_slip;      ///<                                                              (rows)
  double* weight;         ///< weights of steps in units of w                               (cones)
  double* share;          ///< of its island, over the largest error scale                  (cones)
  double* line_slope;     ///< of each cone, along a line                                   (cones)
  double* line_curve;     ///<                                                              (cones)
  double* v_free;         ///<                                                              (unknowns)
  double* point;          ///< p = v - v_free                                               (unknowns)
  double* step;           ///< d                                                            (unknowns)
  double* force;          ///< minus the gradient                                           (unknowns)
  double* pushed;         ///< M^-1 J' lambda; M times a vector                             (unknowns)
  double* pushed_before;  ///< one sweep ago                                             (unknowns)
  double* mobility;       ///< inverse pivots of M                                          (unknowns)
  double* gradients;  ///< of the linear systems' methods                               (kStabilizedVectors unknowns)
  double* mass;    ///< M                                                            (lower half of as many blocks as H)
  double* factor;  ///< of M                                                         (as many)
  double* H;       ///< M + J'GJ                                                     (kBlocksPerRow rows blocks)
  double* sliding;  ///< the same with slips that follow                              (as many)
  double* lower;    ///< H's incomplete factor
  double* path;     ///< of each lane: a row of J through a group                     (lanes, 6 kMostGroupBlocks)

  static STICTION_HD constexpr Offset blocks(const BlockExtent& extent) { return kBlocksPerRow * extent.rows; }
  static STICTION_HD constexpr Offset lower_blocks(const BlockExtent& extent) {
    return (blocks(extent) + DofBlocks::most(extent.dofs)) / 2 + 1;
  }
  static STICTION_HD constexpr Offset doubles(const BlockExtent& extent, Offset lanes) {
    const Offset touched = 2 * Offset{kMostTouches} * kBodyBlock * extent.rows;
    return touched + kByRow * extent.rows + kByCone * extent.cones +
           kByUnknown * kBodyBlock * DofBlocks::most(extent.dofs) +
           (2 * blocks(extent) + 3 * lower_blocks(extent)) * kBlockEntries + lanes * kMostGroupBlocks * kBodyBlock;
  }

  STICTION_HD BlockWorkspace(const BlockExtent& extent, double* memory) {
    const auto take = [&memory](Offset size) {
      double* const part = memory;
      memory += size;
      return part;
    };
    for (double** part : {&J, &Y}) *part = take(Offset{kMostTouches} * kBodyBlock * extent.rows);
    for (double** part : {&target,   &b,      &R,     &mu,       &prox,       &prox_center, &shift,  &z,
                          &x,        &G_rows, &Jp,    &GJp,      &diagonal,   &motion,      &answer, &best,
                          &x_before, &unit_x, &sigma, &feedback, &axis_press, &axis_slip})
      *part = take(extent.rows);
    B = take(kMaxConeRows * Offset{extent.rows});
    steps = take(kSteps * Offset{extent.cones});
    for (double** part : {&law, &G_cones}) *part = take(3 * Offset{extent.cones});
    for (double** part : {&weight, &share, &line_slope, &line_curve}) *part = take(extent.cones);
    const Offset unknowns = kBodyBlock * DofBlocks::most(extent.dofs);
    for (double** part : {&v_free, &point, &step, &force, &pushed, &pushed_before, &mobility}) *part = take(unknowns);
    gradients = take(kStabilizedVectors * unknowns);
    for (double** part : {&mass, &factor, &lower}) *part = take(lower_blocks(extent) * kBlockEntries);
    for (double** part : {&H, &sliding}) *part = take(blocks(extent) * kBlockEntries);
    path = memory;
  }
};

}  // namespace stiction::inline STICTION_ISA
