#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stiction/batch.hpp"

namespace stiction::scenes {

inline constexpr double kTimeStep = 0.005;  ///< every scene's time step [s]
inline constexpr double kGravity = 9.81;    ///< along -z [m/s^2]

/// Compressed sparse rows.
struct Csr {
  std::vector<Index> ptr{0};  ///< where rows begin       (row count + 1)
  std::vector<Index> col;     ///< columns, ascending     (nnz)
  std::vector<double> val;    ///< values                 (nnz)
};

/// One environment with where it came from: A = J M^-1 J', b = J v_free - row_target.
struct SceneEnv {
  Environment<double> system;      ///< lambda in N s (torsional, joint: N m s), w in m/s (rad/s)
  Index dof_count = 0;             ///< nv
  Csr M;                           ///< mass matrix, block-diagonal, SPD [kg, kg m^2]      (nv x nv)
  Csr J;                           ///< constraint Jacobian [-, m]                         (n x nv)
  std::vector<double> v_free;      ///< velocity after the step without reactions [m/s, rad/s]  (nv)
  std::vector<double> row_target;  ///< velocity each row asks for [m/s, rad/s]            (n)
};

struct SceneInfo {
  std::string name, summary;
  Law law;  ///< the law the scene is meant for
};

/// The scenes there are, in the order of scenes/README.md.
std::vector<SceneInfo> list();

/// Makes environment `index` of the scene `name`. It depends on (name, seed, index, size) alone, never on how many the
/// caller makes, and has the same bits from every compiler. `size` 0 is the scene's default; scenes/README.md gives
/// its unit.
/// \throws Error(invalid_argument) for a name that is not in list() or a size out of the scene's range.
SceneEnv make(const std::string& name, std::uint64_t seed, std::uint64_t index, int size = 0);

}  // namespace stiction::scenes
