#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "stiction/jacobian_solver.hpp"
#include "stiction/warm_start.hpp"

namespace stiction::python {

/// Where fields lie in MuJoCo's structures [bytes from their beginning], and the sizes of one model. The Python side
/// reads them from the MuJoCo that is installed, so that no header of it is needed here and any version will do.
struct MujocoLayout {
  // mjData: numbers
  std::size_t time, nefc;
  // mjData: pointers
  std::size_t qpos, qvel, qacc, qacc_smooth, qacc_warmstart, qfrc_constraint, qLD, mass;
  std::size_t efc_type, efc_id, efc_R, efc_aref, efc_frictionloss, efc_force, efc_state;
  std::size_t efc_J, efc_J_rownnz, efc_J_rowadr, efc_J_colind, contact;
  // mjContact
  std::size_t contact_bytes, contact_dim, contact_friction, contact_geom;
  // the model
  Index nq, nv;
  bool sparse;                                  ///< whether efc_J is CSR
  std::vector<Index> mass_rownnz, mass_colind;  ///< pattern of M's lower triangle and of qLD, by rows
  std::vector<std::int32_t> row_kind;           ///< by efc_type: a ConeKind, or kPyramid
  std::vector<Index> rotations;                 ///< first dof of each ball and free joint's rotation that RK4 corrects
  double timestep;                              ///< [s]
};

/// In row_kind: rows of a pyramidal contact, each of which is a unilateral row (an edge of the pyramid).
inline constexpr std::int32_t kPyramid = 4;

/// MuJoCo's functions that are called here.
struct MujocoFunctions {
  void (*mul_jac_t_vec)(const void* model, const void* data, double* result, const double* vector);
  void (*integrate_pos)(const void* model, double* qpos, const double* qvel, double dt);
};
using MujocoStage = void (*)(const void* model, void* data);

/// Rows of all simulations as MuJoCo left them, one simulation behind the other: a Jacobian batch of accelerations and
/// forces, and its answer. Room only grows.
///
/// Newton's method in velocities takes M, and degrees of freedom as MuJoCo has them, each after what it hangs on. For
/// solvers of A they are in reversed order. MuJoCo has M = L' D L. Backwards that is the Cholesky factor (L' D^1/2
/// read from its last row and column), which need not be computed again.
struct MujocoSystem {
  explicit MujocoSystem(MassForm form);  ///< with some room everywhere, because a view of nothing still names arrays

  MassForm mass_form;

  std::vector<Offset> env_row_offsets, env_cone_offsets, env_dof_offsets, env_mass_offsets;
  std::vector<Offset> cone_row_offsets, row_offsets;
  std::vector<std::uint8_t> cone_kind;
  std::vector<std::uint64_t> cone_id;
  std::vector<double> J, M, v_free, target, R, mu, lo, hi;
  std::vector<double> start;  ///< accelerations to start from, where mass_form is matrix
  std::vector<double> lambda, velocity;
  std::vector<EnvStatus> status;

  [[nodiscard]] JacobianBatchView<double> view() const;
  [[nodiscard]] ContactBatchView<double> structure() const;  ///< cones and rows alone, as a warm-start store wants them
};

/// Many simulations of one MuJoCo model whose constraints are solved in one batch. Simulations that are not active are
/// left alone by every call. The bits of a simulation depend on it alone. Calls need no interpreter lock.
class MujocoSimulations {
 public:
  /// `data`: addresses of mjData structures that outlive this.
  MujocoSimulations(MujocoLayout layout, MujocoFunctions functions, const void* model, std::vector<void*> data,
                    const SolverOptions& options, double warm_start);

  /// Another mjData of the model in the place of one; reactions stored of the simulation go with the old one.
  void replace(std::size_t simulation, void* data);
  /// Options of the model that may change between steps: time step [s], and whether efc_J is CSR.
  void configure(double timestep, bool sparse);
  /// Which simulations the calls that follow concern  (one each).
  void activate(std::vector<std::uint8_t> active);
  /// Calls MuJoCo's functions one after the other on every active simulation.
  void run(const std::vector<MujocoStage>& stages);
  /// Collects rows, cones and masses. \throws Error(unsupported) for a kind of row that is not known, naming it.
  void gather();
  /// Solves what was gathered. The limits are as in JacobianBatchView, or empty.
  void solve(const std::vector<double>& tolerance, const std::vector<Index>& max_iterations);
  /// Writes qacc, efc_force, efc_state and qfrc_constraint, as MuJoCo's own solver does.
  void scatter();
  /// Drops what simulations that start over would start from.
  void reset_warm_start(const std::vector<Offset>& simulations);
  /// Whether solves start from MuJoCo's qacc_warmstart, for which Newton's method in velocities needs no reactions.
  /// What it leaves to others starts without any.
  [[nodiscard]] bool starts_from_accelerations() const {
    return system_.mass_form == MassForm::matrix && options_.law.value_or(Law::convex) == Law::convex;
  }

  /// Runge-Kutta of order 4 as mj_RungeKutta does it, with the constraints of all simulations solved between its
  /// stages. Call begin, then for stage 1, 2, 3 (enter, forward dynamics, leave), then end.
  void rk4_begin();
  void rk4_enter(int stage);
  void rk4_leave(int stage);
  void rk4_end();

  [[nodiscard]] const MujocoSystem& system() const noexcept { return system_; }
  [[nodiscard]] const MujocoLayout& layout() const noexcept { return layout_; }
  [[nodiscard]] std::size_t size() const noexcept { return data_.size(); }

 private:
  struct RungeKutta {
    double time;
    std::vector<double> qpos, qvel;              ///< state at the beginning
    std::vector<double> velocity, acceleration;  ///< of the four stages  (4 x nv)
  };

  void each(const std::function<void(std::size_t)>& work) const;
  void count();
  void fill(std::size_t env);
  Index count_cones(const std::byte* data, Index rows) const;
  void fill_cones(const std::byte* data, Offset row, Offset cone, Index rows);
  void fill_jacobian(const std::byte* data, double* J, Index rows) const;
  void fill_mass(const std::byte* data, double* M) const;
  void fill_factor(const std::byte* data, double* factor) const;
  /// Where the batch has a degree of freedom of MuJoCo's.
  [[nodiscard]] std::size_t place_of(std::size_t dof) const {
    return system_.mass_form == MassForm::matrix ? dof : static_cast<std::size_t>(layout_.nv) - 1 - dof;
  }
  void advance(std::size_t env, const double* velocity, const double* acceleration, double dt);
  void make_room();

  MujocoLayout layout_;
  MujocoFunctions functions_;
  const void* model_;
  std::vector<void*> data_;
  SolverOptions options_;
  double warm_start_;
  std::vector<std::uint8_t> active_;
  MujocoSystem system_, previous_;
  JacobianSolver<double> solver_;
  std::unique_ptr<WarmStartStore<double>> store_;
  std::vector<std::uint8_t> was_reset_;    ///< since the last store
  std::vector<std::uint8_t> starts_over_;  ///< from no acceleration, as after mj_resetData; since its last solve
  std::vector<double> guess_;
  std::vector<RungeKutta> rk4_;
};

}  // namespace stiction::python
