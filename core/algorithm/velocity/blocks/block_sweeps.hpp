#pragma once

#include "core/algorithm/load/step_sizes.hpp"
#include "core/algorithm/residual/final_residual.hpp"
#include "core/algorithm/sweep/local_solve.hpp"
#include "core/algorithm/sweep/nesterov.hpp"
#include "core/algorithm/sweep/sweep.hpp"
#include "core/algorithm/velocity/blocks/block_terms.hpp"

namespace stiction::inline STICTION_ISA {

/// Gauss-Seidel on velocities (docs/math/si.md). A cone reads the velocities of the blocks that it touches, and takes
/// the step that every solver takes. It pushes the change into all blocks that M couples with those. Cones of one level
/// push no block in common. The order is that of a sweep from the first cone to the last.
struct BlockSweeps {
  const BlockTerms& terms;
  const MassBlocks& mass;
  SweepLists& lists;
  Law law;

  /// A cone as local_step() reads one.
  struct LocalProblem {
    using Real = double;
    struct Numbers {
      const double* data;
      Index stride;
      STICTION_HD double operator[](Index k) const { return data[stride * k]; }
    };
    const double* B;  ///< the cone's block of A + R in the coordinates of the unit cone
    Index rows;
    Numbers x, inv_n, inv_t, damping, share, lo, hi;
    [[nodiscard]] STICTION_HD double block_entry(Index, Index i, Index j) const { return B[i * rows + j]; }
  };

  /// Lists the blocks that each cone pushes, and levels. Returns true if no cone pushes more than there is room for.
  template <Team TeamT>
  STICTION_HD_OUTLINE bool find(TeamT& team) const {
    const ConeTouches& cones = terms.cones();
    std::uint32_t too_many = 0;
    for_each(team, cones.cones, [&](Index c) {
      Index count = 0;
      for_each_group(c, [&](Index, Index first, Index end) { count += end - first; });
      if (count > kMostTouches) too_many = 1;
    });
    if (team.combine(too_many) != 0) return false;
    const Index levels = team.broadcast([&] { return list_levels(); });
    lists.levels = levels;
    for_each(team, cones.cones, [&](Index c) {
      double* const path = terms.n.path + static_cast<Offset>(team.rank()) * kMostGroupBlocks * kBodyBlock;
      find_pushes(c, path);
      find_steps(c);
    });
    return true;
  }

  /// Nesterov's momentum; it starts over where a sweep changes more than the one before.
  struct Momentum {
    double theta = 1.0;
    double beta = 0.0;
    double size = __builtin_huge_val();  ///< of the last sweep's largest step [w]
  };
  template <Team TeamT>
  STICTION_HD Momentum start(TeamT& team) const {
    for_each(team, terms.rows, [&](Index row) { terms.n.x_before[row] = terms.n.x[row]; });
    for_each(team, terms.unknowns(), [&](Index i) { terms.n.pushed_before[i] = terms.n.pushed[i]; });
    return {};
  }

  /// Makes sweeps on terms.n.x, whose velocities are in terms.n.pushed.
  template <Team TeamT>
  STICTION_HD_OUTLINE void run(TeamT& team, Index count, Momentum& momentum) const {
    const BlockWorkspace& n = terms.n;
    for (Index k = 0; k < count; ++k) {
      extrapolate(team, terms.rows, momentum.beta, n.x, n.x_before);
      extrapolate(team, terms.unknowns(), momentum.beta, n.pushed, n.pushed_before);
      double largest = 0.0;
      for (Index level = 0; level < lists.levels; ++level) {
        const Index first = lists.level_offsets[level];
        for_each(team, lists.level_offsets[level + 1] - first,
                 [&](Index i) { largest = max_(visit(lists.order[first + i]), largest); });
      }
      largest = team.max(largest);
      const bool restarts = largest > momentum.size;
      const NesterovStep<double> next = nesterov_step(restarts ? 1.0 : momentum.theta);
      momentum = {next.next, restarts ? 0.0 : next.beta, largest};
    }
  }

 private:
  static constexpr Index kSteps = BlockWorkspace::kSteps;

  /// f(touch, first block, end) for every group of M that a cone touches; `touch` is its first one there.
  template <class F>
  STICTION_HD void for_each_group(Index c, F&& f) const {
    const ConeTouches& cones = terms.cones();
    const DofBlocks& dofs = terms.lists.dofs;
    for (Index t = cones.begin[c]; t < cones.begin[c + 1];) {
      const Index first = dofs.of_block[cones.block[t]], begin = t;
      Index end = first + 1;
      while (end < dofs.count && dofs.of_block[end] == first) ++end;
      while (t < cones.begin[c + 1] && cones.block[t] < end) ++t;
      f(begin, first, end);
    }
  }

  template <Team TeamT>
  static STICTION_HD void extrapolate(TeamT& team, Index count, double beta, double* now, double* before) {
    for_each(team, count, [&](Index i) {
      const double value = now[i];
      now[i] = fma_(beta, value - before[i], value);
      before[i] = value;
    });
  }

  /// The level of a cone is above those of all before it that push one of its blocks.
  STICTION_HD Index list_levels() const {
    const Index cones = terms.cones().cones;
    for (Index block = 0; block < terms.lists.dofs.count; ++block) lists.last[block] = -1;
    for (Index l = 0; l <= cones; ++l) lists.level_offsets[l] = 0;
    Index levels = 0;
    for (Index c = 0; c < cones; ++c) {
      Index level = 0;
      for_each_group(
          c, [&](Index, Index first, Index) { level = lists.last[first] >= level ? lists.last[first] + 1 : level; });
      for_each_group(c, [&](Index, Index first, Index) { lists.last[first] = level; });
      lists.level[c] = level;
      ++lists.level_offsets[level + 1];
      levels = level >= levels ? level + 1 : levels;
    }
    for (Index l = 0; l < levels; ++l) lists.level_offsets[l + 1] += lists.level_offsets[l];
    for (Index c = cones - 1; c >= 0; --c) lists.order[--lists.level_offsets[lists.level[c] + 1]] = c;
    for (Index l = 0; l < levels; ++l) lists.level_offsets[l] = lists.level_offsets[l + 1];
    lists.level_offsets[levels] = cones;
    return levels;
  }

  /// Returns the pushes of a cone: kBodyBlock numbers for each block and each row.
  [[nodiscard]] STICTION_HD double* pushes(Index c) const {
    return terms.n.Y + static_cast<Offset>(terms.cones().row[c]) * kMostTouches * kBodyBlock;
  }

  /// M^-1 J' of a cone, group by group.
  STICTION_HD void find_pushes(Index c, double* path) const {
    const ConeTouches& cones = terms.cones();
    const Index rows = cones.rows(c);
    double* to = pushes(c);
    for_each_group(c, [&](Index begin, Index first, Index end) {
      for (Index k = 0; k < rows; ++k) {
        for (Index i = 0; i < (end - first) * kBodyBlock; ++i) path[i] = 0.0;
        for (Index t = begin; t < cones.begin[c + 1] && cones.block[t] < end; ++t)
          for (Index i = 0; i < kBodyBlock; ++i)
            path[(cones.block[t] - first) * kBodyBlock + i] = terms.n.J[cones.entry[t] + k * kBodyBlock + i];
        mass.solve_group(first, end, path);
        for (Index block = 0; block < end - first; ++block)
          for (Index i = 0; i < kBodyBlock; ++i) to[(block * rows + k) * kBodyBlock + i] = path[block * kBodyBlock + i];
      }
      to += static_cast<Offset>(end - first) * rows * kBodyBlock;
    });
  }

  /// The cone's block and its step lengths.
  STICTION_HD void find_steps(Index c) const {
    const ConeTouches& cones = terms.cones();
    const BlockWorkspace& n = terms.n;
    const Index rows = cones.rows(c), first_row = cones.row[c];
    double* const B = n.B + static_cast<Offset>(first_row) * kMaxConeRows;
    for (Index i = 0; i < rows * rows; ++i) B[i] = 0.0;
    const double* from = pushes(c);
    for_each_group(c, [&](Index begin, Index first, Index end) {
      for (Index t = begin; t < cones.begin[c + 1] && cones.block[t] < end; ++t)
        for (Index i = 0; i < rows; ++i)
          for (Index j = 0; j < rows; ++j)
            for (Index k = 0; k < kBodyBlock; ++k)
              B[i * rows + j] = fma_(n.J[cones.entry[t] + i * kBodyBlock + k],
                                     from[((cones.block[t] - first) * rows + j) * kBodyBlock + k], B[i * rows + j]);
      from += static_cast<Offset>(end - first) * rows * kBodyBlock;
    });
    for (Index i = 0; i < rows; ++i)
      for (Index j = 0; j < rows; ++j) {
        const double whole = B[i * rows + j] + (i == j ? n.R[first_row + i] : 0.0);
        B[i * rows + j] = (n.mu[first_row + i] * n.mu[first_row + j]) * whole;
      }
    double* const steps = n.steps + kSteps * static_cast<Offset>(c);
    steps[0] = inverse_of_positive(B[0]);
    for (Index k = 1; k < kSteps; ++k) steps[k] = 0.0;
    if (rows == 1) return;
    with_shape(ConeKind::friction, rows, [&](auto shape) {
      constexpr int kRows = decltype(shape)::kRows;
      if constexpr (kRows > 1) {
        const LocalProblem local = problem(c);
        const double whole = largest_eigenvalue_bound<kRows, 0>(local, 0);
        const double tangential = largest_eigenvalue_bound<kRows, 1>(local, 0);
        steps[1] = inverse_of_positive(max_(tangential, whole * static_cast<double>(kSmallestTangential)));
        const BlockMetric<double> metric = block_metric<kRows>(local, 0, steps[0], steps[1]);
        steps[2] = metric.damping;
        steps[3] = metric.share;
      }
    });
  }

  [[nodiscard]] STICTION_HD LocalProblem problem(Index c) const {
    const BlockWorkspace& n = terms.n;
    const Index first = terms.cones().row[c];
    return {n.B + static_cast<Offset>(first) * kMaxConeRows,
            terms.cones().rows(c),
            {n.unit_x + first, 1},
            {n.steps + kSteps * c, 0},
            {n.steps + kSteps * c + 1, 0},
            {n.steps + kSteps * c + 2, 0},
            {n.steps + kSteps * c + 3, 0},
            {n.law + 3 * c + 1, 0},
            {n.law + 3 * c + 2, 0}};
  }

  /// Moves a cone, and pushes its change. Returns the size of that in units of w.
  STICTION_HD double visit(Index c) const {
    if (terms.cones().rows(c) == 1) return visit_as(ConeShape<ConeKind::box, 1>{}, c);
    return with_shape(ConeKind::friction, terms.cones().rows(c), [&](auto shape) {
      if constexpr (decltype(shape)::kKind == ConeKind::friction) return visit_as(shape, c);
      return 0.0;
    });
  }
  template <class Shape>
  STICTION_HD double visit_as(Shape shape, Index c) const {
    constexpr int kRows = Shape::kRows;
    const BlockWorkspace& n = terms.n;
    const Index first = terms.cones().row[c];
    double images[kMaxConeRows] = {};
    terms.times_cone(c, n.pushed, images);
    double y[kRows];
    for (int k = 0; k < kRows; ++k) {
      const Index row = first + k;
      n.unit_x[row] = k == 0 ? n.x[row] : unit_reaction(n.x[row], n.mu[row]);
      y[k] = n.mu[row] * fma_(n.R[row], n.x[row], images[k] + n.b[row]);
    }
    const auto step = law == Law::coulomb ? local_step<Law::coulomb>(shape, problem(c), 0, 0, y, 1.0)
                                          : local_step<Law::convex>(shape, problem(c), 0, 0, y, 1.0);
    const double size = step_size(step, n.weight[c]);
    if (size == 0.0) return size;
    double change[kRows];
    for (int k = 0; k < kRows; ++k) {
      change[k] = n.mu[first + k] * step.d[k];
      n.x[first + k] = n.x[first + k] + change[k];
    }
    const double* from = pushes(c);
    for_each_group(c, [&](Index, Index begin, Index end) {
      for (Index block = begin; block < end; ++block)
        for (int k = 0; k < kRows; ++k, from += kBodyBlock)
          for (Index i = 0; i < kBodyBlock; ++i) {
            double& v = n.pushed[static_cast<Offset>(block) * kBodyBlock + i];
            v = fma_(from[i], change[k], v);
          }
    });
    return size;
  }
};

}  // namespace stiction::inline STICTION_ISA
