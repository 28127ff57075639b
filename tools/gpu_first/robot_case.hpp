#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stiction/jacobian_solver.hpp"
#include "tools/gpu_first/arrays.hpp"
#include "tools/gpu_first/check.hpp"

/// Cases of the plan's first minutes: environments as J and M and as A, and their solves on a device.
namespace stiction::gpu_first {

/// Names: recorded robots, and piles of 64 contacts that are made here.
inline constexpr const char* kRobots[] = {"g1", "humanoid", "leap_hand", "piles"};

/// Form of a batch.
enum class RobotForm : unsigned char { jacobian, matrix };

/// Environments, and the start of a warm solve of them. It is the answer of the same problem with each free velocity
/// changed by 5 %, as in bench/peers/robots.py.
struct RobotCase {
  std::string name;
  JacobianBatch<float> jacobians;
  ContactBatch<float> matrices;              ///< their batch by assemble()
  std::vector<float> velocities, reactions;  ///< warm starts

  [[nodiscard]] Offset env_count() const { return jacobians.env_count(); }
};

/// The case of a name, or walkers, which are made here too. It has fewer environments if the sizes are small. Nothing
/// if it is recorded and not in the folder of batches.
std::optional<RobotCase> robot_case(const Setting& setting, const std::string& name);
/// The environments in turn, until there are so many, in one form alone.
RobotCase repeated(const RobotCase& of, Offset envs, RobotForm form);

/// One solve of a case: its form, and options with the solver and the tolerance.
struct RobotSolve {
  RobotForm form;
  SolverOptions options;

  RobotSolve(RobotForm form, SolverKind solver, double tolerance);
  /// "auto 1e-4".
  [[nodiscard]] std::string name() const;
};

/// A hash of each environment's answer.
Hashes solved_here(const RobotCase& of, const RobotSolve& how, bool is_warm);

/// The case and its solver in a device's memory.
class RobotThere {
 public:
  RobotThere(Target& target, const RobotCase& of, const RobotSolve& how);
  void queue(bool is_warm);
  Hashes hashes();
  [[nodiscard]] cuda::StreamHandle stream() const { return arrays_.stream(); }

 private:
  const RobotCase& of_;
  bool is_jacobian_;
  Arrays arrays_;
  std::optional<JacobianSolver<float>> by_jacobians_;
  std::optional<Solver> by_matrices_;
  JacobianBatchView<float> jacobians_;
  ContactBatchView<float> matrices_;
  JacobianSolutionView<float> answer_;
  const float *velocities_ = nullptr, *reactions_ = nullptr;
};

}  // namespace stiction::gpu_first
