#pragma once

#include <vector>

#include "scenes/multibody.hpp"
#include "scenes/scenes.hpp"

namespace stiction::scenes {

/// Block-diagonal mass matrix with a Cholesky factor per block.
class BlockMass {
 public:
  explicit BlockMass(const Multibody& bodies);

  [[nodiscard]] Index dof_count() const noexcept { return offsets_.back(); }
  [[nodiscard]] Csr matrix() const;
  /// M^-1 x.
  [[nodiscard]] std::vector<double> solve(std::vector<double> x) const;
  /// A = J M^-1 J' into the system's CSR arrays. Rows that share a block are coupled, even where the value happens to
  /// be zero. The pattern is hence that of the contact graph; A is symmetric to the bit.
  void assemble(const Csr& J, Environment<double>& system) const;

 private:
  struct Block {
    Index first = 0, size = 0;
    std::vector<double> mass, factor;  ///< row-major; lower Cholesky factor  (size x size)
  };

  /// x <- L^-1 x within one block.
  static void solve_lower(const Block& block, double* x);
  static void solve_upper(const Block& block, double* x);

  std::vector<Index> offsets_;   ///< first dof of each block  (block count + 1)
  std::vector<Index> block_of_;  ///< block of each dof        (dof count)
  std::vector<Block> blocks_;
};

}  // namespace stiction::scenes
