#pragma once

/// \file
/// Devices, options, plans and the solver of contact batches.

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stiction/batch.hpp"
#include "stiction/spectrum.hpp"
#include "stiction/status.hpp"

namespace stiction {

/// Kinds of machines.
enum class DeviceKind : std::uint8_t {
  cpu = 0,       ///< this machine's processor, with the widest instructions it has
  cuda = 1,      ///< an NVIDIA GPU
  emulated = 2,  ///< the GPU's kernels and launches, run by threads of the CPU: to test GPU code where there is none.
                 ///< Slow. Its device memory is any memory of the process.
};

/// A machine to solve on. Changing it changes the speed and not one bit.
struct Device {
  DeviceKind kind = DeviceKind::cpu;  ///< kind of machine
  int ordinal = 0;                    ///< which of that kind, as CUDA numbers its devices

  /// The processor.
  static Device cpu() noexcept { return {DeviceKind::cpu, 0}; }
  /// The CUDA device of that number.
  static Device cuda(int ordinal = 0) noexcept { return {DeviceKind::cuda, ordinal}; }
  /// The device that the CPU emulates.
  static Device emulated() noexcept { return {DeviceKind::emulated, 0}; }
  /// The device of that name: "auto" (the first usable CUDA device, else the CPU), "cpu", "cuda", "cuda:1", "emulated".
  /// \throws Error(invalid_argument) for any other text, Error(no_device) when "cuda" was asked for and is not there.
  static Device from_string(const std::string& text);
};

/// One device of this machine, or the reason why there is none.
struct DeviceReport {
  Device device;        ///< which
  bool usable = false;  ///< whether a solver can be made for it
  std::string name;     ///< "NVIDIA H200", or the CPU instruction set in use
  std::string reason;   ///< why it is not usable; empty when it is
};

/// The CPU, and every CUDA device or the one line why there is none. Never throws.
std::vector<DeviceReport> devices();

/// A CUDA stream (cudaStream_t) owned by the caller; ignored by the CPU. Made from a handle or by name only, so
/// that the legacy default stream is never taken by accident.
class StreamRef {
 public:
  /// The stream of a cudaStream_t, which outlives its use.
  explicit StreamRef(void* handle) noexcept : handle_(handle) {}
  StreamRef(int) = delete;
  StreamRef(std::nullptr_t) = delete;
  /// The legacy default stream.
  static StreamRef default_stream() noexcept { return StreamRef(static_cast<void*>(nullptr)); }
  /// The cudaStream_t; null is the default stream.
  [[nodiscard]] void* handle() const noexcept { return handle_; }

 private:
  void* handle_;
};

/// Policy for an environment whose numbers break a precondition (NaN, mu < 0, ...).
enum class InvalidPolicy : std::uint8_t {
  reject,   ///< solve() throws before anything is changed, naming the first defect
  isolate,  ///< that environment is flagged and gets zeros; no other environment's bits change
};

/// Iteration of an environment's islands (groups of cones that do not act on one another, Solver::islands).
enum class IslandMode : std::uint8_t {
  together = 0,  ///< as one system: one scaling, one momentum, one residual, one stop
  apart = 1,     ///< each as a separate environment would be, and its record is made of theirs (docs/howto/islands.md)
};
/// Name of a mode, as reports print it ("together", "apart").
const char* to_string(IslandMode mode) noexcept;
/// The mode of that name. \throws Error(invalid_argument) that lists the names there are.
IslandMode island_mode_from_string(const std::string& name);

/// Which contacts a sweep solves together before it goes on (docs/howto/blocks.md). Blocks have up to 12 rows, of cones
/// wherever they stand.
enum class BlockMode : std::uint8_t {
  cones = 0,   ///< each by itself
  pairs = 1,   ///< those of one manifold: of one cone_group, or of rows that store the same columns if there are none
  strong = 2,  ///< those that A couples strongly, whatever the batch's groups
};
/// Name of a mode, as reports print it ("cones", "pairs", "strong").
const char* to_string(BlockMode mode) noexcept;
/// The mode of that name. \throws Error(invalid_argument) that lists the names there are.
BlockMode block_mode_from_string(const std::string& name);

class Tracer;

/// Options of a Solver.
struct SolverOptions {
  SolverKind solver = SolverKind::npgs;       ///< which solver
  SolverChoice choose = SolverChoice::named;  ///< spectrum: of each environment by its operator, in place of `solver`;
                                              ///< batches in host memory only (docs/howto/spectrum.md)
  SpectrumRules spectrum;                     ///< thresholds of that
  std::optional<Law> law;                     ///< overrides the batch's law
  double tolerance = 1e-4;          ///< on the relative residual (docs/math/residual.md); 0: run all iterations [-]
  Index max_iterations = 1000;      ///< per environment, >= 0
  Index stall_window = 2000;        ///< stop after that many iterations without a better residual; 0: never
  double omega = 1.0;               ///< relaxation of the sweeps of pgs and npgs, 0 < omega < 2 [-]
  int threads = 0;                  ///< CPU threads; 0: all cores
  double absolute_tolerance = 0.0;  ///< on the absolute residual; solved is where either holds [w]
  InvalidPolicy invalid = InvalidPolicy::reject;  ///< policy for numbers that break a precondition
  IslandMode islands = IslandMode::together;      ///< apart: batches in host memory only
  BlockMode blocks = BlockMode::cones;            ///< of pgs, npgs and nsgs, batches in host memory only
  Tracer* tracer = nullptr;  ///< collects where time goes (stiction/trace.hpp), outlives the solver; null: none
  /// Rows of the largest environment that a method which factorises takes a matrix for, 1024 to 32768. newton keeps
  /// two of rows x rows doubles for each thread, ipm two, admm and lemke one. Above, newton, admm and ipm take
  /// gradients and lemke refuses. Another number is for the CPU only, and not for SolverKind::automatic.
  Index direct_rows = 1024;
};

/// Outputs of a solve; same memory space as the batch.
template <class Real>
struct SolutionView {
  Real* lambda = nullptr;       ///< reactions [lambda]           (row_count)
  Real* w = nullptr;            ///< residual motion, may be null (row_count)
  EnvStatus* status = nullptr;  ///< one record each              (env_count)
};

/// Room that a solver on a GPU has. Batches that fit are solved without allocating or waiting, so that the solve can
/// be captured into a graph. Zero: as much as the batches so far have needed. On the CPU room is made as it is needed.
struct Capacity {
  Offset envs = 0;                       ///< environments of a batch
  Offset rows = 0;                       ///< rows of a batch
  Offset cones = 0;                      ///< cones of a batch
  Offset nonzeros = 0;                   ///< stored entries of A of a batch
  Index env_rows = 0;                    ///< rows of the largest environment
  Offset env_nonzeros = 0;               ///< stored entries of the environment with the most
  Index env_dofs = 0;                    ///< columns of the widest factor (docs/howto/jacobian.md)
  Precision precision = Precision::f32;  ///< the widest that batches will have
  bool semidefinite = false;             ///< whether cones of semidefinite will come (docs/math/semidefinite.md)

  /// Returns the needs of a host batch.
  template <class Real>
  static Capacity of(const ContactBatchView<Real>& batch);
};

struct PlanData;

/// Everything decided in integers before a solve: path and order of each environment. Depends on the batch's
/// structure only; reusable while the structure stays the same. Cheap to copy.
class Plan {
 public:
  /// A plan over data that Solver::plan() made.
  explicit Plan(std::shared_ptr<const PlanData> data) : data_(std::move(data)) {}
  /// The plan's integers.
  [[nodiscard]] const PlanData& data() const noexcept { return *data_; }

 private:
  std::shared_ptr<const PlanData> data_;
};

class ContactMachine;
class KeptClasses;
enum class FullRows : std::uint8_t;

/// Solves batches on one device.
class Solver {
 public:
  /// A solver on that device. \throws Error(invalid_argument) for an option out of range, Error(no_device) or
  /// Error(unsupported) when the device cannot be had; the message says why.
  Solver(Device device, const SolverOptions& options, const Capacity& capacity = {});
  ~Solver();
  Solver(Solver&&) noexcept;
  Solver& operator=(Solver&&) noexcept;

  /// Plans batches of this structure. A batch in device memory is planned from a host copy of its structure, on
  /// `stream`. \throws Error(invalid_argument) if the structure is broken.
  template <class Real>
  [[nodiscard]] Plan plan(const ContactBatchView<Real>& batch, StreamRef stream = StreamRef::default_stream()) const;

  /// Solves every environment. `warm_start` (row_count, same space) may be null: start from zero. Batch and solution
  /// in device memory: asynchronous on `stream`; in host memory: complete on return. With IslandMode::apart the plan
  /// serves batches none of whose environments has several islands; others are planned anew, island by island.
  ///
  /// A batch in host memory is checked again, whatever was done to its arrays since the plan was made. Offsets or
  /// cones out of order throw. Columns out of range throw, too, or with InvalidPolicy::isolate flag their environment
  /// kFlagBadStructure. `warm_start` may be solution.lambda itself; no other output may share memory with an input or
  /// with another output.
  /// \throws Error before anything is written, Error(unsupported) for a batch in device memory and IslandMode::apart or
  /// SolverChoice::spectrum; numerical trouble is in solution.status.
  template <class Real>
  void solve(const Plan& plan, const ContactBatchView<Real>& batch, const SolutionView<Real>& solution,
             const Real* warm_start = nullptr, StreamRef stream = StreamRef::default_stream()) const;

  /// Solves without a plan of the caller's. A batch in device memory is planned there, in the order of `stream`, so
  /// nothing waits and nothing is allocated. Queued work can be captured into a CUDA graph and replayed after numbers,
  /// contacts and counts of the batch have changed in place (docs/explanation/cuda.md). Its view's totals are then the
  /// room of its arrays. An environment beyond the capacity is flagged kFlagOverCapacity, one whose offsets are out of
  /// order kFlagBadStructure; both leave the others alone. A host batch is planned on the host by the CPU. \throws
  /// Error(invalid_argument) if the batch is beyond the capacity given to the constructor, before anything is queued.
  template <class Real>
  void solve(const ContactBatchView<Real>& batch, const SolutionView<Real>& solution, const Real* warm_start = nullptr,
             StreamRef stream = StreamRef::default_stream()) const;

  /// Finds the islands of every environment: which of its cones act on one another, however indirectly. They do so by
  /// a stored entry, either way round and whatever its value, or as neighbours of one group. `island` gets each
  /// cone's, numbered 0, 1, ... by their first cones (cone_count). `count` gets their number, 0 where the
  /// structure is broken or there is no room (env_count). A batch in device memory is searched there, within the
  /// solver's capacity, asynchronously on `stream`.
  /// \throws Error(invalid_argument) as solve() does.
  template <class Real>
  void islands(const ContactBatchView<Real>& batch, Index* island, Index* count,
               StreamRef stream = StreamRef::default_stream()) const;

  /// Throws the errors of solve() without a plan for these arguments, but for the capacity; writes nothing.
  template <class Real>
  void check(const ContactBatchView<Real>& batch, const SolutionView<Real>& solution) const;

  /// Memory on the solver's device (on the host for the CPU) for `count` numbers, given back with the last copy of the
  /// pointer. \throws Error(out_of_memory).
  template <class Real>
  [[nodiscard]] std::shared_ptr<Real> make_array(Offset count) const;

  /// Returns when the work queued on `stream` is done; at once on the CPU. \throws Error(device_failure) if it failed.
  void synchronize(StreamRef stream = StreamRef::default_stream()) const;

  /// A packed copy on the host of a batch wherever it is: unused parts of padded arrays are left out. Waits for the
  /// work queued on `stream`. \throws Error(invalid_argument) if the structure is broken, Error(unsupported) if the
  /// normal comes last.
  template <class Real>
  [[nodiscard]] ContactBatch<Real> to_host(const ContactBatchView<Real>& batch,
                                           StreamRef stream = StreamRef::default_stream()) const;
  /// Copies an array that is in the memory of a batch of that space to `target`, which has the length to be copied.
  /// Waits for the work queued on `stream`.
  template <class T>
  void to_host(std::span<T> target, const T* source, MemorySpace space,
               StreamRef stream = StreamRef::default_stream()) const {
    copy_to_host(target.data(), source, target.size_bytes(), space, stream);
  }

  /// Options that the solver was made with.
  [[nodiscard]] const SolverOptions& options() const noexcept { return options_; }
  /// Device that it solves on.
  [[nodiscard]] Device device() const noexcept { return device_; }

 private:
  template <class Real>
  void check_request(const ContactBatchView<Real>& batch, const SolutionView<Real>& solution,
                     const Real* warm_start) const;
  template <class Real>
  void check(const ContactBatchView<Real>& batch, const SolutionView<Real>& solution, const Real* warm_start,
             std::vector<FullRows>& full_rows) const;
  template <class Real>
  void dispatch(const PlanData* plan, const ContactBatchView<Real>& batch, const SolutionView<Real>& solution,
                const Real* warm_start, StreamRef stream, const std::vector<FullRows>* full_rows) const;
  template <class Real>
  void solve_by_spectrum(const ContactBatchView<Real>& batch, const SolutionView<Real>& solution,
                         const Real* warm_start, StreamRef stream) const;
  template <class Real>
  void solve_members(const SolverOptions& options, const ContactBatchView<Real>& batch, std::span<const Offset> members,
                     const SolutionView<Real>& solution, const Real* warm_start, StreamRef stream) const;
  template <class Real>
  void solve_islands(const SolverOptions& options, const PlanData* plan, const ContactBatchView<Real>& batch,
                     const SolutionView<Real>& solution, const Real* warm_start, StreamRef stream,
                     const std::vector<FullRows>* full_rows) const;
  template <class Real>
  void run(const SolverOptions& options, const PlanData* plan, const ContactBatchView<Real>& batch,
           const SolutionView<Real>& solution, const Real* warm_start, StreamRef stream,
           const std::vector<FullRows>* full_rows) const;
  void copy_to_host(void* target, const void* source, std::size_t bytes, MemorySpace space, StreamRef stream) const;

  Device device_;
  SolverOptions options_;
  std::shared_ptr<ContactMachine> machine_;
  std::shared_ptr<KeptClasses> kept_;
};

/// Host solution with owned memory.
template <class Real>
struct Solution {
  std::vector<Real> lambda;       ///< reactions [lambda]   (row_count)
  std::vector<Real> w;            ///< residual motion [w]  (row_count)
  std::vector<EnvStatus> status;  ///< one record each      (env_count)
};

/// Plans and solves a host batch on that device in one call; an empty `warm_start` starts from zero.
/// \throws as Solver, its plan() and solve(); Error(invalid_argument) for a warm start of another length.
template <class Real>
Solution<Real> solve(const ContactBatch<Real>& batch, const SolverOptions& options = {}, Device device = Device::cpu(),
                     std::span<const Real> warm_start = {});

}  // namespace stiction
