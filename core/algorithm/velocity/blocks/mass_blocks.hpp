#pragma once

#include "core/algorithm/linear/block/block_algebra.hpp"
#include "core/algorithm/velocity/blocks/dof_blocks.hpp"

namespace stiction::inline STICTION_ISA {

/// M and its Cholesky factor, in double: of each group of blocks the lower triangle, dense. Numbers that a block has
/// beyond its degrees of freedom have a 1 on the diagonal.
struct MassBlocks {
  const DofBlocks& dofs;
  double* M;       ///< (36 for each of DofBlocks::mass_begin[blocks])
  double* factor;  ///< L of M = L L'                                   (as many)

  [[nodiscard]] STICTION_HD Index blocks() const { return dofs.mass_begin[dofs.count]; }
  /// Returns the first entry of a block of a row, in M and in its factor.
  [[nodiscard]] STICTION_HD Offset at(Index row, Index column) const {
    return static_cast<Offset>(dofs.mass_begin[row] + column - dofs.of_block[row]) * kBlockEntries;
  }

  /// block = that of M in any row and column.
  STICTION_HD void load_entry(Index row, Index column, double* block) const {
    const bool is_coupled = dofs.of_block[row] == dofs.of_block[column];
    for (Index i = 0; i < kBodyBlock; ++i)
      for (Index j = 0; j < kBodyBlock; ++j) {
        const double* const from = !is_coupled     ? nullptr
                                   : row >= column ? M + at(row, column) + (i * kBodyBlock + j)
                                                   : M + at(column, row) + (j * kBodyBlock + i);
        block[i * kBodyBlock + j] = is_coupled ? *from : 0.0;
      }
  }

  /// Loads M and factors it, or loads the factor and multiplies it out. True if M is positive definite, to rounding.
  template <Team TeamT, class Real>
  STICTION_HD_OUTLINE bool load(TeamT& team, const LaneEnv<Real>& env, MassForm form) const {
    double* const given = form == MassForm::matrix ? M : factor;
    for_each(team, dofs.count, [&](Index row) {
      for (Index column = dofs.of_block[row]; column <= row; ++column)
        load_block_of(env, row, column, form, given + at(row, column));
    });
    if (form == MassForm::matrix)
      for_each(team, dofs.groups, [&](Index group) { factor_group(group); });
    else
      for_each(team, dofs.count, [&](Index row) { multiply_out(row); });
    std::uint32_t broken = 0;
    for_each(team, dofs.count, [&](Index row) {
      const double* const pivot = factor + at(row, row);
      for (Index i = 0; i < kBodyBlock; ++i) {
        const double root = pivot[i * (kBodyBlock + 1)];
        // factor_block has put 2^500 in the place of a pivot that was not positive.
        if (!(root > 0.0 && root < 0x1p+499)) broken = 1;
      }
    });
    return team.combine(broken) == 0;
  }

  /// product = M v.
  template <Team TeamT>
  STICTION_HD_OUTLINE void multiply(TeamT& team, const double* v, double* product) const {
    for_each(team, dofs.groups, [&](Index group) {
      const Index first = dofs.group[group], end = dofs.group[group + 1];
      for (Index row = first; row < end; ++row) {
        double sum[kBodyBlock] = {};
        for (Index column = first; column <= row; ++column)
          multiply_block(M + at(row, column), v + static_cast<Offset>(column) * kBodyBlock, sum);
        for (Index below = row + 1; below < end; ++below)
          multiply_transposed_block(M + at(below, row), v + static_cast<Offset>(below) * kBodyBlock, sum);
        for (Index i = 0; i < kBodyBlock; ++i) product[static_cast<Offset>(row) * kBodyBlock + i] = sum[i];
      }
    });
  }

  /// v = M^-1 v.
  template <Team TeamT>
  STICTION_HD_OUTLINE void solve(TeamT& team, double* v) const {
    for_each(team, dofs.groups, [&](Index group) {
      const Index first = dofs.group[group];
      solve_group(first, dofs.group[group + 1], v + static_cast<Offset>(first) * kBodyBlock);
    });
  }

  /// v = M^-1 v for a group, its blocks from `first` to before `end`.
  STICTION_HD void solve_group(Index first, Index end, double* v) const {
    solve_down(first, end, v);
    for (Index row = end - 1; row >= first; --row) {
      double part[kBodyBlock];
      double* const own = v + static_cast<Offset>(row - first) * kBodyBlock;
      for (Index i = 0; i < kBodyBlock; ++i) part[i] = own[i];
      for (Index below = row + 1; below < end; ++below)
        subtract_transposed_image(factor + at(below, row), v + static_cast<Offset>(below - first) * kBodyBlock, part);
      solve_upper(factor + at(row, row), part);
      for (Index i = 0; i < kBodyBlock; ++i) own[i] = part[i];
    }
  }

  /// v = L^-1 v for the blocks from `first` to before `end` of one group, where v is zero before `first`.
  STICTION_HD void solve_down(Index first, Index end, double* v) const {
    for (Index row = first; row < end; ++row) {
      double part[kBodyBlock];
      double* const own = v + static_cast<Offset>(row - first) * kBodyBlock;
      for (Index i = 0; i < kBodyBlock; ++i) part[i] = own[i];
      for (Index column = first; column < row; ++column)
        subtract_image(factor + at(row, column), v + static_cast<Offset>(column - first) * kBodyBlock, part);
      solve_lower(factor + at(row, row), part);
      for (Index i = 0; i < kBodyBlock; ++i) own[i] = part[i];
    }
  }

 private:
  /// One block as the batch has it. Only entries on and below the diagonal are read; of M the rest is its mirror
  /// image.
  template <class Real>
  STICTION_HD void load_block_of(const LaneEnv<Real>& env, Index row, Index column, MassForm form, double* to) const {
    for (Index i = 0; i < kBodyBlock; ++i)
      for (Index j = 0; j < kBodyBlock; ++j) {
        const bool is_own = i < dofs.size(row) && j < dofs.size(column);
        const Index a = dofs.first_dof[row] + i, b = dofs.first_dof[column] + j;
        double& entry = to[i * kBodyBlock + j];
        if (!is_own)
          entry = row == column && i == j ? 1.0 : 0.0;
        else
          entry = a >= b ? number(env, a, b) : form == MassForm::matrix ? number(env, b, a) : 0.0;
      }
  }
  template <class Real>
  static STICTION_HD double number(const LaneEnv<Real>& env, Index row, Index column) {
    if (row / env.block != column / env.block) return 0.0;
    return static_cast<double>(env.M[static_cast<Offset>(row) * env.block + column % env.block]);
  }

  STICTION_HD void factor_group(Index group) const {
    for (Index row = dofs.group[group]; row < dofs.group[group + 1]; ++row)
      for (Index column = dofs.group[group]; column <= row; ++column) {
        double* const K = factor + at(row, column);
        for (Index i = 0; i < kBlockEntries; ++i) K[i] = M[at(row, column) + i];
        for (Index k = dofs.group[group]; k < column; ++k)
          subtract_outer(factor + at(row, k), factor + at(column, k), K);
        if (column < row)
          divide_by_transpose(factor + at(column, column), K);
        else
          factor_block(K);
      }
  }

  /// A row of M = L L'.
  STICTION_HD void multiply_out(Index row) const {
    for (Index column = dofs.of_block[row]; column <= row; ++column) {
      double* const K = M + at(row, column);
      for (Index i = 0; i < kBlockEntries; ++i) K[i] = 0.0;
      for (Index k = dofs.of_block[row]; k <= column; ++k)
        subtract_outer(factor + at(row, k), factor + at(column, k), K);
      for (Index i = 0; i < kBlockEntries; ++i) K[i] = 0.0 - K[i];
    }
  }
};

}  // namespace stiction::inline STICTION_ISA
