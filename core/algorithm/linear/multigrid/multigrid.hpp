#pragma once

#include "core/algorithm/linear/block/attach_bodies.hpp"
#include "core/algorithm/linear/multigrid/multigrid_memory.hpp"

namespace stiction::inline STICTION_ISA {

/// Aggregation multigrid as a preconditioner (docs/math/multigrid.md): one cycle, symmetric positive definite.
struct Multigrid {
  MultigridView plan;
  Cycle cycle = Cycle::v;
  double* memory = nullptr;  ///< (doubles(plan))
  BlockMatrix finest;        ///< as given to prepare()

  static STICTION_HD Offset doubles(const MultigridView& plan) { return MultigridMemory::doubles(plan); }

  /// Takes H = M + J'WJ, which must live on as long as apply() is called, and the bodies' positions, three for each,
  /// from any origin. Every lane calls it on its Multigrid.
  template <Team TeamT>
  STICTION_HD_OUTLINE void prepare(TeamT& team, const BlockMatrix& H, const double* positions) {
    finest = H;
    const MultigridMemory grids = this->grids();
    for (Index l = 0; l < last(); ++l) {
      const GridLevel level = this->level(l);
      const GridLevel coarse = this->level(l + 1);
      const double* const position = l == 0 ? positions : level.position;
      level.smoother.D.prepare(team, level.smoother.H);
      const double bound = eigenvalue_bound(team, level, l);
      single(team, [&] {
        const SweepWeights weights = sweep_weights(bound);
        for (Index i = 0; i < kSweeps; ++i) level.weights[i] = weights.weight[i];
      });
      pose_coarse(team, level.plan, position, coarse.position);
      const Attachment attachment{level.smoother.H, level.plan.prolongation, level.plan.aggregate, level.plan.root,
                                  grids.labels(0),  grids.labels(1),         grids.labels(2)};
      const RigidMotions rigid{level.plan, level.smoother.H, position, coarse.position, attachment.label};
      if (plan.is_smoothed()) {
        attachment.run(team);
        prolong_smoothly(team, rigid, level.smoother.D, div_(kProlongationDamping, bound), level.P);
      } else {
        prolong_rigidly(team, rigid, level.P);
      }
      const BlockMatrix product{level.plan.product, grids.product()};
      multiply_matrices(team, level.smoother.H, level.P, product);
      multiply_matrices(team, level.restriction, product, coarse.smoother.H);
    }
    const GridLevel coarsest = level(last());
    coarsest.smoother.D.prepare(team, coarsest.smoother.H);
    grids.coarsest().prepare(team, coarsest.smoother.H);
  }

  /// z = one cycle for H z = r from z = 0; r and z apart, 6 doubles a body.
  template <Team TeamT>
  STICTION_HD_OUTLINE void apply(TeamT& team, const double* r, double* z) const {
    Index visits[kMostLevels];
    Index l = 0;
    visits[0] = 0;
    do {
      for (; l < last(); ++l) {
        descend(team, l, visits[l] == 0, r, z);
        visits[l + 1] = 0;
      }
      solve_coarsest(team, r, z);
      // The coarsest level is solved exactly: once is enough.
      for (bool goes_up = true; goes_up && l > 0;) {
        ++visits[l];
        goes_up = l == last() || visits[l] == static_cast<Index>(cycle);
        if (goes_up) ascend(team, --l, r, z);
      }
    } while (l > 0);
  }

  /// A level's numbers, for readers of the hierarchy.
  [[nodiscard]] STICTION_HD GridLevel level(Index l) const { return grids().level(l, finest); }

 private:
  /// More than there can be: each level has at most half the coupled bodies of the one before.
  static constexpr Index kMostLevels = 32;
  /// Factor of the largest eigenvalue's inverse: the damping that makes the worst rough error of a prolongation
  /// smallest (Vanek, Mandel and Brezina 1996, section 2).
  static constexpr double kProlongationDamping = 4.0 / 3.0;
  /// No contact has more than two bodies, so J'WJ is at most twice its diagonal blocks, and M + J'WJ as well. Rigid
  /// prolongations make contacts of at most two coarse bodies of them.
  static constexpr double kPairBound = 2.0;

  [[nodiscard]] STICTION_HD Index last() const { return plan.levels() - 1; }
  [[nodiscard]] STICTION_HD MultigridMemory grids() const { return {plan, memory}; }

  /// At least, or by the power method almost, the largest eigenvalue of D^-1 H; on every lane.
  template <Team TeamT>
  STICTION_HD double eigenvalue_bound(TeamT& team, const GridLevel& level, Index l) const {
    if (l == 0 || !plan.is_smoothed()) return kPairBound;
    return kPowerMargin * largest_eigenvalue(team, level.smoother, level.solution, level.right);
  }

  template <Team TeamT>
  STICTION_HD_OUTLINE void descend(TeamT& team, Index l, bool from_zero, const double* r, double* z) const {
    const GridLevel level = this->level(l);
    const double* const right = l == 0 ? r : level.right;
    double* const solution = l == 0 ? z : level.solution;
    double* const residual = grids().residual();
    if (from_zero)
      level.smoother.first_sweep(team, level.weights[0], right, solution);
    else
      level.smoother.sweep(team, level.weights[0], right, solution, residual);
    level.smoother.sweep(team, level.weights[1], right, solution, residual);
    level.smoother.residual(team, right, solution, residual);
    multiply_transposed(team, level.restriction, residual, this->level(l + 1).right);
  }

  template <Team TeamT>
  STICTION_HD_OUTLINE void ascend(TeamT& team, Index l, const double* r, double* z) const {
    const GridLevel level = this->level(l);
    const double* const right = l == 0 ? r : level.right;
    double* const solution = l == 0 ? z : level.solution;
    double* const residual = grids().residual();
    add_product(team, level.P, this->level(l + 1).solution, solution);
    for (Index sweep = kSweeps - 1; sweep >= 0; --sweep)
      level.smoother.sweep(team, level.weights[sweep], right, solution, residual);
  }

  template <Team TeamT>
  STICTION_HD_OUTLINE void solve_coarsest(TeamT& team, const double* r, double* z) const {
    const GridLevel level = this->level(last());
    const double* const right = last() == 0 ? r : level.right;
    double* const solution = last() == 0 ? z : level.solution;
    level.smoother.first_sweep(team, 1.0, right, solution);
    grids().coarsest().solve(team, level.plan.rows, right, solution);
  }
};

}  // namespace stiction::inline STICTION_ISA
