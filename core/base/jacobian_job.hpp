#pragma once

#include "stiction/jacobian.hpp"

namespace stiction {

/// What is made of a Jacobian batch, as plain data: the reader's arrays and where results go.
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

}  // namespace stiction
