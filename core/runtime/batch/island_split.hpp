#pragma once

#include <vector>

#include "core/plan/islands.hpp"
#include "stiction/solver.hpp"

namespace stiction {

/// A host batch taken apart (docs/howto/islands.md). Every island of an environment becomes a separate environment, a
/// piece, with rows, cones and stored entries in the order they had. An environment without rows or kept as a factor is
/// one piece.
template <class Real>
class IslandSplit {
 public:
  /// Splits a batch whose structure is sound, which is read again by join(). `warm_start` may be null.
  IslandSplit(const ContactBatchView<Real>& batch, const Real* warm_start, bool with_motion);

  /// Returns true if some environment has several pieces. If none has, the batch is to be solved as it is, and the
  /// parts are empty.
  [[nodiscard]] bool needed() const noexcept { return needed_; }
  /// The pieces, packed, normal first.
  [[nodiscard]] ContactBatchView<Real> pieces() const noexcept { return pieces_.view(); }
  [[nodiscard]] const Real* warm_start() const noexcept { return warm_start_.empty() ? nullptr : warm_start_.data(); }
  /// Returns the arrays for the pieces' solution.
  [[nodiscard]] SolutionView<Real> answer() noexcept {
    return {answer_.lambda.data(), answer_.w.empty() ? nullptr : answer_.w.data(), answer_.status.data()};
  }

  /// The environments' answers and records from their pieces'. Rows of padded arrays that are not in use are not
  /// written.
  void join(const SolutionView<Real>& solution) const;

 private:
  using Arrays = typename ContactBatch<Real>::Arrays;

  void take_apart(const Islands& islands);
  void add_pieces(Offset env, const Index* island, Arrays& to);
  void add_cone(Offset env, Offset cone, Arrays& to);
  void add_numbers(Offset env, std::size_t first, Arrays& to) const;
  [[nodiscard]] EnvStatus joined_status(Offset env) const;

  ContactBatchView<Real> batch_;
  bool needed_ = false;
  std::vector<Index> piece_count_;     ///< of each environment                                        (env_count)
  std::vector<Offset> piece_offsets_;  ///< first piece of each environment                            (env_count + 1)
  std::vector<Offset> source_row_;     ///< row of the batch that each row of the pieces was           (rows in use)
  std::vector<Index> place_;           ///< place in its piece of each row of the environment at hand
  ContactBatch<Real> pieces_;
  std::vector<Real> warm_start_;  ///< of the pieces' rows, or empty
  Solution<Real> answer_;         ///< w is empty where it is not wanted
};

}  // namespace stiction
