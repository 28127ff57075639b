#pragma once

#include <cstdint>

#include "core/algorithm/linear/block/cone_blocks.hpp"
#include "core/algorithm/linear/block/wide_product.hpp"
#include "core/algorithm/linear/dense/dense_factor.hpp"
#include "core/algorithm/linear/krylov/cg.hpp"
#include "core/algorithm/solver/admm/anderson.hpp"

namespace stiction::inline STICTION_ISA {

/// Representation of (K + rho)^-1. Chosen by integers of the environment alone.
enum class AdmmForm : std::uint8_t {
  matrix,     ///< the factor of K + rho, n x n
  velocity,   ///< where A = Y Y': the factor of a dofs x dofs matrix (Woodbury's formula)
  gradients,  ///< conjugate gradients
};

/// Returns true if an environment is a factor with so few columns that the matrix between them is cheaper than that of
/// the rows.
template <class System>
STICTION_HD bool prefers_velocity(const System& s) {
  if constexpr (kHasVelocity<System>) {
    return Offset{2} * s.dofs < s.n;
  } else {
    return false;
  }
}

/// The vectors and the factor that admm keeps, in coordinates in which every cone's block has a mean diagonal of one.
/// Cone c's rows of x are scale * z, its rows of y are motion / scale.
struct AdmmState {
  Index n;
  AdmmForm form;
  double* scale;         ///< of each row; the same on all rows of a cone
  double* g;             ///< iterate: z is its projection, u = g - z the dual over -rho
  double* z;             ///< feasible
  double* v;             ///< minimiser near z - u, on no cone
  double* f;             ///< change of g that a plain step makes
  double* f_before;      ///< the same at the iterate before
  double* image_before;  ///< where a plain step leads from the iterate before
  double* skew;          ///< matrix: (K - K') z / 2, where A is not symmetric
  double* changes;       ///< remembered changes of f, then of the image  (2 kAndersonMemory n)
  DenseMatrix factor;    ///< matrix: of K + rho. velocity: of I + (scale Y)' E^-1 (scale Y)
  double* inverse;       ///< velocity: E^-1, E being the diagonal part of K + rho
  double* scaled;        ///< gradients: a vector times scale
  double* cone_factors;  ///< gradients: of the cones' blocks of K + rho
  double* memory;        ///< gradients: their vectors
  double* answer;        ///< gradients: the v before, from which they start

  static constexpr Index kVectors = 8 + 2 * kAndersonMemory;
  static constexpr Index kMatrixFreeVectors =
      kConeBlockWorkspace + kGradientVectors + 1;  ///< vectors, instead of the matrix

  template <class System>
  static STICTION_HD AdmmState of(const System& s) {
    const Index n = s.n;
    const auto vector = [&](Index k) { return s.wide_vector(k, n); };
    double* const spare = vector(7);
    AdmmState a{n,
                form_of(s),
                vector(0),
                vector(1),
                vector(2),
                vector(3),
                vector(4),
                vector(5),
                vector(6),
                spare,
                vector(8),
                {vector(kVectors), n},
                spare,
                spare,
                vector(kVectors),
                vector(kVectors + kConeBlockWorkspace),
                vector(kVectors + kConeBlockWorkspace + kGradientVectors)};
    if constexpr (kHasVelocity<System>)
      if (a.form == AdmmForm::velocity) a.factor.n = s.dofs;
    return a;
  }
  [[nodiscard]] STICTION_HD double* change_of_f(Index slot) const { return changes + static_cast<Offset>(slot) * n; }
  [[nodiscard]] STICTION_HD double* change_of_image(Index slot) const { return change_of_f(slot + kAndersonMemory); }

 private:
  template <class System>
  static STICTION_HD AdmmForm form_of(const System& s) {
    if constexpr (kMultipliesWide<System>) {
      const Offset workspace = s.has_matrices ? Offset{s.n} * s.n : Offset{kMatrixFreeVectors} * s.n;
      if constexpr (kHasVelocity<System>)
        if (prefers_velocity(s) && Offset{s.dofs} * s.dofs <= workspace) return AdmmForm::velocity;
      if (!s.has_matrices) return AdmmForm::gradients;
    }
    return AdmmForm::matrix;
  }
};

}  // namespace stiction::inline STICTION_ISA
