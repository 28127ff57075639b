#pragma once

#include "stiction/jacobian.hpp"
#include "stiction/status.hpp"

namespace stiction {

/// Inputs and outputs of a Jacobian batch, as plain data: the reader's arrays and where results go.
template <class Real>
struct JacobianJob {
  JacobianBatchView<Real> batch;
  const Offset* rows;              ///< first row of each environment in b and lambda       (env_count + 1)
  const Offset* matrix;            ///< first entry of each one's A                         (env_count + 1)
  const Offset* factor;            ///< first entry of each one's Y                         (env_count + 1)
  Real* A = nullptr;               ///< out: n x n, row-major; no room: the environment is kept as a factor
  Real* b = nullptr;               ///< out                                                 (rows)
  Real* Y = nullptr;               ///< out: n x dofs, row-major, Y Y' = A
  std::uint32_t* flags = nullptr;  ///< in and out: EnvFlag bits                        (env_count)
  const Real* lambda = nullptr;    ///< reactions                                       (rows)
  Real* velocity = nullptr;        ///< out: v_free + M^-1 J' lambda                    (dof_count)
};

/// Bits of JacobianArrays::answered. No launch tries an environment again in a precision that it was tried in.
inline constexpr std::uint8_t kAnswered = 1, kTriedInDouble = 2, kTried = 4;

/// The arrays of a contact batch that shares the cones and vectors of the Jacobian batch that it is made of. The two
/// have the same rows, room included, so only the results of J and M are stored anew.
template <class Real>
struct JacobianArrays {
  std::uint32_t* flags;    ///< EnvFlag bits                                            (envs)
  Offset* matrix;          ///< first entry of each A                                   (envs + 1)
  Offset* factor;          ///< first entry of each Y                                   (envs + 1)
  Offset* parts;           ///< scratch of a scan                                       (kScanParts)
  Offset* row_offsets;     ///< first entry of each row of A                            (rows + 1)
  Index* row_counts;       ///< entries of each row                                     (rows)
  Offset* column_offsets;  ///< zeros: all rows share one list of columns               (rows)
  Index* column;           ///< 0, 1, 2, ...                                            (env_rows)
  Real* A;                 ///<                                                         (matrix_room)
  Real* Y;                 ///<                                                         (factor_room)
  Real* b;                 ///<                                                         (rows)
  Index* env_row_counts;   ///< rows left to solve, 0 of answered environments; null: all (envs)
  Index* env_cone_counts;  ///< cones of them                                           (envs)
  std::uint8_t* answered;  ///< kAnswered: Newton's method in velocities has solved it  (envs)
  EnvStatus* status;       ///< how                                                     (envs)
  Index env_rows;          ///< most rows of an environment
  Index env_dofs;          ///< most degrees of freedom
  Offset matrix_room;
  Offset factor_room;
  FactorUse use;
};

/// Inputs and outputs of a Jacobian batch whose integers are known to the device that it is on alone.
template <class Real>
struct JacobianBatchJob {
  JacobianBatchView<Real> batch;
  JacobianArrays<Real> to;
  const Real* lambda = nullptr;  ///< reactions, where the batch's rows are        (row_count)
  EnvStatus* status = nullptr;   ///< how they were found                          (env_count)
  Real* velocity = nullptr;      ///< out                                          (dof_count)

  [[nodiscard]] STICTION_HD JacobianJob<Real> job() const {
    return {batch, batch.env_row_offsets, to.matrix, to.factor, to.A, to.b, to.Y, to.flags, lambda, velocity};
  }
};

/// The contact batch, its totals being the room of its arrays.
template <class Real>
ContactBatchView<Real> contact_view(const JacobianBatchView<Real>& batch, const JacobianArrays<Real>& arrays) {
  ContactBatchView<Real> view;
  static_cast<BatchLayout&>(view) = batch;
  static_cast<RowLimits<Real>&>(view) = batch;
  view.nonzero_count = arrays.matrix_room;
  if (arrays.answered != nullptr) {
    view.env_row_counts = arrays.env_row_counts;
    view.env_cone_counts = arrays.env_cone_counts;
  }
  view.ends_early = batch.env_row_counts == nullptr;
  view.env_flags = arrays.flags;
  view.row_offsets = arrays.row_offsets;
  view.row_counts = arrays.row_counts;
  view.column = arrays.column;
  view.column_offsets = arrays.column_offsets;
  view.column_count = arrays.env_rows;
  view.A = arrays.A;
  if (arrays.use != FactorUse::never) {
    view.factor_offsets = arrays.factor;
    view.factor = arrays.Y;
    view.factor_count = arrays.factor_room;
  }
  view.b = arrays.b;
  return view;
}

}  // namespace stiction
