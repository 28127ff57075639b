#pragma once

#include <utility>
#include <vector>

#include "core/algorithm/linear/block/block_ldl.hpp"
#include "core/algorithm/linear/block/incomplete_cholesky.hpp"
#include "core/algorithm/linear/block/scalar_diagonal.hpp"
#include "core/algorithm/linear/block/sparse_inverse.hpp"
#include "core/algorithm/linear/krylov/cg.hpp"
#include "core/plan/block_factor_plan.hpp"
#include "core/plan/ordering.hpp"
#include "core/plan/sparse_inverse_plan.hpp"
#include "tests/support/systems/box_scenes.hpp"

namespace stiction::test {

enum class Preconditioning { scalar_diagonal, block_diagonal, incomplete_cholesky, sparse_inverse, block_ldl };
inline constexpr Preconditioning kAllPreconditionings[] = {
    Preconditioning::scalar_diagonal, Preconditioning::block_diagonal, Preconditioning::incomplete_cholesky,
    Preconditioning::sparse_inverse, Preconditioning::block_ldl};

inline const char* name_of(Preconditioning kind) {
  switch (kind) {
    case Preconditioning::scalar_diagonal:
      return "scalar diagonal";
    case Preconditioning::block_diagonal:
      return "block diagonal";
    case Preconditioning::incomplete_cholesky:
      return "incomplete Cholesky";
    case Preconditioning::sparse_inverse:
      return "sparse inverse";
    case Preconditioning::block_ldl:
      return "block LDL'";
  }
  return "";
}

/// A matrix, and the plan and memory of one preconditioner for it, which the lanes of a team share.
struct PreconditionerWorkspace {
  BlockSystem system;
  Preconditioning kind;
  std::vector<Index> plan;
  std::vector<double> memory;

  PreconditionerWorkspace(BlockSystem of, Preconditioning what, Ordering ordering = kDefaultOrdering)
      : system(std::move(of)), kind(what) {
    const BlockPattern pattern = system.pattern();
    Offset doubles = BlockDiagonal::doubles(pattern.rows);
    if (kind == Preconditioning::incomplete_cholesky || kind == Preconditioning::block_ldl) {
      append_block_factor(plan, pattern, order_rows(pattern, ordering),
                          kind == Preconditioning::block_ldl ? Fill::complete : Fill::none);
      doubles = BlockLdl::doubles(factor().lower.blocks());
    }
    if (kind == Preconditioning::sparse_inverse) {
      append_sparse_inverse(plan, pattern);
      const SparseInverseView view = inverse();
      doubles = SparseInverse::doubles(pattern.rows, view.lower.blocks(), view.dense_offsets[pattern.rows]);
    }
    memory.assign(static_cast<std::size_t>(doubles), -77.0);
  }

  [[nodiscard]] Index n() const { return system.pattern().rows * kBodyBlock; }
  [[nodiscard]] BlockFactorView factor() const {
    const Index* next = plan.data();
    return take_block_factor(next);
  }
  [[nodiscard]] SparseInverseView inverse() const {
    const Index* next = plan.data();
    return take_sparse_inverse(next);
  }

  /// Prepares the preconditioner and calls f(preconditioner), on every lane.
  template <Team TeamT, class F>
  void use(TeamT& team, F&& f) {
    const BlockMatrix H = system.matrix();
    const auto prepared = [&](auto preconditioner) {
      preconditioner.prepare(team, H);
      f(preconditioner);
    };
    switch (kind) {
      case Preconditioning::scalar_diagonal:
        return prepared(ScalarDiagonal{H.pattern.rows, memory.data()});
      case Preconditioning::block_diagonal:
        return prepared(BlockDiagonal{H.pattern.rows, memory.data()});
      case Preconditioning::incomplete_cholesky:
        return prepared(IncompleteCholesky{factor(), memory.data()});
      case Preconditioning::sparse_inverse:
        return prepared(SparseInverse::in(inverse(), memory.data()));
      case Preconditioning::block_ldl:
        return prepared(BlockLdl{factor(), memory.data()});
    }
  }

  /// M^-1 r.
  std::vector<double> apply(const std::vector<double>& r) {
    std::vector<double> z(r.size(), -77.0);
    SerialTeam team;
    use(team, [&](const auto& preconditioner) { preconditioner.apply(team, r.data(), z.data()); });
    return z;
  }

  GradientOutcome solve(const std::vector<double>& b, std::vector<double>& x, double tolerance, Index most) {
    std::vector<double> vectors(b.size() * kGradientVectors);
    x.assign(b.size(), 0.0);
    SerialTeam team;
    GradientOutcome outcome;
    use(team, [&](const auto& preconditioner) {
      outcome = conjugate_gradient(team, system.matrix(),
                                   {system.matrix().unknowns(), b.data(), x.data(), vectors.data(), tolerance, most},
                                   preconditioner);
    });
    return outcome;
  }
};

/// Numbers in [-1, 1), the same from every standard library.
inline std::vector<double> random_vector(Index n, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<double> v(static_cast<std::size_t>(n));
  for (double& x : v) x = static_cast<double>(random()) * 0x1p-31 - 1.0;
  return v;
}

inline double dot(const std::vector<double>& v, const std::vector<double>& w) {
  double sum = 0.0;
  for (std::size_t i = 0; i < v.size(); ++i) sum += v[i] * w[i];
  return sum;
}

/// H as n x n numbers, row by row.
inline std::vector<double> dense_of(const BlockMatrix& H) {
  const auto n = static_cast<std::size_t>(H.pattern.rows * kBodyBlock);
  std::vector<double> K(n * n, 0.0);
  for (Index row = 0; row < H.pattern.rows; ++row)
    for (Index k = H.pattern.offsets[row]; k < H.pattern.offsets[row + 1]; ++k)
      for (Index i = 0; i < kBlockEntries; ++i)
        K[static_cast<std::size_t>(row * kBodyBlock + i / kBodyBlock) * n +
          static_cast<std::size_t>(H.pattern.columns[k] * kBodyBlock + i % kBodyBlock)] = H.block(k)[i];
  return K;
}

}  // namespace stiction::test
