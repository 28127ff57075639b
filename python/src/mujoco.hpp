#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "python/src/mujoco_errors.hpp"
#include "python/src/mujoco_solved_part.hpp"
#include "python/src/mujoco_system.hpp"
#include "stiction/jacobian_solver.hpp"
#include "stiction/warm_start.hpp"

namespace stiction::python {

/// Positions of fields in MuJoCo's structures [bytes from their beginning], and the sizes of one model. The Python
/// side reads them from the MuJoCo that is installed, so that no header of it is needed here and any version will do.
struct MujocoLayout {
  // mjData: numbers
  std::size_t time, nefc, flg_rnepost;
  // mjData: pointers
  std::size_t qpos, qvel, ctrl, qacc, qacc_smooth, qacc_warmstart, qfrc_constraint, qLD, mass;
  std::size_t efc_type, efc_id, efc_R, efc_aref, efc_frictionloss, efc_force, efc_state;
  std::size_t efc_J, efc_J_rownnz, efc_J_rowadr, efc_J_colind, contact;
  // mjContact
  std::size_t contact_bytes, contact_dim, contact_friction, contact_geom;
  // the model
  Index nq, nv, nu;
  std::size_t simulation_bytes;                 ///< of a simulation's arrays, constraints' numbers apart
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
  MujocoHandlers handlers;
};
using MujocoFunction = void (*)(const void* model, void* data);

/// Stage done to one simulation here, between MuJoCo's functions. The stages of rk4 are parts of mj_RungeKutta:
/// begin, then enter and leave for each of 1 to 3, then end. Forward dynamics and the solve come between enter and
/// leave.
enum class OwnStage : std::uint8_t {
  count,         ///< counts rows and cones, for gather()
  write_back,    ///< writes qacc, efc_force, efc_state and qfrc_constraint, as MuJoCo's own solver does
  renew_forces,  ///< flags forces in bodies as not those of these accelerations
  rk4_begin,
  rk4_enter_1,
  rk4_enter_2,
  rk4_enter_3,
  rk4_leave_1,
  rk4_leave_2,
  rk4_leave_3,
  rk4_end,
  end,  ///< how many there are
};

/// One of MuJoCo's functions, or where that is null, a stage of ours.
struct MujocoStage {
  MujocoFunction function = nullptr;
  OwnStage own = OwnStage::end;
};

/// Treatment of simulations without rows in gather(), whose accelerations are those without constraints.
enum class Rowless : bool {
  left_out,  ///< none of their numbers is read, and no solver gets them
  kept,      ///< they are gathered as others are: for callers that want masses of all, or put others into their places
};

/// Simulations of one MuJoCo model whose constraints are solved in one batch, on one thread. Inactive simulations are
/// left alone by every call. The bits of a simulation depend on it alone.
class MujocoChunk {
 public:
  /// `data`: addresses of mjData structures that outlive this, as the layout does. `first`: number of the first one.
  MujocoChunk(const MujocoLayout& layout, MujocoFunctions functions, const void* model, std::vector<void*> data,
              std::size_t first, const SolverOptions& options, double warm_start);

  /// Another mjData of the model in the place of one; reactions stored of the simulation go with the old one.
  void replace(std::size_t simulation, void* data);
  /// Which simulations the calls that follow concern  (one each).
  void activate(const std::uint8_t* active);
  /// Takes every active simulation through these stages, one simulation after the other: memory touched by one stage
  /// is still in a cache at the next. \throws Error(unsupported) for an error of MuJoCo's, and for a kind of row that
  /// is not known, naming it.
  void run(const std::vector<MujocoStage>& stages);
  /// Collects rows, cones and masses of the simulations counted by `count`.
  void gather(Rowless rowless);
  /// Solves the gathered simulations. The limits are as in JacobianBatchView, or null.
  void solve(JacobianSolver<double>& solver, const double* tolerance, const Index* max_iterations);
  /// Writes the controls of active simulations  (simulations x nu).
  void write_controls(const double* controls);
  /// Puts these in the places of the masses gathered from active simulations, one after another in theirs. Returns the
  /// address behind them.
  const double* set_masses(const double* masses);
  /// Copies an array of every simulation, active or not, one after another. offset: of its pointer in mjData; width:
  /// its numbers.
  void read(std::size_t offset, std::size_t width, double* to) const;
  /// Drops the warm start of simulations that start over.
  void reset_warm_start(std::size_t simulation);
  /// Returns the form of M that solves with these options read (docs/math/auto.md).
  static MassForm mass_form_of(const SolverOptions& options, Index nv);
  /// Returns true if solves start from MuJoCo's qacc_warmstart, for which Newton's method in velocities needs no
  /// reactions. Environments that it leaves to others start without any.
  [[nodiscard]] bool starts_from_accelerations() const {
    return system_.mass_form == MassForm::matrix && options_.law.value_or(Law::convex) == Law::convex;
  }

  /// Returns the input of the last solve, and its answers.
  [[nodiscard]] const MujocoSystem& system() const noexcept { return system_; }
  /// Returns that system with the simulations that were left out, whose masses and accelerations are read now.
  [[nodiscard]] MujocoSystem whole_system() const;
  [[nodiscard]] std::size_t size() const noexcept { return data_.size(); }

 private:
  struct RungeKutta {
    double time;
    std::vector<double> qpos, qvel;              ///< state at the beginning
    std::vector<double> velocity, acceleration;  ///< of the four stages, and the state of one  (5 x nv)
  };

  /// work(simulation) of every active one.
  template <class Work>
  void each(const Work& work) const {
    for (std::size_t env = 0; env < data_.size(); ++env)
      if (active_[env] != 0) work(env);
  }
  void run_own(OwnStage stage, std::size_t env);
  void place(Rowless rowless);
  void fill(std::size_t env);
  void fill_motion(const std::byte* data, double* v_free, double* start, double* M) const;
  void write_back(std::size_t env);
  void rk4_begin(std::size_t env);
  void rk4_enter(std::size_t env, int stage);
  void rk4_leave(std::size_t env, int stage);
  void rk4_end(std::size_t env);
  Index count_cones(const std::byte* data, Index rows) const;
  void fill_cones(const std::byte* data, Offset row, Offset cone, Index rows);
  void fill_jacobian(const std::byte* data, double* J, Index rows) const;
  void fill_mass(const std::byte* data, double* M) const;
  void fill_factor(const std::byte* data, double* factor) const;
  /// Returns the batch's index of a degree of freedom of MuJoCo's.
  [[nodiscard]] std::size_t place_of(std::size_t dof) const {
    return system_.mass_form == MassForm::matrix ? dof : static_cast<std::size_t>(layout_.nv) - 1 - dof;
  }
  void advance(std::size_t env, double dt);
  void make_room();

  const MujocoLayout& layout_;
  MujocoFunctions functions_;
  const void* model_;
  std::vector<void*> data_;
  std::size_t first_;
  SolverOptions options_;
  double warm_start_;
  std::vector<std::uint8_t> active_;
  std::vector<Index> cones_;  ///< counted, of each simulation
  MujocoSystem system_, previous_;
  SolvedPart solved_;                   ///< of system_
  std::vector<std::uint8_t> left_out_;  ///< active simulations that were not gathered
  std::unique_ptr<WarmStartStore<double>> store_;
  std::vector<std::uint8_t> was_reset_;    ///< since the last store
  std::vector<std::uint8_t> starts_over_;  ///< from no acceleration, as after mj_resetData; since its last solve
  std::vector<double> guess_;
  std::vector<RungeKutta> rk4_;
};

}  // namespace stiction::python
