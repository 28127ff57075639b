#pragma once

/// \file
/// Derivatives of reactions by the numbers of a contact batch (docs/math/derivative.md).

#include <cstdint>
#include <memory>
#include <optional>

#include "stiction/batch.hpp"
#include "stiction/jacobian.hpp"
#include "stiction/solver.hpp"
#include "stiction/status.hpp"

namespace stiction {

/// Flags of the derivative of one environment; any number of bits at once. The first five come with zeros in place of
/// numbers.
enum GradientFlag : std::uint32_t {
  kGradientInvalidInput = 1U << 0,    ///< the environment's numbers, or flags that it came with, forbid a solve. Or it
                                      ///< has a cone of box_friction or semidefinite, of which no derivatives are taken
  kGradientUnconverged = 1U << 1,     ///< the answer is not one: its code is not `solved`, or its residual is too
                                      ///< large; or the relaxed problem of DerivativeOptions::kappa was not solved
  kGradientNonFinite = 1U << 2,       ///< a reaction or a cotangent or tangent is not finite, or a result is too large
  kGradientSingular = 1U << 3,        ///< reactions are not determined: contacts are redundant and R does not decide
  kGradientOverCapacity = 1U << 4,    ///< more unknowns than DerivativeOptions::max_unknowns, or than there is room for
  kGradientUnstableBranch = 1U << 5,  ///< a sliding contact that more pressure would press on less; one of several
                                      ///< solutions, and not the one that a simulation reaches
  kGradientSubgradient = 1U << 6,     ///< some contact is between two modes: one of several generalised derivatives
  kGradientBadStructure = 1U << 7,    ///< offsets, cones or columns out of order or range, found on the device; of this
                                      ///< environment nothing but the record is written
};

/// Flags of an environment that has no derivative.
inline constexpr std::uint32_t kGradientRefused = kGradientInvalidInput | kGradientUnconverged | kGradientNonFinite |
                                                  kGradientSingular | kGradientOverCapacity | kGradientBadStructure;

/// Name of one flag bit, as reports print it ("unconverged", ...).
const char* flag_name(GradientFlag flag) noexcept;

/// The record every environment gets with its derivative, on the device that computed it. 32 bytes, no padding.
struct GradientStatus {
  double residual;          ///< of the linear system, relative (docs/math/derivative.md); the largest of all sets [-]
  double forward_residual;  ///< natural map of the reactions / max|b| (docs/math/residual.md) [-]
  std::uint32_t flags;      ///< GradientFlag bits
  Index unknowns;           ///< rows of the linear system
  Index degenerate;         ///< cones between two modes
  std::uint32_t reserved;   ///< zero
};
static_assert(sizeof(GradientStatus) == 32);

/// Options of a Derivative.
struct DerivativeOptions {
  std::optional<Law> law;        ///< overrides the batch's law; the one that was solved
  double residual_limit = 1e-3;  ///< reactions of a larger relative residual get zeros; infinity: all pass [-]
  double tie_tolerance = 1e-6;   ///< a cone this close to another mode, over max|b|, is degenerate [-]
  Index max_unknowns = 1024;     ///< of an environment; each thread keeps a square of doubles of the largest
  int threads = 0;               ///< CPU threads; 0: all cores
  double kappa = 0.0;            ///< above 0: of the problem in which reaction times motion is kappa and not 0. Open
                                 ///< contacts then pass some on (docs/math/derivative.md, "Relaxed") [lambda w]
};

/// Reactions at which a batch is differentiated, as a solve returned them; same memory space as the batch.
template <class Real>
struct ReactionView {
  const Real* lambda = nullptr;       ///< reactions [lambda]                              (row_count)
  const EnvStatus* status = nullptr;  ///< how they were found, or null: only the residual counts  (env_count)
};

/// Numbers of a solution, in `count` sets that follow one another. Cotangents are derivatives of losses by it; null:
/// zeros. Tangents are changes of it; null: not wanted.
template <class Number>
struct SolutionNumbers {
  Number* lambda = nullptr;  ///< of the reactions        (count * row_count)
  Number* w = nullptr;       ///< of the residual motion  (count * row_count)
};
/// Derivatives of losses by a solution.
template <class Real>
using SolutionCotangentView = SolutionNumbers<const Real>;
/// Changes of a solution.
template <class Real>
using SolutionTangentView = SolutionNumbers<Real>;

/// Cotangents or tangents of a solution of J and M.
template <class Number>
struct JacobianSolutionNumbers {
  Number* lambda = nullptr;    ///< of the reactions        (count * row_count)
  Number* w = nullptr;         ///< of the residual motion  (count * row_count)
  Number* velocity = nullptr;  ///< of v+                   (count * dof_count)
};
/// Derivatives of losses by a solution of J and M.
template <class Real>
using JacobianSolutionCotangentView = JacobianSolutionNumbers<const Real>;
/// Changes of a solution of J and M.
template <class Real>
using JacobianSolutionTangentView = JacobianSolutionNumbers<Real>;

/// Sweeps of solver `pgs` that are differentiated as they run, and derivatives by them beside the batch's cotangents.
template <class Real>
struct SweepsView {
  const Real* warm_start = nullptr;  ///< where they begin, or null: at zero             (row_count)
  Index count = 1;                   ///< sweeps
  double omega = 1.0;                ///< SolverOptions::omega
  Real* lambda = nullptr;            ///< out: the answer of so many sweeps              (row_count)
  Real* by_warm_start = nullptr;     ///< out, set after set: by the warm start          (count of sets * row_count)
};

/// Numbers of a batch, in `count` sets that follow one another. Cotangents are where derivatives of losses by them go;
/// null: not wanted. Tangents are changes of them; null: zeros. Entries of A are independent: each stored one gets its
/// derivative, and a caller with a symmetric A adds both. Rows that share mu each get their part. Numbers that the
/// batch does not use are not written.
template <class Number>
struct BatchNumbers {
  Number* A = nullptr;       ///< of the stored entries                           (count * nonzero_count)
  Number* factor = nullptr;  ///< of Y where A = Y Y' is not stored                (count * factor_count)
  Number* b = nullptr;       ///< of b                                            (count * row_count)
  Number* R = nullptr;       ///< of R                                            (count * row_count)
  Number* mu = nullptr;      ///< of the friction of each row; 0 where it has none (count * row_count)
  Number* lo = nullptr;      ///< of lower bounds; 0 where they do not hold       (count * row_count)
  Number* hi = nullptr;      ///< of upper bounds                                 (count * row_count)
};
/// Derivatives of losses by a batch's numbers.
template <class Real>
using BatchCotangentView = BatchNumbers<Real>;
/// Changes of a batch's numbers.
template <class Real>
using BatchTangentView = BatchNumbers<const Real>;

/// Cotangents or tangents of a Jacobian batch. Stored entries of J are independent. M is a symmetric parameter. The
/// product of its cotangent with a symmetric change is the change of the loss, and of a tangent the symmetric part
/// counts. Only the lower triangle of a factor L is written and read, and zeros are written above it.
template <class Number>
struct JacobianBatchNumbers {
  Number* J = nullptr;       ///< of the stored entries        (count * entry_count)
  Number* M = nullptr;       ///< of M, or of its factor       (count * mass_count)
  Number* v_free = nullptr;  ///< of v_free                    (count * dof_count)
  Number* target = nullptr;  ///< of target                    (count * row_count)
  Number* R = nullptr;       ///< of R                         (count * row_count)
  Number* mu = nullptr;      ///< of the friction of each row  (count * row_count)
  Number* lo = nullptr;      ///< of lower bounds              (count * row_count)
  Number* hi = nullptr;      ///< of upper bounds              (count * row_count)
};
/// Derivatives of losses by a Jacobian batch's numbers.
template <class Real>
using JacobianBatchCotangentView = JacobianBatchNumbers<Real>;
/// Changes of a Jacobian batch's numbers.
template <class Real>
using JacobianBatchTangentView = JacobianBatchNumbers<const Real>;

class DerivativeMachine;

/// Differentiates the solution of contact batches by the batch's numbers, implicitly. The modes of the contacts (open,
/// sticking, sliding, at a bound) stay as they are, which leaves one linear system for each environment. It takes no
/// part in a solve, whose bits and time stay as they are. All arrays are where the batch is. Bits depend on nothing but
/// the environment (docs/math/derivative.md).
class Derivative {
 public:
  /// Derivatives on that device. A device takes its memory now: of the capacity env_rows is needed, and env_dofs for
  /// factors and for J and M. Larger environments get zeros and kGradientOverCapacity. On the CPU room is made as it is
  /// needed. With kappa > 0 a device also takes room for capacity.rows reactions, which grows as that of batches of
  /// J and M does.
  /// \throws Error(invalid_argument) for an option out of range or a capacity without rows, Error(no_device) or
  /// Error(unsupported) when the device cannot be had, Error(out_of_memory).
  explicit Derivative(Device device = Device::cpu(), const DerivativeOptions& options = {},
                      const Capacity& capacity = {});
  ~Derivative();
  Derivative(Derivative&&) noexcept;
  Derivative& operator=(Derivative&&) noexcept;

  /// Pulls `count` sets of cotangents of the solution back to the batch (a vector-Jacobian product). One factor serves
  /// all sets. An environment that is refused gets zeros and a flag, and no other environment's bits change.
  /// `status` gets one record for each environment.
  /// \throws Error(invalid_argument) for a broken structure, a missing array or a count below zero. Also for an output
  /// that shares memory with another array. Then nothing was written.
  template <class Real>
  void vjp(const ContactBatchView<Real>& batch, const ReactionView<Real>& at,
           const SolutionCotangentView<Real>& cotangents, const BatchCotangentView<Real>& gradients,
           GradientStatus* status, Offset count = 1, StreamRef stream = StreamRef::default_stream()) const;

  /// Pushes `count` sets of changes of the batch forward to its solution (a Jacobian-vector product).
  /// \throws as vjp().
  template <class Real>
  void jvp(const ContactBatchView<Real>& batch, const ReactionView<Real>& at, const BatchTangentView<Real>& tangents,
           const SolutionTangentView<Real>& changes, GradientStatus* status, Offset count = 1,
           StreamRef stream = StreamRef::default_stream()) const;

  /// Pulls cotangents of reactions, motion and velocities back to J, M, v_free and the rows' numbers. A is assembled
  /// anew as the solve did. `at.lambda` lies where the batch's rows do. An environment whose M is no mass matrix is
  /// refused as kGradientInvalidInput. A device takes room for the largest batch so far: a call that needs more waits
  /// for those before it, and may not be captured.
  /// \throws as that of a contact batch; Error(out_of_memory) on a device.
  template <class Real>
  void vjp(const JacobianBatchView<Real>& batch, const ReactionView<Real>& at,
           const JacobianSolutionCotangentView<Real>& cotangents, const JacobianBatchCotangentView<Real>& gradients,
           GradientStatus* status, Offset count = 1, StreamRef stream = StreamRef::default_stream()) const;

  /// Pushes `count` sets of changes of J, M, v_free and the rows' numbers forward to reactions, motion and velocities.
  /// \throws as vjp() of J and M.
  template <class Real>
  void jvp(const JacobianBatchView<Real>& batch, const ReactionView<Real>& at,
           const JacobianBatchTangentView<Real>& tangents, const JacobianSolutionTangentView<Real>& changes,
           GradientStatus* status, Offset count = 1, StreamRef stream = StreamRef::default_stream()) const;

  /// Pulls the results' cotangents of so many sweeps of solver `pgs` to the batch and to their warm start. It is
  /// the derivative of the iterations, not of the solution that they come near. The solve is one with tolerance 0,
  /// stall_window 0 and `max_iterations` = sweeps.count. Sweeps are run again in double, in the solver's own order, and
  /// kept. It takes 2 (n + sweeps) n doubles an environment of n rows, and n may not exceed `max_unknowns`. In the
  /// record `forward_residual` is that of the answer, and `unconverged` is never set. A device takes room for the
  /// longest sweeps so far. A call that needs more waits for those before it, and may not be captured
  /// (docs/math/derivative.md, "Unrolled").
  /// \throws as vjp(); Error(invalid_argument) for sweeps.count < 0 or omega outside (0, 2); Error(out_of_memory) on a
  /// device.
  template <class Real>
  void unrolled_vjp(const ContactBatchView<Real>& batch, const SweepsView<Real>& sweeps,
                    const SolutionCotangentView<Real>& cotangents, const BatchCotangentView<Real>& gradients,
                    GradientStatus* status, Offset count = 1, StreamRef stream = StreamRef::default_stream()) const;

  /// Returns when the work queued on `stream` is done; at once on the CPU.
  void synchronize(StreamRef stream = StreamRef::default_stream()) const;

  /// Options that it was made with.
  [[nodiscard]] const DerivativeOptions& options() const noexcept { return options_; }

 private:
  Device device_;
  DerivativeOptions options_;
  std::shared_ptr<DerivativeMachine> machine_;
};

}  // namespace stiction
