#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

#include "python/src/mujoco.hpp"

namespace stiction::python {

/// A solve of a step: the stages of every simulation before and after it. `constraint`: MuJoCo's own solver in its
/// place, or none.
struct MujocoSolve {
  std::vector<MujocoStage> before, after;
  MujocoFunction constraint = nullptr;
};

/// Many simulations of one MuJoCo model, in chunks whose memory a core's cache holds. A chunk goes through some steps,
/// with their solves, before the next one begins. Chunks share out the threads. The bits of a simulation depend on it
/// alone. Calls wait for one another, so they must not hold the interpreter lock.
class MujocoSimulations {
 public:
  MujocoSimulations(MujocoLayout layout, MujocoFunctions functions, const void* model, const std::vector<void*>& data,
                    const SolverOptions& options, double warm_start);
  MujocoSimulations(const MujocoSimulations&) = delete;
  MujocoSimulations& operator=(const MujocoSimulations&) = delete;

  /// Another mjData of the model in the place of one; reactions stored of the simulation go with the old one.
  void replace(std::size_t simulation, void* data);
  /// Options of the model that may change between steps: time step [s], and whether efc_J is CSR.
  void configure(double timestep, bool sparse);
  /// Which simulations the calls that follow concern  (one each).
  void activate(const std::vector<std::uint8_t>& active);
  /// Per simulation, as in JacobianBatchView, or empty.
  void limit(std::vector<double> tolerance, std::vector<Index> max_iterations);

  /// Takes `count` steps of these solves. Returns the wall-clock seconds before solves, in gathering, in solves and
  /// after them. Threads that work at one time share its seconds. between() is called between steps that all
  /// simulations have taken, every few steps; its exceptions end the call.
  std::array<double, 4> step(const std::vector<MujocoSolve>& solves, int count, const std::function<void()>& between);

  /// The parts of a step, as MujocoChunk has them.
  void run(const std::vector<MujocoStage>& stages);
  void gather(Rowless rowless);
  void set_masses(const double* masses);
  void solve();

  void write_controls(const double* controls);
  void read(std::size_t offset, std::size_t width, double* to) const;
  void reset_warm_start(const std::vector<Offset>& simulations);
  [[nodiscard]] bool starts_from_accelerations() const { return chunks_.front()->starts_from_accelerations(); }
  /// Simulations of a chunk, the last one's apart.
  [[nodiscard]] std::size_t chunk_size() const { return chunk_size_; }
  [[nodiscard]] bool has_factors() const { return chunks_.front()->system().mass_form == MassForm::factor; }

  /// Rows of all simulations, and their answers, as the last solve had them. Masses and free accelerations of
  /// simulations without rows are those of now.
  [[nodiscard]] MujocoSystem system() const;
  /// Records of all solves since this was last called, or a step was broken off, solve by solve of each chunk.
  std::vector<EnvStatus> take_records();
  /// Records of the last solve, one for each simulation.
  [[nodiscard]] std::vector<EnvStatus> status() const;

 private:
  template <class Work>
  void each_chunk(const Work& work);
  void solve(std::size_t chunk, int worker);
  void step_chunk(std::size_t chunk, int worker, const std::vector<MujocoSolve>& solves, int count,
                  std::array<double, 4>& seconds);

  mutable std::mutex mutex_;
  MujocoLayout layout_;
  std::size_t chunk_size_;
  int threads_;
  std::vector<std::unique_ptr<MujocoChunk>> chunks_;
  std::vector<JacobianSolver<double>> solvers_;  ///< of every worker: their memory stays in its cache
  std::vector<std::vector<EnvStatus>> records_;  ///< of every chunk
  std::vector<double> tolerance_;
  std::vector<Index> max_iterations_;
};

}  // namespace stiction::python
