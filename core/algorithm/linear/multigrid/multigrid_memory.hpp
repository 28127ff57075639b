#pragma once

#include "core/algorithm/linear/multigrid/coarsest_level.hpp"
#include "core/algorithm/linear/multigrid/prolongation.hpp"
#include "core/algorithm/linear/multigrid/smoother.hpp"
#include "core/job/multigrid_view.hpp"

namespace stiction::inline STICTION_ISA {

/// A level with its numbers. The finest level's vectors and positions are the caller's.
struct GridLevel {
  MultigridLevel plan;
  Smoother smoother;
  BlockMatrix P;
  TransposedMatrix restriction;
  double* weights;   ///< of sweeps              (kSweeps)
  double* right;     ///< right side             (6 rows)
  double* solution;  ///<                        (6 rows)
  double* position;  ///<                        (3 rows)
};

/// Layout of a hierarchy's numbers in one array of doubles.
struct MultigridMemory {
  MultigridView plan;
  double* memory = nullptr;

  static STICTION_HD Offset doubles(const MultigridView& plan) {
    return MultigridMemory{plan, nullptr}.dense_begin() + CoarsestLevel::doubles(plan.dense_bodies());
  }

  [[nodiscard]] STICTION_HD GridLevel level(Index l, const BlockMatrix& finest) const {
    GridLevel level{};
    level.plan = plan.level(l);
    const Offset row = level.plan.first_row;
    const BlockMatrix coarse{level.plan.matrix,
                             memory + matrices_begin() + Offset{level.plan.first_block} * kBlockEntries};
    level.smoother.H = l == 0 ? finest : coarse;
    level.smoother.D = {level.plan.rows, memory + row * kBlockEntries};
    level.P = {level.plan.prolongation,
               memory + prolongations_begin() + Offset{level.plan.first_weight} * kBlockEntries};
    level.restriction = {level.plan.restriction, level.plan.transposed, level.P};
    level.weights = memory + weights_begin() + Offset{l} * kSweeps;
    level.right = memory + rights_begin() + row * kBodyBlock;
    level.solution = memory + solutions_begin() + row * kBodyBlock;
    level.position = memory + positions_begin() + row * kPosition;
    return level;
  }

  /// Matrix times prolongation, one level at a time.
  [[nodiscard]] STICTION_HD double* product() const { return memory + product_begin(); }
  /// A residual of any level: where the finest level's right side would be, which is the caller's.
  [[nodiscard]] STICTION_HD double* residual() const { return memory + rights_begin(); }
  /// Three numbers for each body of any level: those vectors, which preparing does not use otherwise.
  [[nodiscard]] STICTION_HD double* labels(Index k) const {
    return memory + rights_begin() + Offset{k} * plan.finest_rows();
  }
  [[nodiscard]] STICTION_HD CoarsestLevel coarsest() const {
    return {plan.level(plan.levels() - 1).place, plan.dense_bodies(), memory + dense_begin()};
  }

 private:
  // Diagonal factors come first.
  [[nodiscard]] STICTION_HD Offset matrices_begin() const { return Offset{plan.all_rows()} * kBlockEntries; }
  [[nodiscard]] STICTION_HD Offset prolongations_begin() const {
    return matrices_begin() + Offset{plan.coarse_blocks()} * kBlockEntries;
  }
  [[nodiscard]] STICTION_HD Offset product_begin() const {
    return prolongations_begin() + Offset{plan.weights()} * kBlockEntries;
  }
  [[nodiscard]] STICTION_HD Offset rights_begin() const {
    return product_begin() + Offset{plan.largest_product()} * kBlockEntries;
  }
  [[nodiscard]] STICTION_HD Offset solutions_begin() const {
    return rights_begin() + Offset{plan.all_rows()} * kBodyBlock;
  }
  [[nodiscard]] STICTION_HD Offset positions_begin() const {
    return solutions_begin() + Offset{plan.all_rows()} * kBodyBlock;
  }
  [[nodiscard]] STICTION_HD Offset weights_begin() const {
    return positions_begin() + Offset{plan.all_rows()} * kPosition;
  }
  [[nodiscard]] STICTION_HD Offset dense_begin() const { return weights_begin() + Offset{plan.levels()} * kSweeps; }
};

}  // namespace stiction::inline STICTION_ISA
