#pragma once

/// \file
/// Jacobian batches: J, M and velocities in place of A (docs/howto/jacobian.md).

#include <cstdint>
#include <vector>

#include "stiction/batch.hpp"
#include "stiction/solver.hpp"

namespace stiction {

/// Contents of the mass arrays of a JacobianBatchView.
enum class MassForm : std::uint8_t {
  matrix = 0,  ///< M itself, symmetric positive definite
  factor = 1,  ///< the lower Cholesky factor L of M = L L', with a positive diagonal
};

/// Many environments' contact systems as a physics engine has them: constraint Jacobian J, mass matrix M, velocity
/// without contact v_free. A POD over host or device memory that owns nothing. assemble(), for host memory, and
/// JacobianSolver (jacobian_solver.hpp), for either, make of each environment
///
///     A = J M^-1 J',   b = J v_free - target,   and   v+ = v_free + M^-1 J' lambda
///
/// follows from the answer (docs/howto/jacobian.md). At velocity level lambda is an impulse; with accelerations in
/// place of velocities, as MuJoCo has them, it is a force. Rows, cones, R, mu, lo and hi are those of
/// ContactBatchView, and counts allow room behind them, too. In device memory the totals are the room of the arrays.
template <class Real>
struct JacobianBatchView : BatchLayout, RowLimits<Real> {
  Offset dof_count = 0;                      ///< degrees of freedom of all environments
  Offset entry_count = 0;                    ///< length of J
  Offset mass_count = 0;                     ///< length of M
  const Offset* env_dof_offsets = nullptr;   ///< first degree of freedom of each      (env_count + 1)
  const Offset* env_mass_offsets = nullptr;  ///< first entry of M of each             (env_count + 1)
  const Offset* row_offsets = nullptr;       ///< first entry of J of each row         (row_count + 1)
  const Index* column = nullptr;  ///< CSR: degree of freedom of each entry, within the environment, duplicates
                                  ///< add up; null: each row has one entry per degree of freedom  (entry_count)
  const Real* J = nullptr;        ///< constraint Jacobian [w / v]                      (entry_count)
  const Real* M = nullptr;        ///< blocks on the diagonal, each dense and row-major, or their factors; only the
                                  ///< lower triangles are read [lambda w / v^2]        (mass_count)
  const Real* v_free = nullptr;   ///< velocity without reactions [v]                   (dof_count)
  const Real* target = nullptr;   ///< motion that rows aim at, or null: zeros [w]      (row_count)
  MassForm mass_form = MassForm::matrix;  ///< form of M
  Index mass_block = 0;  ///< rows of the blocks of M: 1 diagonal, 6 rigid bodies, ...; 0: M is one block

  /// Degrees of freedom of an environment.
  [[nodiscard]] STICTION_HD Index env_dofs(Offset env) const {
    return static_cast<Index>(env_dof_offsets[env + 1] - env_dof_offsets[env]);
  }
};

/// One environment to be appended to a JacobianBatch.
template <class Real>
struct JacobianEnvironment {
  std::vector<typename Environment<Real>::Cone> cones;  ///< cones, in the order of their rows
  std::vector<Index> row_offsets, column;               ///< CSR rows and columns of J; both empty: J is dense
  std::vector<Real> J;                                  ///< row-major, n x dofs, or CSR values
  std::vector<Real> M;                                  ///< dofs x the batch's block size, row-major
  std::vector<Real> v_free;                             ///< its length is the number of degrees of freedom
  std::vector<Real> target, R, mu, lo, hi;              ///< empty means zeros  (n)
};

/// Owner of a Jacobian batch on the host; append-only.
template <class Real>
class JacobianBatch {
 public:
  /// The batch as flat arrays, shapes as in JacobianBatchView.
  struct Arrays {
    std::vector<Offset> env_row_offsets{0};   ///< first row of each environment               (env_count + 1)
    std::vector<Offset> env_cone_offsets{0};  ///< first cone of each environment              (env_count + 1)
    std::vector<Offset> env_dof_offsets{0};   ///< first degree of freedom of each environment (env_count + 1)
    std::vector<Offset> env_mass_offsets{0};  ///< first entry of M of each environment        (env_count + 1)
    std::vector<ConeKind> cone_kind;          ///< kind of each cone                           (cone_count)
    std::vector<Offset> cone_row_offsets{0};  ///< first row of each cone                      (cone_count + 1)
    std::vector<Index> cone_group;            ///< manifold of each cone, or empty             (cone_count)
    std::vector<Offset> row_offsets{0};       ///< first entry of J of each row                (row_count + 1)
    std::vector<Index> column;                ///< of each entry of J, or empty: J is dense    (entry_count)
    std::vector<Real> J, M, v_free;           ///< numbers of J, of M and of degrees of freedom
    std::vector<Real> target, R, mu, lo, hi;  ///< numbers of the rows                         (row_count)
  };

  /// An empty batch; `mass_block` as in JacobianBatchView. \throws Error(invalid_argument) if it is below zero.
  explicit JacobianBatch(Law law = Law::convex, MassForm mass_form = MassForm::matrix, Index mass_block = 0);

  /// Appends one environment (possibly without rows). \throws Error(invalid_argument) on a wrong shape; then nothing
  /// was appended.
  void add(const JacobianEnvironment<Real>& environment);

  /// The batch as solvers read it, in host memory; valid while the batch lives and is not appended to.
  [[nodiscard]] JacobianBatchView<Real> view() const noexcept;
  /// Environments so far.
  [[nodiscard]] Offset env_count() const noexcept { return static_cast<Offset>(arrays_.env_row_offsets.size()) - 1; }
  /// Rows of all environments.
  [[nodiscard]] Offset row_count() const noexcept { return arrays_.env_row_offsets.back(); }
  /// Degrees of freedom of all environments.
  [[nodiscard]] Offset dof_count() const noexcept { return arrays_.env_dof_offsets.back(); }
  /// The arrays themselves.
  [[nodiscard]] const Arrays& arrays() const noexcept { return arrays_; }

 private:
  Law law_;
  MassForm mass_form_;
  Index mass_block_;
  bool has_columns_ = false;
  Arrays arrays_;
};

/// Most degrees of freedom of an environment that solver auto gives to Newton's method in velocities whatever it is
/// like (docs/math/velocity_newton.md). A set of them is one word, and such environments share packs.
inline constexpr Index kMostVelocityDofs = 64;

/// Start of a solve of J and M; both may be null: from v_free, without reactions. `velocities` are for Newton's method
/// in velocities (docs/math/velocity_newton.md). With them it does not read an environment's reactions, except where
/// it solves a sequence of problems. All other methods start from `reactions`. An environment whose velocities have no
/// finite squares starts without them, marked kFlagWarmStartRejected.
template <class Real>
struct JacobianStart {
  const Real* reactions = nullptr;   ///< lambda [lambda]                               (row_count)
  const Real* velocities = nullptr;  ///< v+, as of the last step or a prediction [v]   (dof_count)
};

/// Which environments are kept as factors.
enum class FactorUse : std::uint8_t {
  never,    ///< none: every A is a matrix
  by_size,  ///< those for which prefers_factor() holds: the default, one rule on every device
  always,   ///< all that have degrees of freedom
};

/// Returns true if an environment of n rows and `dofs` degrees of freedom is kept as a factor. A = Y Y' with Y = J
/// L^-T is then never formed. A sweep costs 3 n dofs multiplications where the matrix takes n^2. Its loops are
/// shorter, so that it has to save a quarter of them to be faster. Decided by these two integers, because it reaches
/// the last bits of the answer.
STICTION_HD constexpr bool prefers_factor(Offset n, Offset dofs) {
  return n > 72 && dofs > 0 && 4 * dofs < n;
}

/// Returns true if an environment is kept as a factor. One without rows or degrees of freedom has none.
STICTION_HD constexpr bool keeps_factor(FactorUse use, Offset n, Offset dofs) {
  return n > 0 && dofs > 0 && (use == FactorUse::always || (use == FactorUse::by_size && prefers_factor(n, dofs)));
}

/// Makes the contact batch of a Jacobian batch in host memory, on the CPU. M = L L' by Cholesky, Y = J L^-T, A = Y Y'
/// (symmetric to the last bit), b. Rows follow one another without room between them. An environment whose M is not
/// positive definite, or given as a factor that is not finite, is marked kFlagBadMass in env_flags. No other
/// environment is touched by it. `threads` 0: all cores; the bits do not depend on it. \throws Error(invalid_argument)
/// if the structure is broken.
template <class Real>
ContactBatch<Real> assemble(const JacobianBatchView<Real>& batch, FactorUse use = FactorUse::by_size, int threads = 0);

/// v+ = v_free + M^-1 J' lambda of every environment  (dof_count). `lambda` are the reactions of the assembled batch,
/// without room between environments. If all of an environment's reactions are zero, as of one that could not be
/// solved, its v_free comes back.
/// \throws Error(invalid_argument) if the structure is broken or lambda has another length.
template <class Real>
std::vector<Real> velocities(const JacobianBatchView<Real>& batch, std::span<const Real> lambda, int threads = 0);

/// A solution and the velocities it leads to.
template <class Real>
struct JacobianSolution {
  std::vector<Offset> env_row_offsets;  ///< where each environment's reactions begin  (env_count + 1)
  Solution<Real> contact;               ///< reactions, residual motion and status
  std::vector<Real> velocity;           ///< v+ [v]                                    (dof_count)
};

/// Assembles, solves on that device and moves the velocities in one call, for batches in host memory. Which
/// environments are kept as factors reaches the last bits of the answer, the device does not.
template <class Real>
JacobianSolution<Real> solve(const JacobianBatchView<Real>& batch, const SolverOptions& options = {},
                             Device device = Device::cpu(), std::span<const Real> warm_start = {},
                             FactorUse use = FactorUse::by_size);
/// Solves the batch of an owner.
template <class Real>
JacobianSolution<Real> solve(const JacobianBatch<Real>& batch, const SolverOptions& options = {},
                             Device device = Device::cpu(), std::span<const Real> warm_start = {},
                             FactorUse use = FactorUse::by_size) {
  return solve(batch.view(), options, device, warm_start, use);
}

}  // namespace stiction
