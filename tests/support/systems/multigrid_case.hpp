#pragma once

#include <vector>

#include "core/algorithm/linear/krylov/cg.hpp"
#include "core/algorithm/linear/multigrid/multigrid.hpp"
#include "core/plan/multigrid_plan.hpp"
#include "tests/support/systems/stacked_boxes.hpp"

namespace stiction::test {

/// A hierarchy with its memory, full of NaN before it is prepared.
class MultigridCase {
 public:
  MultigridCase(OwnedBlocks H, std::vector<double> positions, MultigridOptions options)
      : H_(std::move(H)), positions_(std::move(positions)) {
    append_multigrid(stream_, H_.pattern.view(), options.prolongation);
    const Index* next = stream_.data();
    grids_.plan = take_multigrid(next);
    grids_.cycle = options.cycle;
    memory_.assign(static_cast<std::size_t>(Multigrid::doubles(grids_.plan)), __builtin_nan(""));
    grids_.memory = memory_.data();
  }
  MultigridCase(const StackedBoxes& scene, double R, MultigridOptions options)
      : MultigridCase(scene.matrix(R), scene.positions(), options) {}
  MultigridCase(const MultigridCase&) = delete;
  MultigridCase& operator=(const MultigridCase&) = delete;

  /// The hierarchy of one lane, prepared by the whole block.
  template <Team TeamT>
  Multigrid prepared(TeamT& team) {
    Multigrid mine = grids_;
    mine.prepare(team, H_.view(), positions_.data());
    return mine;
  }

  [[nodiscard]] BlockMatrix H() { return H_.view(); }
  [[nodiscard]] std::size_t size() const { return 6 * static_cast<std::size_t>(H_.pattern.rows()); }
  [[nodiscard]] const std::vector<double>& memory() const { return memory_; }

 private:
  OwnedBlocks H_;
  std::vector<double> positions_;
  std::vector<Index> stream_;
  std::vector<double> memory_;
  Multigrid grids_;
};

inline constexpr MultigridOptions kMultigridKinds[] = {{Prolongation::plain, Cycle::v},
                                                       {Prolongation::plain, Cycle::w},
                                                       {Prolongation::smoothed, Cycle::v},
                                                       {Prolongation::smoothed, Cycle::w}};

/// Conjugate gradients for H x = b from zero.
template <class Preconditioner>
GradientOutcome iterate(const BlockMatrix& H, const Preconditioner& preconditioner, const std::vector<double>& b,
                        double tolerance, Index most, std::vector<double>& x) {
  x.assign(b.size(), 0.0);
  std::vector<double> memory(b.size() * kGradientVectors);
  SerialTeam team;
  return conjugate_gradient(team, H, {H.unknowns(), b.data(), x.data(), memory.data(), tolerance, most},
                            preconditioner);
}

}  // namespace stiction::test
